//! Shunts between the low sides and ground, with their amplifiers.
//!
//! A shunt carries the current of its leg only while the low side conducts: its switch, or, while both switches are
//! off, its diode, which takes a current that flows into the motor. Otherwise it carries no current. The amplifier
//! follows with a time constant: `v = zero_v + volts_per_a i + offset` after a first-order lag, between its rails.

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::bridge::{Bridge, Piece};
use super::{CODES, REFERENCE_V};
use stm32g4_unicorn::chip::TICKS_PER_S;

/// Shunts and amplifiers; those of the legs a, b, c are alike except for their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shunts {
    /// Output for a current into the motor, V/A.
    pub volts_per_a: f64,
    /// Output without current, V.
    pub zero_v: f64,
    /// Lowest and highest output, V.
    pub rails_v: (f64, f64),
    /// Time constant of the amplifier with its filter, s.
    pub settling_s: f64,
    /// Relative errors of the gains.
    pub gain_error: [f64; 3],
    /// Errors of the output without current, V.
    pub offset_v: [f64; 3],
    /// Noise of a conversion, V rms.
    pub noise_v: f64,
}

/// The currents of a period, as far as they are known.
#[derive(Clone, Copy, Debug, Default)]
pub struct Currents {
    /// Currents at the beginning, A.
    pub at: [f64; 3],
    /// Their slopes, A/s.
    pub slope: [f64; 3],
}

/// The amplifiers at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Amplifiers {
    /// Currents that correspond to their outputs, A.
    lagged: [f64; 3],
}

impl Amplifiers {
    /// Follows the shunts for some ticks, starting `phase` ticks after the top of the counter. `currents` begin at that time.
    pub fn follow(
        &mut self,
        shunts: &Shunts,
        bridge: &Bridge,
        currents: &Currents,
        phase: i64,
        ticks: u32,
    ) {
        for (leg, lagged) in self.lagged.iter_mut().enumerate() {
            let (at, slope) = (currents.at[leg], currents.slope[leg]);
            for (after, length, on) in cut(&bridge.legs[leg].pieces, phase, ticks) {
                let seconds = |ticks: u32| f64::from(ticks) / TICKS_PER_S as f64;
                // The lag delays a ramp by the time constant.
                let (begin, end) =
                    (at + slope * seconds(after), at + slope * seconds(after + length));
                let conducts = on[1] || !on[0] && begin > 0.0;
                let late = slope * shunts.settling_s;
                let (begin, end) = if conducts { (begin - late, end - late) } else { (0.0, 0.0) };
                let rest = (-seconds(length) / shunts.settling_s).exp();
                *lagged = end + (*lagged - begin) * rest;
            }
        }
    }

    /// Returns the output of an amplifier, V.
    pub fn volts(&self, shunts: &Shunts, leg: usize, noise: f64) -> f64 {
        let gain = shunts.volts_per_a * (1.0 + shunts.gain_error[leg]);
        let volts = shunts.zero_v + shunts.offset_v[leg] + gain * self.lagged[leg];
        volts.clamp(shunts.rails_v.0, shunts.rails_v.1) + noise
    }

    /// Returns the counts of a conversion that samples now.
    pub fn code(&self, shunts: &Shunts, leg: usize, rng: &mut Xoshiro256PlusPlus) -> u16 {
        let unit: f64 = StandardNormal.sample(rng);
        let volts = self.volts(shunts, leg, unit * shunts.noise_v);
        (volts / REFERENCE_V * CODES).clamp(0.0, CODES - 1.0) as u16
    }
}

/// Returns the pieces of the gates in `ticks` ticks from `phase`, which repeat with the period: beginning after
/// `phase`, duration, and switches.
fn cut(pieces: &[Piece], phase: i64, ticks: u32) -> impl Iterator<Item = (u32, u32, [bool; 2])> {
    let period: u32 = pieces.iter().map(|piece| piece.ticks).sum();
    let mut phase = phase.rem_euclid(i64::from(period.max(1))) as u32;
    let mut done = 0;
    std::iter::from_fn(move || {
        let piece = pieces.iter().find(|piece| phase < piece.from + piece.ticks)?;
        let length = (piece.from + piece.ticks - phase).min(ticks - done);
        if length == 0 {
            return None;
        }
        let begin = done;
        done += length;
        phase = (phase + length) % period;
        Some((begin, length, piece.on))
    })
}

#[cfg(test)]
mod tests {
    use super::super::ALL;
    use super::*;

    fn shunts() -> Shunts {
        ALL[1].shunts.expect("the board has shunts")
    }

    #[test]
    fn pieces_repeat_with_the_period() {
        let piece = |from, ticks, low: bool| Piece { from, ticks, on: [!low, low] };
        let pieces = [piece(0, 10, true), piece(10, 20, false), piece(30, 10, true)];
        let cut: Vec<_> = cut(&pieces, -5, 50).map(|(at, ticks, on)| (at, ticks, on[1])).collect();
        assert_eq!(
            cut,
            [(0, 5, true), (5, 10, true), (15, 20, false), (35, 10, true), (45, 5, true)]
        );
    }

    #[test]
    fn the_amplifier_ends_at_its_rails() {
        let shunts = shunts();
        // 3.29 V minus 1.71 V at 51.8 mV/A are 30.5 A; a current into the motor lowers the output.
        for (amperes, volts) in [(30.0, 0.156), (40.0, 0.010), (-29.0, 3.2122), (-40.0, 3.29)] {
            let seen = Amplifiers { lagged: [0.0, 0.0, amperes] }.volts(&shunts, 2, 0.0);
            assert!((seen - volts).abs() < 1.1e-3, "{amperes} A: {seen} V");
        }
    }

    #[test]
    fn a_ramp_is_late_by_the_time_constant() {
        let shunts = shunts();
        let mut bridge = Bridge::default();
        for leg in &mut bridge.legs {
            leg.pieces = vec![Piece { from: 0, ticks: 28_334, on: [false, true] }];
        }
        let currents = Currents { at: [1.0; 3], slope: [20_000.0; 3] };
        let mut amplifiers = Amplifiers::default();
        amplifiers.follow(&shunts, &bridge, &currents, 0, 1700);
        // 10 us are 25 time constants.
        let expected = 1.0 + 20_000.0 * (10e-6 - shunts.settling_s);
        assert!((amplifiers.lagged[0] - expected).abs() < 1e-9, "{:?}", amplifiers.lagged);
    }
}
