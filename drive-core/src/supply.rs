//! Precharge relay, which bridges the resistor through which the rectifier charges the dc link.
//!
//! The relay closes when the link has been steady for a time, at or above the trip voltage of the drive, and opens below
//! that voltage. The link is steady if its voltage stays within the band of [`Relay`] around the voltage at the
//! beginning of the time. With a resistor R and a capacitor C the link approaches its final value E as
//! `E - v = (E - v_0) exp(-t/RC)`, so that at most `band / (exp(t/RC) - 1)` is missing when the relay closes.

use core::num::NonZeroU32;

/// Coefficients of the relay.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Relay {
    /// Voltage below which the relay opens, V.
    least_v: f32,
    /// Largest change of the voltage of a steady link, V.
    band_v: f32,
    /// Control periods for which the link must be steady until the relay closes.
    settle: NonZeroU32,
}

/// State of the relay. It is kept over stops and starts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelayState {
    /// Voltage at the beginning of the steady time, V, and its control periods so far.
    from_v: f32,
    steady: u32,
    /// Whether the relay is closed.
    pub closed: bool,
}

impl Relay {
    /// Creates a relay that closes `settle` control periods after the link has become steady within `band_v`, and
    /// opens below `least_v`, both V. None with 0 periods.
    pub fn new(least_v: f32, band_v: f32, settle: u32) -> Option<Self> {
        Some(Self { least_v, band_v, settle: NonZeroU32::new(settle)? })
    }

    /// Runs one control period with the voltage of the dc link, V.
    pub fn step(&self, state: &mut RelayState, dc_link: f32) {
        // False for NaN.
        let charged = dc_link >= self.least_v;
        if !charged {
            *state = RelayState::default();
        } else if state.closed {
        } else if (dc_link - state.from_v).abs() > self.band_v {
            (state.from_v, state.steady) = (dc_link, 0);
        } else {
            state.steady += 1;
            state.closed = state.steady >= self.settle.get();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use crate::PERIOD_S;

    const END_V: f32 = 311.0;

    /// A link is charged from 0 through R and C. The relay closes when the link is steady within the stated limit, and not at once.
    #[test]
    fn it_closes_near_the_end_of_charging_whatever_the_resistor() {
        for tau_s in [0.05_f32, 0.5, 2.0] {
            let relay = Relay::new(200.0, 5.0, 3000).unwrap();
            let mut state = RelayState::default();
            let (mut v, mut n) = (0.0_f32, 0);
            while !state.closed {
                v += (END_V - v) * PERIOD_S / tau_s;
                relay.step(&mut state, v);
                n += 1;
                assert!(n < 1_000_000, "never closed with {tau_s} s");
            }
            // 10 mV are added for the rounding of the voltage.
            let missing = 5.0 / ((0.5 / tau_s).exp() - 1.0) + 0.01;
            assert!(END_V - v <= missing, "{tau_s} s: {v} V, {missing} V may be missing");
            assert!(n > 3000, "{tau_s} s: after {n} periods");
        }
    }

    #[test]
    fn it_opens_at_once_below_the_least_and_closes_anew() {
        let relay = Relay::new(200.0, 5.0, 10).unwrap();
        let mut state = RelayState::default();
        let steps = |state: &mut RelayState, v: f32, n: u32| {
            (0..n).for_each(|_| relay.step(state, v));
            state.closed
        };
        assert!(!steps(&mut state, 311.0, 10) && steps(&mut state, 311.0, 1));
        // A sag that stays above the limit does not open the relay, however fast it is.
        assert!(steps(&mut state, 205.0, 1) && steps(&mut state, 390.0, 1));
        assert!(!steps(&mut state, 199.0, 1));
        assert!(!steps(&mut state, 311.0, 10) && steps(&mut state, 311.0, 1));
        // This link is steady, but too low.
        state = RelayState::default();
        assert!(!steps(&mut state, 199.0, 1000) && !steps(&mut state, f32::NAN, 1000));
    }
}
