//! Travel watch: detects a current sensor whose signal does not change while the current rotates.
//!
//! Without injection, only the fundamental wave shows whether a sensor works. While the flux makes a quarter turn, a current
//! that rotates with it changes in each phase by at least 0.29 of its amplitude (its travel), and in the other phase by no more
//! than five times that. A channel counts as silent if its travel is less than [`SILENT_SHARE`] of the other travel and less
//! than [`SILENT_A`], while the travel of the other channel is more than [`MOVES_A`]. No model and no voltage are involved, so
//! no control action can hide the defect.
//!
//! The currents are recorded once an injection period, over as many periods as a quarter turn takes, with at least four records.
//! A sensor that opens or sticks is detected one injection period after that. It was simulated on the dissertation's motor at
//! 900, 1800 and 3000 rpm: `tests/silent_sensors.rs`.

use crate::Fault;
use crate::carrier::CARRIER_SAMPLES;
use crate::math::frames::Abc;

/// Number of records that are kept, a power of two, and injection periods between the first and the last.
const LOOKS: usize = 8;
const LONGEST_PERIODS: usize = LOOKS - 1;
/// Shortest time, injection periods. In two periods, with three records, a current that is reversed may show the same value three
/// times (5 of 4600 such runs).
const SHORTEST_PERIODS: usize = 3;
/// Turn of the flux in which the current of each phase must change.
const TURN: f32 = 0.25;
/// Largest travel of a silent sensor, relative to the other one.
const SILENT_SHARE: f32 = 0.12;
/// Largest travel of a silent sensor, and least travel of the other one, A on the reference board: 6 times and 80 times
/// its noise. (With 0.06 A, 3 of 9600 reversals above 1800 rpm of a simulated motor that saturates showed the same value
/// four times.)
const SILENT_A: f32 = 0.03;
const MOVES_A: f32 = 0.4;

/// Coefficients of the watch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TravelWatch {
    /// Largest travel of a silent sensor, A.
    silent_a: f32,
    /// Least travel of the other one, A.
    moves_a: f32,
}

/// State of the watch.
#[derive(Clone, Copy, Debug)]
pub struct TravelWatchState {
    /// Ring of the currents a and b of the last records, A, and position of the next one.
    looks: [[f32; 2]; LOOKS],
    next: usize,
    /// Number of records since the last reset.
    taken: usize,
}

impl TravelWatchState {
    /// State without records.
    pub const NEW: Self = Self { looks: [[0.0; 2]; LOOKS], next: 0, taken: 0 };
}

impl TravelWatch {
    /// Creates the watch for sensors whose range is `range` times that of the reference board.
    pub fn new(range: f32) -> Self {
        Self { silent_a: range * SILENT_A, moves_a: range * MOVES_A }
    }

    /// Records the currents; called once an injection period. `flux_freq` is the frequency of the flux, electrical turns per
    /// control period, or 0 with injection, which resets the watch.
    ///
    /// # Errors
    /// [`Fault::SensorSilentA`] or [`Fault::SensorSilentB`].
    pub fn step(
        &self,
        state: &mut TravelWatchState,
        phases: &Abc,
        flux_freq: f32,
    ) -> Result<(), Fault> {
        // This is the turn from one record to the next, modulo half a turn, since half a turn shows a current and its opposite.
        // Around 300 Hz the records therefore show no change.
        let turn = flux_freq.abs() * CARRIER_SAMPLES as f32;
        let turn = if turn > TURN { (turn - 0.5).abs() } else { turn };
        if turn * (LONGEST_PERIODS as f32) < TURN {
            state.taken = 0;
            return Ok(());
        }
        state.looks[state.next % LOOKS] = [phases.a, phases.b];
        state.next = state.next.wrapping_add(1);
        state.taken = state.taken.saturating_add(1);
        // The quarter turn ends in the last of these periods.
        let periods = ((TURN / turn) as usize + 1).clamp(SHORTEST_PERIODS, LONGEST_PERIODS);
        if state.taken <= periods {
            return Ok(());
        }
        let [a, b] = state.travel(periods);
        let silent = |this: f32, other: f32| {
            this < self.silent_a && this < SILENT_SHARE * other && other > self.moves_a
        };
        Fault::SensorSilentA.unless(!silent(a, b))?;
        Fault::SensorSilentB.unless(!silent(b, a))
    }
}

impl TravelWatchState {
    /// Returns the largest less the least value of both channels in so many injection periods, A.
    fn travel(&self, periods: usize) -> [f32; 2] {
        let look = |ago: usize, n: usize| self.looks[self.next.wrapping_sub(1 + ago) % LOOKS][n];
        [0, 1].map(|n| {
            let (mut least, mut largest) = (look(0, n), look(0, n));
            for now in (1..=periods).map(|ago| look(ago, n)) {
                least = if now < least { now } else { least };
                largest = if now > largest { now } else { largest };
            }
            largest - least
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use core::f64::consts::TAU;

    /// Returns the records until the fault for a current with this amplitude, A, that rotates at `hz` from this angle, turns. From
    /// record `dead` on a sensor shows a constant value instead.
    fn until(
        (ampere, hz, from): (f64, f64, f64),
        (dead, sensor, shown): (usize, usize, f32),
    ) -> Option<(usize, Fault)> {
        let (watch, mut state) = (TravelWatch::new(1.0), TravelWatchState::NEW);
        (0..100).find_map(|look| {
            let angle = TAU * (from + hz * look as f64 / 600.0);
            let mut seen = [0.0, TAU / 3.0].map(|axis| (ampere * (angle - axis).cos()) as f32);
            if look >= dead {
                seen[sensor] = shown;
            }
            let phases = Abc::new(seen[0], seen[1], -(seen[0] + seen[1]));
            let fault = watch.step(&mut state, &phases, (hz / 6000.0) as f32).err()?;
            Some((look, fault))
        })
    }

    /// Returns frequencies from the least one of the watch to that of a spindle, and angles over a whole turn.
    fn cases() -> impl Iterator<Item = (f64, f64)> {
        let angles = |hz| (0..36).map(move |n| (hz, f64::from(n) / 36.0));
        let watched =
            [24.0, -30.0, 45.0, 60.0, -80.0, 100.0, 120.0, 200.0, -260.0, 345.0, 400.0, 450.0];
        watched.into_iter().flat_map(angles)
    }

    /// Between 279 and 321 Hz the records show a current and its opposite, so nothing is judged.
    #[test]
    fn around_half_the_rate_of_the_looks_nothing_is_judged() {
        for n in 0..36 {
            for hz in [279.0, 290.0, -299.0, 300.0, 301.0, 315.0, 321.0] {
                assert_eq!(until((4.0, hz, f64::from(n) / 36.0), (100, 0, 0.0)), None, "{hz} {n}");
            }
        }
    }

    #[test]
    fn sensors_that_follow_are_not_silent() {
        for (hz, from) in cases() {
            for ampere in [0.2, 0.7, 4.0] {
                assert_eq!(until((ampere, hz, from), (100, 0, 0.0)), None, "{ampere} {hz} {from}");
            }
        }
    }

    /// The fault comes after a quarter turn, at least four records, plus or minus one record. In this time a current of 3 A changes
    /// the other sensor by enough.
    #[test]
    fn a_sensor_that_stands_is_named_within_a_quarter_turn() {
        for (hz, from) in cases() {
            let periods = (0.25 * 600.0 / hz.abs()).ceil().max(3.0) as usize;
            for (sensor, fault) in [(0, Fault::SensorSilentA), (1, Fault::SensorSilentB)] {
                for shown in [0.0, 1.7] {
                    let (look, found) = until((3.0, hz, from), (20, sensor, shown)).unwrap();
                    assert_eq!(found, fault, "{hz} {from} {shown}");
                    let looks = 19 + periods..=21 + periods;
                    assert!(looks.contains(&look), "{hz} {from} {shown}: {}", look - 20);
                }
            }
        }
    }

    /// Below the least frequency, with injection, or if the other sensor hardly changes, nothing is judged.
    #[test]
    fn where_little_moves_nothing_is_judged() {
        assert_eq!(until((3.0, 21.0, 0.0), (0, 0, 0.0)), None);
        assert_eq!(until((3.0, 0.0, 0.0), (0, 1, 0.0)), None);
        assert_eq!(until((0.19, 60.0, 0.0), (0, 1, 0.0)), None);
    }
}
