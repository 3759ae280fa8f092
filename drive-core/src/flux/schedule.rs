//! What the synchronous demodulation is compared with, and how strongly it corrects, over the torque
//! current.
//!
//! At the right angle the saliency `q` is not zero but depends on i_q, because part of the saliency
//! follows the stator current. The reference is an odd table over i_q, learned with the shaft locked.
//! The loop gain depends on i_q as well: an error of the angle turns the real current, and with it
//! the current's part of the saliency, so that fast errors see a slope of 2 (|a| + b |i| |cos 2g|)
//! instead of 2 |a|. The gain is scheduled to make up for that.

use crate::carrier::Saliency;
use crate::settings::table::{POINTS, ReferenceTable, STEP_A, between, odd, place};

/// Share of the proportional part that is left however steep the fast slope. Only errors faster than
/// the current loop see that slope in full; with all of it taken out the tracking loop has too little
/// damping at large currents. (3.5 Hz, a rotor 30 % warmer than believed, 3 A to -3 A, the worst of
/// 72 runs: 19.8° with 0.3, 17.4° with 0.8, 16.5° with 1; 1.54°, 1.63° and 1.69° rms at constant
/// current.)
const LEAST_SHARE: f32 = 0.8;
/// Reference and gain over i_q, for the control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainSchedule {
    table: ReferenceTable,
    share: [f32; POINTS],
    /// What it was made for.
    flux_saliency: f32,
    current_saliency: f32,
    i_d: f32,
    /// Angle error per difference of the saliency, rad.
    pub per_saliency: f32,
}

impl GainSchedule {
    /// With the flux-fixed saliency `a` at nominal flux, the saliency `b` per ampere of stator
    /// current, 1/A, and the direct-axis current, A.
    pub fn new(table: &ReferenceTable, a: f32, b: f32, i_d: f32) -> Self {
        let share = core::array::from_fn(|n| {
            let i_q = n as f32 * STEP_A;
            let length = libm::sqrtf(i_d * i_d + i_q * i_q);
            // b |i| cos 2 gamma, where it adds to the slope
            let current_part = b * (i_q * i_q - i_d * i_d) / length;
            let by_slope =
                a.abs() / (a.abs() + if current_part > 0.0 { current_part } else { 0.0 });
            LEAST_SHARE + (1.0 - LEAST_SHARE) * by_slope
        });
        Self {
            table: *table,
            share,
            flux_saliency: a,
            current_saliency: b,
            i_d,
            per_saliency: -0.5 / a,
        }
    }

    /// The same with another reference and, where there is one, another saliency per ampere, 1/A.
    pub fn with(&self, table: &ReferenceTable, b: Option<f32>) -> Self {
        Self::new(table, self.flux_saliency, b.unwrap_or(self.current_saliency), self.i_d)
    }

    /// The angle error that a saliency tells of, rad, and the share of the proportional part.
    pub fn correction(&self, seen: &Saliency) -> (f32, f32) {
        let (reference, share) = self.at(seen.i_q);
        (self.per_saliency * (reference - seen.q), share)
    }

    /// Reference of `q`, and share of the proportional part, at a quadrature current, A.
    pub fn at(&self, i_q: f32) -> (f32, f32) {
        let place = place(i_q);
        (odd(i_q, between(self.table.points(), place)), between(&self.share, place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookup_is_odd_linear_and_held() {
        let table = ReferenceTable::new(&[(0.0, 0.0), (1.0, 0.04), (3.0, 0.05)]).unwrap();
        let schedule = GainSchedule::new(&table, -0.035, 0.034, 0.7);
        for (i_q, q) in
            [(0.0, 0.0), (0.5, 0.02), (1.0, 0.04), (2.0, 0.045), (3.5, 0.05), (99.0, 0.05)]
        {
            assert!((schedule.at(i_q).0 - q).abs() < 1e-6, "{i_q}");
            assert!((schedule.at(-i_q).0 + q).abs() < 1e-6, "-{i_q}");
        }
        assert!(schedule.at(f32::NAN).0.abs() < 0.3, "not-a-number is found elsewhere");
    }

    #[test]
    fn the_gain_falls_as_the_slope_rises() {
        // Of an independent study, which leaves no least share.
        let schedule = GainSchedule::new(&ReferenceTable::default(), -0.035, 0.0338, 0.7);
        for (n, share) in [1.0, 1.0, 0.71, 0.49, 0.38, 0.32, 0.27].into_iter().enumerate() {
            let found = (schedule.at(0.5 * n as f32).1 - LEAST_SHARE) / (1.0 - LEAST_SHARE);
            assert!((found - share).abs() < 0.011, "{n}: {found}");
        }
    }

    #[test]
    fn the_saliency_tells_the_angle() {
        // q = 2 a x for a small angle error x of the flux-fixed saliency a, beside the reference.
        let table = ReferenceTable::new(&[(0.0, 0.0), (2.0, 0.04)]).unwrap();
        for a in [-0.035, 0.05] {
            let schedule = GainSchedule::new(&table, a, 0.034, 0.7);
            for (i_q, x) in [(0.0, 0.1), (1.0, -0.2), (-1.0, 0.05)] {
                let q = 0.02 * i_q + 2.0 * a * x;
                let (error, share) =
                    schedule.correction(&Saliency { q, carrier_squared: 0.0, i_q });
                assert!((error - x).abs() < 1e-5, "{error} for {x}");
                assert_eq!(share, schedule.at(i_q).1);
            }
        }
        // Another reference; another saliency per ampere only where there is one.
        let schedule = GainSchedule::new(&ReferenceTable::default(), -0.035, 0.034, 0.7);
        assert_eq!(schedule.with(&table, None), GainSchedule::new(&table, -0.035, 0.034, 0.7));
        assert_eq!(schedule.with(&table, Some(0.02)), GainSchedule::new(&table, -0.035, 0.02, 0.7));
    }
}
