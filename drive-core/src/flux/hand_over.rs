//! Two sources for one angle: at low frequency of the stator the injection turns it, at high frequency the
//! [observer](super::observer), and between both by a weight.
//!
//! ```text
//! w    = (f_s - 15 Hz)/(20 Hz - 15 Hz), within 0 .. 1
//! phi += (1 - w) (turn by the tracking loop) + w (turn seen by the observer)
//! ```
//!
//! Angles are not blended: nothing jumps at a hand-over, and nothing has to be preset. The carrier is off above
//! 26 Hz and comes on below 24 Hz. For eight carrier periods the demodulation fills, and the observer keeps the angle.
//!
//! For three periods after the carrier has come on or gone off the current of a sample does not belong to the voltages before it;
//! there the flux turns as in the last carrier period. (Without, the angle jumped by 4 degrees.)
//!
//! While the carrier is on, the observer's turn is its mean over a carrier period: a wobble of the axis at 600 Hz would bias the
//! demodulation, by up to 12 degrees at 3 A.

use crate::carrier::injection::CARRIER_SAMPLES;
use crate::io::PERIOD_S;

/// Frequencies of the stator between which the weight rises, turns per period.
const FROM: f32 = 15.0 * PERIOD_S;
const TO: f32 = 20.0 * PERIOD_S;
/// Frequencies above which the carrier goes off, and below which it comes on, turns per period.
const CARRIER_OFF: f32 = 26.0 * PERIOD_S;
const CARRIER_ON: f32 = 24.0 * PERIOD_S;
/// Periods after a change of the carrier in which voltage and current of the observer do not belong together.
const BLIND: u8 = 3;
/// Carrier periods until the demodulation is filled.
const FILLED: u8 = 8;
/// Carrier periods with the injection alone until the noise is judged.
const QUIET: u8 = 120;
/// Mean age of a turn that is averaged over a carrier period, samples.
const MEAN_AGE: f32 = 0.5 * (CARRIER_SAMPLES - 1) as f32;

/// State of the hand-over.
#[derive(Clone, Copy, Debug, Default)]
pub struct HandOver {
    /// Share of the observer in the angle, 0 to 1.
    pub weight: f32,
    /// Whether the carrier is off.
    pub silent: bool,
    /// What `silent` was in the last period, and the periods for which the observer sees nothing: those after a change.
    was_silent: bool,
    blind: u8,
    /// Carrier periods until the demodulation is filled.
    filling: u8,
    /// Carrier periods until the noise of the sensors is judged.
    unquiet: u8,
    /// Turns of the last ten periods, their sum, and the sum of the present carrier period.
    turns: [f32; CARRIER_SAMPLES],
    sum: f32,
    fresh: f32,
}

/// Turn of the flux as the observer sees it, for the tracking loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Its share in the angle, 0 to 1.
    pub weight: f32,
    /// Turn in a period, electrical turns.
    pub turned: f32,
    /// Slip in it, electrical turns.
    pub slip: f32,
    /// Age of the turn, samples.
    pub age: f32,
}

impl HandOver {
    /// Updates weight and carrier at the stator frequency `flux_freq`, electrical turns per period; once a carrier
    /// period.
    pub fn update(&mut self, flux_freq: f32) {
        let freq = flux_freq.abs();
        let weight = (freq - FROM) * (1.0 / (TO - FROM));
        self.silent = freq > if self.silent { CARRIER_ON } else { CARRIER_OFF };
        if self.silent {
            self.filling = FILLED;
        } else if self.filling > 0 {
            self.filling -= 1;
        }
        self.weight = if self.filling > 0 || weight > 1.0 {
            1.0
        } else if weight > 0.0 {
            weight
        } else {
            0.0
        };
        self.unquiet = if self.weight > 0.0 { QUIET } else { self.unquiet.saturating_sub(1) };
    }

    /// Whether the noise of the sensors may be judged as the injection needs it: some 0.2 s after it has the angle alone.
    pub fn is_quiet(&self) -> bool {
        self.unquiet == 0
    }

    /// Whether the observer sees nothing in this period; to be asked once a period.
    pub fn is_blind(&mut self) -> bool {
        self.blind =
            if self.silent == self.was_silent { self.blind.saturating_sub(1) } else { BLIND };
        self.was_silent = self.silent;
        self.blind > 0
    }

    /// Mean turn of the last carrier period, electrical turns per period.
    pub fn mean_turn(&self) -> f32 {
        self.sum * (1.0 / CARRIER_SAMPLES as f32)
    }

    /// Turns the carrier off, and leaves the angle to itself.
    pub fn silence(&mut self) {
        (self.silent, self.filling, self.weight) = (true, FILLED, 0.0);
    }

    /// Whether the demodulation has the carrier, and what is judged by it may be.
    pub fn demodulates(&self) -> bool {
        self.filling == 0
    }

    /// The turn for the tracking loop from what the observer saw in the period of this `index` in the carrier period:
    /// `turned` and `slip`, electrical turns, of a current of this `age`, samples.
    pub fn turning(&mut self, index: usize, turned: f32, slip: f32, age: f32) -> Turning {
        self.fresh += turned;
        if let Some(oldest) = self.turns.get_mut(index) {
            self.sum += turned - *oldest;
            *oldest = turned;
        }
        if index + 1 == CARRIER_SAMPLES {
            // Rounding does not accumulate.
            self.sum = core::mem::take(&mut self.fresh);
        }
        let (turned, age) = if self.silent {
            (turned, age + 1.0)
        } else {
            (self.mean_turn(), age + 1.0 + MEAN_AGE)
        };
        Turning { weight: self.weight, turned, slip, age }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The observer is blind for three periods after the carrier has gone off or come on, and not in between, whatever the
    /// weight does.
    #[test]
    fn the_observer_is_blind_after_a_change_of_the_carrier() {
        let mut state = HandOver::default();
        let mut blind = [0; 4];
        for (k, hertz) in [17.0, 25.0, 27.0, 23.0].into_iter().enumerate() {
            state.update(hertz * PERIOD_S);
            blind[k] = (0..20).filter(|_| state.is_blind()).count();
            assert!(!state.is_blind());
        }
        assert_eq!(blind, [0, 0, 3, 3]);
    }
}
