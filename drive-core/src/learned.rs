//! Result of a saliency self-commissioning, and whether the motor can be tracked with it.

use core::fmt;

use crate::carrier::Asymmetry;
use crate::table::{CarrierTable, POINTS, ReferenceTable, SlopeTable};

/// Largest accepted spread of the even part of the saliency offset. Noise causes 0.001.
pub(crate) const SPREAD: f32 = 0.005;
/// Largest accepted gain mismatch.
pub(crate) const LARGEST_MISMATCH: f32 = 0.1;
/// Largest accepted current-dependent saliency at a current of one step of the table, and largest rms misfit of
/// its law relative to the rms of the saliency offset.
pub(crate) const CURRENT_SALIENCY: (f32, f32) = (0.075, 0.35);
/// Least magnitude of the saliency sensitivity without q-axis current, 1/rad, with negative and with positive sign. With it,
/// 5 mA of sensor noise cause 5° rms.
pub(crate) const LEAST_SLOPE: [f32; 2] = [0.02, 0.035];
/// Multiple of the least sensitivity up to which the tracking is weak.
const WEAK: f32 = 1.5;
/// Largest accepted part of the signal that repeats four times in a turn, relative to the sensitivity without q-axis current: 8.6°.
pub(crate) const RIPPLE: f32 = 0.15;
/// Share above which that part is reported: 2.9°.
const CURVED: f32 = 0.05;
/// Least torque limit, in steps of the table: 1 A of 3.5 A.
pub(crate) const LEAST_LIMIT: usize = 4;

/// A fitted value with its misfit and acceptance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fitted {
    /// The value.
    pub value: f32,
    /// Unexplained part of the measurement, as defined with each value.
    pub misfit: f32,
    /// Whether value and misfit are within their bounds. If not, the previous value stays in use.
    pub accepted: bool,
}

impl Fitted {
    /// Returns this value if it was accepted, otherwise `other`.
    fn or(self, other: Self) -> Self {
        if self.accepted { self } else { other }
    }

    /// Returns the sum of `asymmetry` and the asymmetry of this gain mismatch.
    pub(crate) fn with(self, asymmetry: &Asymmetry) -> Asymmetry {
        asymmetry.plus(&Asymmetry::of_gain_mismatch(self.or(Self::default()).value), 1.0)
    }
}

/// Verdict whether, and how well, the motor can be tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// Accepted.
    Sound,
    /// Accepted, but the sensitivity is less than 1.5 times the least one: expect errors above 5° rms and false stops.
    Weak,
    /// Refused: the sensitivity without q-axis current is too small.
    SlopeTooSmall,
    /// Refused: the sensitivity vanishes below the least torque limit.
    LimitTooLow,
    /// Refused: the even part of the saliency offset spreads, because the shaft is not quite locked or the load pulses.
    Uneven,
    /// Refused: the signal repeats four times in a turn, because a current sensor is not linear.
    Bent,
    /// Refused: a value is not finite or out of its range.
    OutOfRange,
}

impl Verdict {
    /// Whether the result is used.
    pub const fn is_accepted(self) -> bool {
        matches!(self, Self::Sound | Self::Weak)
    }

    /// Returns the least magnitude of a sensitivity of this sign, 1/rad.
    fn least(at_rest: f32) -> f32 {
        let [negative, positive] = LEAST_SLOPE;
        if at_rest < 0.0 { negative } else { positive }
    }

    /// Returns the verdict on a sensitivity without q-axis current, 1/rad.
    pub fn of_slope(at_rest: f32) -> Self {
        match at_rest.abs() / Self::least(at_rest) {
            WEAK.. => Self::Sound,
            1.0.. => Self::Weak,
            _ => Self::SlopeTooSmall,
        }
    }
}

/// Result of a saliency self-commissioning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learned {
    /// Saliency offset over the q-axis current, or reference of the current difference, A.
    pub reference: ReferenceTable,
    /// Saliency sensitivity over the q-axis current; none for a current difference.
    pub slope: Option<SlopeTable>,
    /// Saliency sensitivity without q-axis current, 1/rad, also if it is refused; 0 for a current difference.
    pub slope_at_rest: f32,
    /// Largest q-axis current, A, that the sensitivity allows: up to it, the sensitivity on both sides is at least 0.3 of
    /// its value without q-axis current, and 0.016 /rad.
    pub limit_a: f32,
    /// Injection current over the q-axis current, if plausible.
    pub carrier: Option<CarrierTable>,
    /// Number of measured points, without zero; the tables are constant beyond.
    pub points: usize,
    /// Largest deviation of the even part of the saliency offset from its mean. Beyond 0.005 the whole result is refused.
    pub spread: f32,
    /// Largest part of the signal that repeats four times in an electrical turn, of all points; 0 if the result was read from
    /// the flash. A third-order error of a current sensor of 1 % at the end of its range causes 0.0042 at 2.9 A of 4.47 A.
    pub ripple: f32,
    /// (gain of current sensor a) / (gain of b) - 1, within ±0.1. Misfit: the asymmetry that a gain mismatch does
    /// not explain. Synchronous demodulation only.
    pub gain_mismatch: Fitted,
    /// Asymmetry that is subtracted from the demodulated signals: the rest beyond the gain mismatch, if that is accepted.
    pub asymmetry: Asymmetry,
    /// Asymmetry that the start has measured before there was current or flux, beyond gain mismatch and `asymmetry`. A later start
    /// expects it. None with an encoder, or in a result of an earlier firmware.
    pub at_start: Option<Asymmetry>,
    /// Number of rotor positions, 1 or more, over which gain mismatch and asymmetry are averaged. The slots of the
    /// rotor have an asymmetry that changes with its position; sensors and stator have a constant one.
    pub positions: u8,
    /// Saliency per ampere of stator current, 1/A, within ±0.075 at one step of the table: least squares of the saliency
    /// offset on 2 i_d i_q/|i|. Misfit: rms of the residual relative to the rms of the offset, at most 0.35.
    pub current_saliency: Fitted,
    /// Flux-fixed saliency at nominal flux, measured by the check at the start (±5 % by noise); 0
    /// without the check. A later start expects it.
    pub flux_saliency: f32,
    /// Verdict: whether the result is used, and if not, why.
    pub verdict: Verdict,
}

impl fmt::Display for Learned {
    /// Writes the verdict in words, with its numbers.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { slope_at_rest: slope, limit_a, spread, ripple, .. } = *self;
        let (least, least_limit_a) = (Verdict::least(slope), self.least_limit_a());
        match self.verdict {
            Verdict::Sound => {
                write!(f, "slope {slope:.4} /rad, q-axis current up to {limit_a:.2} A")
            }
            Verdict::Weak => write!(
                f,
                "weak: slope {slope:.4} /rad is less than {WEAK} times the least, {least}; q-axis current up to {limit_a:.2} A"
            ),
            Verdict::SlopeTooSmall => {
                write!(f, "slope {slope:.4} /rad, which must be {least} at least")
            }
            Verdict::LimitTooLow => write!(
                f,
                "slope {slope:.4} /rad is lost above {limit_a:.2} A of q-axis current, less than {least_limit_a:.2} A"
            ),
            Verdict::Uneven => {
                write!(f, "even part of the saliency offset spreads by {spread:.5}, over {SPREAD}")
            }
            Verdict::Bent => write!(
                f,
                "saliency repeats four times in a turn by {ripple:.5}, more than {:.5}: a current sensor is not linear",
                RIPPLE * slope.abs()
            ),
            Verdict::OutOfRange => f.write_str("a value is out of its range"),
        }?;
        f.write_str(match self.verdict.is_accepted() {
            true if ripple > CURVED * slope.abs() => "; a current sensor is not quite linear",
            true => "",
            false => "; nothing was changed",
        })
    }
}

impl Learned {
    /// Returns the least accepted torque limit, A.
    fn least_limit_a(&self) -> f32 {
        self.reference.grid().current(LEAST_LIMIT)
    }

    /// Whether a stored result is plausible, i.e. could come from an accepted self-commissioning. The
    /// tables check their own values.
    pub fn is_believable(&self) -> bool {
        let within = |fitted: &Fitted, largest: f32| {
            fitted.misfit.is_finite() && (!fitted.accepted || fitted.value.abs() <= largest)
        };
        let step = self.reference.grid().step_a();
        let slope = self.slope.map_or(0.0, |slope| slope.at_rest());
        let least_limit_a = if self.slope.is_some() { self.least_limit_a() } else { step };
        self.verdict.is_accepted()
            && self.spread <= SPREAD
            && (1..POINTS).contains(&self.points)
            && self.positions > 0
            && self.asymmetry.size() <= Asymmetry::LARGEST
            && self.at_start.is_none_or(|seen| seen.size() <= Asymmetry::LARGEST)
            && self.slope_at_rest == slope
            && (least_limit_a..=POINTS as f32 * step).contains(&self.limit_a)
            && within(&self.gain_mismatch, LARGEST_MISMATCH)
            && within(&self.current_saliency, CURRENT_SALIENCY.0 / step)
            && self.flux_saliency.abs() < 1.0
    }

    /// Returns the combination of `before` and this result, which was found at another rotor position with the coefficients
    /// of `before`. Gain mismatch and asymmetry are the means over all positions; this result contains a difference, which
    /// counts as one position. The other values come from this result, or from `before` if this result did not accept them.
    ///
    /// The drive itself [takes](crate::Coefficients::take) a result as if it were the first, so the coefficients must be built
    /// again.
    pub fn on_top_of(&self, before: &Self) -> Self {
        let positions = before.positions.saturating_add(1);
        let share = 1.0 / f32::from(positions);
        let mut gains = self.gain_mismatch.or(before.gain_mismatch);
        if self.gain_mismatch.accepted {
            let corrected = before.gain_mismatch.or(Fitted::default()).value;
            gains.value = corrected + share * gains.value;
        }
        // The mean over the positions differs from the asymmetry of this position by `1 - share` of it, which a start at this
        // position measures.
        let rest = self.gain_mismatch.with(&self.asymmetry);
        Self {
            gain_mismatch: gains,
            asymmetry: before.asymmetry.plus(&self.asymmetry, share),
            at_start: self.at_start.map(|seen| seen.plus(&rest, 1.0 - share)),
            positions,
            current_saliency: self.current_saliency.or(before.current_saliency),
            carrier: self.carrier.or(before.carrier),
            ..*self
        }
    }
}
