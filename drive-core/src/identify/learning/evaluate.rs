//! Evaluation of the sums of a self-commissioning.

use super::{Fitted, Learned, Learning, LearningState};
use crate::UnitVector;
use crate::carrier::{Asymmetry, Saliency};
use crate::learned::{CURRENT_SALIENCY, LARGEST_MISMATCH, LEAST_LIMIT, RIPPLE, SPREAD, Verdict};
use crate::protect::SaliencyCheck;
use crate::table::{CarrierTable, POINTS, ReferenceTable, SlopeTable};

/// Limit of the asymmetry that a gain mismatch does not explain, above which the mismatch is not corrected: absolute part,
/// and share of the mismatch.
const UNEXPLAINED: (f32, f32) = (0.001, 0.25);
/// Least saliency sensitivity up to the torque limit: share of the sensitivity without q-axis current, and magnitude, 1/rad.
const LEAST_SLOPE_UNDER_LOAD: (f32, f32) = (0.3, 0.016);

/// Measurements of the drive during magnetisation, before the points.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Mean saliency that the saliency check has measured along its axis; none without the check.
    pub looked: Option<f32>,
    /// Flux-fixed saliency per mean saliency of the check.
    pub per_looked: f32,
    /// Squared injection current without q-axis current, A^2.
    pub baseline: f32,
    /// Asymmetry that was measured before there was current or flux.
    pub at_start: Option<Asymmetry>,
    /// Injection axis in the frame of the flux.
    pub axis: UnitVector,
}

impl Learning {
    /// Evaluates all points. `start` has the measurements before them.
    pub fn result(&self, state: &LearningState, start: &Start) -> Learned {
        let (asymmetry, gain_mismatch, spread) = self.asymmetry(state);
        let (reference, current_saliency) = self.reference(state);
        let (slope, slope_at_rest, limit_a) = self.slope(state);
        let ripple = fpu_sqrt::sqrtf(state.ripple);
        let verdict = if reference.is_none() || asymmetry.size() > Asymmetry::LARGEST {
            Verdict::OutOfRange
        } else if self.normalised && !Verdict::of_slope(slope_at_rest).is_accepted() {
            // This verdict comes first, because a better lock of the shaft does not raise the sensitivity.
            Verdict::SlopeTooSmall
        } else if !(spread <= SPREAD && self.points > 0) {
            Verdict::Uneven
        } else if !self.normalised {
            Verdict::Sound
        } else if ripple > RIPPLE * slope_at_rest.abs() {
            Verdict::Bent
        } else if limit_a < LEAST_LIMIT as f32 * self.grid.step_a() || slope.is_none() {
            Verdict::LimitTooLow
        } else {
            Verdict::of_slope(slope_at_rest)
        };
        // The check and the baseline were measured with the asymmetry and with the flux along phase a.
        let all = gain_mismatch.with(&asymmetry);
        let seen = |q: f32, carrier_squared: f32, axis| {
            let mut saliency = Saliency { q, carrier_squared, i_q: 0.0 };
            all.take_out(&mut saliency, axis);
            saliency
        };
        let baseline = seen(0.0, start.baseline, start.axis).carrier_squared;
        let looked = start.looked.map_or(0.0, |q| seen(q, 0.0, SaliencyCheck::LOOK_AXIS).q);
        Learned {
            reference: reference.unwrap_or_default(),
            slope: slope.filter(|_| verdict.is_accepted()),
            slope_at_rest,
            limit_a,
            carrier: self.carrier(state, baseline),
            points: self.points,
            spread,
            ripple,
            gain_mismatch,
            asymmetry,
            at_start: start.at_start.map(|seen| seen.plus(&all, -1.0)),
            positions: 1,
            current_saliency,
            flux_saliency: start.per_looked * looked,
            verdict,
        }
    }

    /// Returns the asymmetry beyond the gain mismatch, the gain mismatch, and the spread of the even part.
    fn asymmetry(&self, state: &LearningState) -> (Asymmetry, Fitted, f32) {
        let per_point = 1.0 / self.points().max(1) as f32;
        let (sum, least, largest) = state.even;
        let constant = 2.0 * per_point * sum;
        let (above, below) = (largest - constant, constant - least);
        let spread = if above > below { above } else { below };
        let found = Asymmetry { constant, ..state.turning };
        let value = found.gain_mismatch();
        let rest = found.plus(&Asymmetry::of_gain_mismatch(value), -1.0);
        let misfit = rest.size();
        let accepted = self.normalised
            && value.abs() <= LARGEST_MISMATCH
            && misfit <= UNEXPLAINED.0 + UNEXPLAINED.1 * value.abs();
        let asymmetry = match (self.normalised, accepted) {
            (true, true) => rest,
            (true, false) => found,
            (false, _) => Asymmetry::default(),
        };
        (asymmetry, Fitted { value, misfit, accepted }, spread)
    }

    /// Returns the saliency offset, and the saliency per ampere of stator current that fits it.
    fn reference(&self, state: &LearningState) -> (Option<ReferenceTable>, Fitted) {
        let [odd, ..] = &state.odd;
        let q = Self::held_beyond(odd, self.points);
        let (mut xx, mut xq, mut qq) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (n, q) in q.iter().enumerate().take(self.points + 1) {
            let i_q = self.grid.current(n);
            let x = 2.0 * self.i_d * i_q / fpu_sqrt::sqrtf(self.i_d * self.i_d + i_q * i_q);
            xx += x * x;
            xq += x * q;
            qq += q * q;
        }
        let value = xq / xx;
        let rest = qq - value * xq;
        let misfit = fpu_sqrt::sqrtf(if rest > 0.0 { rest / qq } else { 0.0 });
        let accepted = self.normalised
            && value.abs() * self.grid.step_a() <= CURRENT_SALIENCY.0
            && misfit <= CURRENT_SALIENCY.1;
        (ReferenceTable::from_points(self.grid, q), Fitted { value, misfit, accepted })
    }

    /// Returns the sensitivity over the q-axis current, the sensitivity without q-axis current, 1/rad, and the largest current that
    /// it allows, A.
    fn slope(&self, state: &LearningState) -> (Option<SlopeTable>, f32, f32) {
        if !self.normalised {
            return (None, 0.0, self.grid.current(self.points));
        }
        let [without, ahead, behind] = &state.odd;
        let per_lead = 1.0 / self.lead;
        // Without q-axis current the other lead is the mirrored one.
        let at_rest = ahead[0] * per_lead;
        let mut k = [at_rest; POINTS];
        let mut last = 0;
        // These are the sensitivities on both sides at a current with leads.
        let sides = |n: usize| match (ahead.get(n), without.get(n), behind.get(n)) {
            (Some(ahead), Some(without), Some(behind)) if n > 0 => {
                [ahead - without, without - behind].map(|q| q * per_lead)
            }
            _ => [at_rest; 2],
        };
        for (n, k) in k.iter_mut().enumerate().take(self.points + 1).skip(1) {
            let is_led = (self.points - n).is_multiple_of(2);
            let (below, above) = if is_led { (n, n) } else { (n - 1, n + 1) };
            let ([ahead, behind], [ahead_too, behind_too]) = (sides(below), sides(above));
            let sides = [0.5 * (ahead + ahead_too), 0.5 * (behind + behind_too)];
            let enough = |side: f32| {
                side / at_rest >= LEAST_SLOPE_UNDER_LOAD.0 && side.abs() >= LEAST_SLOPE_UNDER_LOAD.1
            };
            if !(enough(sides[0]) && enough(sides[1])) {
                break;
            }
            *k = 0.5 * (sides[0] + sides[1]);
            last = n;
        }
        let table = SlopeTable::from_points(self.grid, Self::held_beyond(&k, last));
        (table, at_rest, self.grid.current(last))
    }

    /// Returns the injection current over the q-axis current.
    fn carrier(&self, state: &LearningState, baseline: f32) -> Option<CarrierTable> {
        let mut ratio = state.carrier.map(|square| fpu_sqrt::sqrtf(square / baseline));
        ratio[0] = 1.0;
        CarrierTable::from_points(self.grid, Self::held_beyond(&ratio, self.points))
    }

    /// Returns the values at the points, constant beyond the point `last`.
    fn held_beyond(values: &[f32; POINTS], last: usize) -> [f32; POINTS] {
        core::array::from_fn(|n| values[n.min(last)])
    }
}
