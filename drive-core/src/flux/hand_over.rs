//! Hand-over of the angle between two sources: at low stator frequency the [filter](super::angle_filter) gives the angle, at
//! high stator frequency the [back-EMF observer](super::observer).
//!
//! The observer leads (gives the angle) from above a frequency that the settings derive from the motor, 16 Hz for most motors, until
//! below 4 Hz less. The sources are not blended, because a blend would show the filter a speed that is partly its own. Angles do not
//! jump at a switch, and nothing has to be preset. The injection is switched off 10 Hz above that frequency and on 8 Hz above it, so
//! that it still shows the stator resistance to the observer. The averages of the demodulation fill in eight injection periods, during
//! which the observer leads.
//!
//! For three periods after the injection was switched on or off, the current of a sample does not belong to the voltages before
//! it. In these periods the flux rotates as in the last injection period. (Otherwise the angle jumped by 4 degrees.)
//!
//! While the injection is on, the turn from the observer is its mean over an injection period, because an oscillation of the
//! axis at 600 Hz would bias the demodulation, by up to 12 degrees at 3 A.

use crate::PERIOD_S;
use crate::carrier::CARRIER_SAMPLES;

/// Distance of the frequency below which the injection leads from the one above which the observer leads, turns per period.
const INJECTION_LEADS: f32 = 4.0 * PERIOD_S;
/// Distance from the frequency above which the observer leads to those above which the injection is switched off, and below which it
/// is switched on, turns per period.
const CARRIER_OFF: f32 = 10.0 * PERIOD_S;
const CARRIER_ON: f32 = 8.0 * PERIOD_S;
/// Periods after the injection was switched in which voltage and current of the observer do not belong together.
const BLIND: u8 = 3;
/// Injection periods until the averages of the demodulation are filled.
const FILLED: u8 = 8;
/// Injection periods for which the injection must lead before the noise is judged.
const NOISE_IS_JUDGED_AFTER: u8 = 120;
/// Mean age of a turn that is averaged over an injection period, samples.
const MEAN_AGE: f32 = 0.5 * (CARRIER_SAMPLES - 1) as f32;

/// Sources that may rotate the frame of a drive without an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The slip alone, with a locked shaft.
    Slip,
    /// No source, and the injection is off.
    Nothing,
    /// The injection at any frequency.
    Injection,
    /// Injection and observer, by the hand-over.
    Both,
}

/// State of the injection, for the demodulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum CarrierState {
    #[default]
    On,
    /// On, and the averages of the demodulation are filled after this many injection periods.
    Filling(u8),
    Off,
}

/// State of the hand-over.
#[derive(Clone, Copy, Debug, Default)]
pub struct HandOver {
    /// Whether the observer gives the angle.
    pub leads: bool,
    /// Whether the frequency is in the range of the observer.
    is_fast: bool,
    carrier: CarrierState,
    /// Number of periods for which the observer is blind, plus one.
    blind: u8,
    /// Injection periods until the noise of the sensors is judged.
    periods_until_noise_is_judged: u8,
    /// Turns of the last ten periods, their sum, and the sum of the present injection period.
    turns: [f32; CARRIER_SAMPLES],
    sum: f32,
    fresh: f32,
}

/// Turn of the flux as the observer sees it, for the tracking.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Whether the angle follows the observer.
    pub leads: bool,
    /// Turn in a period, electrical turns.
    pub turned: f32,
    /// Slip in that turn, electrical turns.
    pub slip: f32,
    /// Age of the turn, samples.
    pub age: f32,
}

impl HandOver {
    /// Updates the leading source and the injection by the stator frequency `flux_freq`, for a frame that this `source` may rotate;
    /// called once an injection period. The observer leads above `leads`. Both frequencies are in electrical turns per period.
    pub fn update(&mut self, flux_freq: f32, source: Source, leads: f32) {
        let freq = flux_freq.abs();
        self.is_fast = freq > if self.is_fast { leads - INJECTION_LEADS } else { leads };
        let goes_on = leads + if self.is_carrier_off() { CARRIER_ON } else { CARRIER_OFF };
        self.switch(match self.carrier {
            _ if source == Source::Nothing || freq > goes_on => CarrierState::Off,
            CarrierState::Off => CarrierState::Filling(FILLED - 1),
            CarrierState::On | CarrierState::Filling(..=1) => CarrierState::On,
            CarrierState::Filling(left) => CarrierState::Filling(left - 1),
        });
        let leads = self.is_fast || !self.demodulates();
        self.periods_until_noise_is_judged = if leads {
            NOISE_IS_JUDGED_AFTER
        } else {
            self.periods_until_noise_is_judged.saturating_sub(1)
        };
        self.leads = leads && matches!(source, Source::Both | Source::Slip);
    }

    /// Switches the injection off, without a source for the angle.
    pub fn switch_carrier_off(&mut self) {
        self.switch(CarrierState::Off);
        self.leads = false;
    }

    fn switch(&mut self, carrier: CarrierState) {
        if self.is_carrier_off() != (carrier == CarrierState::Off) {
            self.blind = BLIND + 1;
        }
        self.carrier = carrier;
    }

    /// Whether the injection is off.
    pub fn is_carrier_off(&self) -> bool {
        self.carrier == CarrierState::Off
    }

    /// Whether the demodulation is valid, so that it may be used for checks.
    pub fn demodulates(&self) -> bool {
        self.carrier == CarrierState::On
    }

    /// Whether the noise of the sensors may be judged by the limit of the injection, which is about 0.2 s after the injection has
    /// begun to lead.
    pub fn judges_noise(&self) -> bool {
        self.periods_until_noise_is_judged == 0
    }

    /// Begins a period. Returns whether the observer is blind in it.
    pub fn advance_blanking(&mut self) -> bool {
        self.blind = self.blind.saturating_sub(1);
        self.blind > 0
    }

    /// Returns the mean turn of the last injection period, electrical turns per period.
    pub fn mean_turn(&self) -> f32 {
        self.sum * (1.0 / CARRIER_SAMPLES as f32)
    }

    /// Returns the turn for the tracking from the results of the observer in the period `index` of the injection
    /// period: `turned` and `slip`, electrical turns, of a current of this `age`, samples.
    pub fn turning(&mut self, index: usize, turned: f32, slip: f32, age: f32) -> Turning {
        let carrier_is_off = self.is_carrier_off();
        self.fresh += turned;
        if let Some(oldest) = self.turns.get_mut(index) {
            self.sum += turned - *oldest;
            *oldest = turned;
        }
        if index + 1 == CARRIER_SAMPLES {
            // The sum is replaced, so that rounding does not accumulate.
            self.sum = core::mem::take(&mut self.fresh);
        }
        let (turned, age) = if carrier_is_off {
            (turned, age + 1.0)
        } else {
            (self.mean_turn(), age + 1.0 + MEAN_AGE)
        };
        Turning { leads: self.leads, turned, slip, age }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frequency above which the observer leads in the tests, turns per period.
    const LEADS: f32 = 16.0 * PERIOD_S;

    /// The observer is blind for three periods after the injection was switched off or on, and not in between,
    /// whichever source leads.
    #[test]
    fn the_observer_is_blind_after_a_change_of_the_carrier() {
        let mut state = HandOver::default();
        let mut blind = [0; 4];
        for (k, hertz) in [17.0, 25.0, 27.0, 23.0].into_iter().enumerate() {
            state.update(hertz * PERIOD_S, Source::Both, LEADS);
            blind[k] = (0..20).filter(|_| state.advance_blanking()).count();
            assert!(!state.advance_blanking());
        }
        assert_eq!(blind, [0, 0, 3, 3]);
    }

    /// The frequency goes up and down in both directions. The test finds the first frequencies, tenths of a hertz, at which the
    /// source or the injection has changed. The injection is switched on below 24 Hz, and the observer leads at least for the
    /// eight injection periods of the demodulation.
    #[test]
    fn sources_and_carrier_change_at_their_frequencies() {
        for (source, sign, expected) in [
            (Source::Both, 1.0, [161, 261, 240, 120]),
            (Source::Both, -1.0, [161, 261, 240, 120]),
            (Source::Slip, 1.0, [161, 261, 240, 120]),
            (Source::Injection, 1.0, [0, 261, 240, 0]),
            (Source::Nothing, 1.0, [0, 0, 0, 0]),
        ] {
            let mut state = HandOver::default();
            let mut changes = [0; 4];
            // The frequencies are half a step beside the limits themselves.
            for tenth in (0..=300).chain((0..300).rev()) {
                let (led, was_off) = (state.leads, state.is_carrier_off());
                for _ in 0..20 {
                    state.update(sign * (tenth as f32 - 0.5) * (0.1 * PERIOD_S), source, LEADS);
                }
                for (n, changed) in [
                    state.leads && !led,
                    state.is_carrier_off() && !was_off,
                    was_off && !state.is_carrier_off(),
                    led && !state.leads,
                ]
                .into_iter()
                .enumerate()
                {
                    changes[n] += if changed { tenth } else { 0 };
                }
            }
            assert_eq!(changes, expected, "{source:?}");
            assert_eq!(state.is_carrier_off(), source == Source::Nothing);
        }
        let mut state = HandOver::default();
        state.update(27.0 * PERIOD_S, Source::Both, LEADS);
        let filling = (0..20).take_while(|_| {
            state.update(0.0, Source::Both, LEADS);
            assert_eq!(state.demodulates(), !state.leads);
            state.leads
        });
        assert_eq!(filling.count(), usize::from(FILLED) - 1);
        state.update(20.0 * PERIOD_S, Source::Both, LEADS);
        assert!(state.leads);
        state.switch_carrier_off();
        assert!(state.is_carrier_off() && !state.leads);
    }

    /// While the injection is on, the result is the mean of the last ten turns and its age; without injection, it is the last turn.
    #[test]
    fn a_turn_is_averaged_over_the_carrier_period() {
        let mut state = HandOver::default();
        for n in 0..40 {
            let turn = state.turning(n % CARRIER_SAMPLES, n as f32, 0.5, 2.0);
            let turned = if n < 10 { 0.05 * (n * (n + 1)) as f32 } else { n as f32 - 4.5 };
            assert!((turn.turned - turned).abs() < 1e-4, "{n}: {turn:?}");
            assert_eq!((turn.leads, turn.slip, turn.age), (false, 0.5, 7.5));
            assert_eq!(state.mean_turn(), turn.turned);
        }
        state.switch_carrier_off();
        let turn = state.turning(0, 7.0, 0.5, 2.0);
        assert_eq!(turn, Turning { leads: false, turned: 7.0, slip: 0.5, age: 3.0 });
    }

    /// Noise is judged if the injection has led for so many injection periods, and not if the observer leads.
    #[test]
    fn noise_is_judged_some_time_after_the_observer_has_left() {
        let mut state = HandOver::default();
        let judged = |state: &mut HandOver, hertz: f32| {
            state.update(hertz * PERIOD_S, Source::Both, LEADS);
            state.judges_noise()
        };
        for _ in 0..3 {
            assert!(!judged(&mut state, 16.1) && state.leads);
            let waited = (0..1000).take_while(|_| !judged(&mut state, 0.0)).count();
            assert_eq!((state.leads, waited), (false, usize::from(NOISE_IS_JUDGED_AFTER) - 1));
        }
    }
}
