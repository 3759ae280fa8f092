//! Travel watch: a current sensor whose signal stands while the current turns.
//!
//! Where there is no carrier, nothing but the fundamental wave shows whether a sensor is alive. While the flux makes a quarter
//! turn, a current that turns with it moves each phase by 0.29 of its amplitude at least, and the other phase by no more than
//! five times of that. So a channel is silent that moved by less than [`SILENT_SHARE`] of the other one and less than
//! [`SILENT_A`], while the other one moved by more than [`MOVES_A`]. No model and no voltage take part, so no control hides it.
//!
//! The currents are looked at once a carrier period, over as many of them as a quarter turn takes, four looks at least: a sensor
//! that opens or sticks is noticed one carrier period after that. Simulated on the dissertation's motor at 900, 1800 and
//! 3000 rpm: `tests/silent_sensors.rs`.

use crate::Fault;
use crate::carrier::CARRIER_SAMPLES;
use crate::math::frames::Abc;

/// Looks that are kept, a power of two, and carrier periods between the first and the last.
const LOOKS: usize = 8;
const MOST: usize = LOOKS - 1;
/// Least carrier periods. Three looks at a current that is reversed meanwhile may see the same value (5 of 4600 such runs).
const LEAST: usize = 3;
/// Turn of the flux in which each phase moves.
const TURN: f32 = 0.25;
/// Travel of a sensor that is silent relative to the other one.
const SILENT_SHARE: f32 = 0.12;
/// The same, and the least travel of the other one, A on the reference board: 12 times and 80 times its noise.
const SILENT_A: f32 = 0.06;
const MOVES_A: f32 = 0.4;

/// Coefficients of the watch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TravelWatch {
    /// Largest travel of a silent sensor, A.
    silent_a: f32,
    /// Least travel of the other one, A.
    moves_a: f32,
}

/// State of the watch.
#[derive(Clone, Copy, Debug)]
pub struct TravelWatchState {
    /// Currents a and b of the last looks, A, around, and the place of the next.
    looks: [[f32; 2]; LOOKS],
    next: usize,
    /// Looks since it began anew.
    taken: usize,
}

impl TravelWatchState {
    /// No looks yet.
    pub const NEW: Self = Self { looks: [[0.0; 2]; LOOKS], next: 0, taken: 0 };
}

impl TravelWatch {
    /// Watch for sensors whose range is so many times that of the reference board.
    pub fn new(range: f32) -> Self {
        Self { silent_a: range * SILENT_A, moves_a: range * MOVES_A }
    }

    /// Looks at the currents; once a carrier period. `flux_freq`: frequency of the flux, electrical turns per control period, or 0
    /// where there is a carrier: then it begins anew.
    ///
    /// # Errors
    /// [`Fault::SensorSilentA`] or [`Fault::SensorSilentB`].
    pub fn step(
        &self,
        state: &mut TravelWatchState,
        phases: &Abc,
        flux_freq: f32,
    ) -> Result<(), Fault> {
        let turn = flux_freq.abs() * CARRIER_SAMPLES as f32;
        if turn * (MOST as f32) < TURN {
            state.taken = 0;
            return Ok(());
        }
        state.looks[state.next % LOOKS] = [phases.a, phases.b];
        state.next = state.next.wrapping_add(1);
        state.taken = state.taken.saturating_add(1);
        // The quarter turn ends in the last of these periods.
        let periods = ((TURN / turn) as usize + 1).clamp(LEAST, MOST);
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
    /// Largest less least value of both channels in so many carrier periods, A.
    fn travel(&self, periods: usize) -> [f32; 2] {
        let look = |ago: usize| self.looks[self.next.wrapping_sub(1 + ago) % LOOKS];
        let (mut least, mut largest) = (look(0), look(0));
        for ago in 1..=periods {
            for ((now, least), largest) in look(ago).into_iter().zip(&mut least).zip(&mut largest) {
                if now < *least {
                    *least = now;
                }
                if now > *largest {
                    *largest = now;
                }
            }
        }
        [largest[0] - least[0], largest[1] - least[1]]
    }
}
