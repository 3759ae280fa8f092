//! Reference of the saliency and loop gain of the synchronous demodulation over the torque current.
//!
//! At the true angle the saliency `q` is not zero but depends on i_q, because part of the saliency
//! follows the stator current. With the angle error e, flux less estimate,
//!
//! ```text
//! q = q_ref(i_q) + k(i_q) e          e = (q - q_ref(i_q)) / k(i_q)
//! ```
//!
//! The reference is an odd table over i_q and the slope k an even one, of either sign; both are learned with the shaft
//! locked. The slope is the slow one: current and flux have settled. An angle error that is faster than the current loop
//! rotates the current with the frame and with it the current-dependent part b of the saliency, so such errors see the slope
//! k + 2 b |i| cos 2g, with cos 2g = (i_d^2 - i_q^2)/|i|^2. The proportional part of the loop is reduced where that is
//! steeper.

use crate::carrier::Saliency;
use crate::table::{POINTS, ReferenceTable, SlopeTable, between, odd};

/// Minimum share of the proportional gain. Only errors faster than the current loop see the steep slope in
/// full; full compensation leaves the tracking loop too little damping at large currents. (3.5 Hz, rotor
/// resistance 30 % above the setting, 3 A to -3 A, worst of 72 runs: 19.8° with 0.3, 17.4° with 0.8, 16.5°
/// with 1; 1.54°, 1.63° and 1.69° rms at constant current.)
const LEAST_SHARE: f32 = 0.8;
/// Largest gain relative to that without torque current.
const MOST_GAIN: f32 = 2.0;

/// Reference of the saliency, inverse slope, and share of the proportional gain over i_q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainSchedule {
    table: ReferenceTable,
    /// Angle error per deviation of the saliency, rad.
    per_saliency: [f32; POINTS],
    share: [f32; POINTS],
    /// Arguments of `new`, for `with_learned`.
    current_saliency: f32,
    i_d: f32,
}

/// The schedule at a torque current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchedulePoint {
    /// Reference of the saliency.
    pub reference: f32,
    /// Angle error per deviation of the saliency, rad.
    pub per_saliency: f32,
    /// Share of the proportional gain.
    pub share: f32,
}

impl GainSchedule {
    /// Schedule for a reference and a slope on the same grid, the saliency `b` per ampere of stator current, 1/A, and the
    /// direct current `i_d`, A.
    pub fn new(table: &ReferenceTable, slope: &SlopeTable, b: f32, i_d: f32) -> Self {
        let mut share = *slope.points();
        for (n, share) in share.iter_mut().enumerate() {
            let i_q = slope.grid().current(n);
            let length = fpu_sqrt::sqrtf(i_d * i_d + i_q * i_q);
            let ratio = 1.0 + 2.0 * b * (i_d * i_d - i_q * i_q) / length / *share;
            let by_slope = if ratio > 1.0 { 1.0 / ratio } else { 1.0 };
            *share = LEAST_SHARE + (1.0 - LEAST_SHARE) * by_slope;
        }
        Self {
            table: *table,
            per_saliency: slope.inverses(MOST_GAIN),
            share,
            current_saliency: b,
            i_d,
        }
    }

    /// Schedule for the same motor with a learned reference and, if learned, another slope, with another saliency `b` per
    /// ampere, 1/A, if that was learned, too.
    pub fn with_learned(
        &self,
        table: &ReferenceTable,
        slope: Option<&SlopeTable>,
        b: Option<f32>,
    ) -> Self {
        match slope {
            Some(slope) => Self::new(table, slope, b.unwrap_or(self.current_saliency), self.i_d),
            None => Self { table: *table, ..*self },
        }
    }

    /// Angle error, rad, derived from a measured saliency, and share of the proportional gain.
    pub fn angle_error(&self, saliency: &Saliency) -> (f32, f32) {
        let point = self.at(saliency.i_q);
        (point.per_saliency * (saliency.q - point.reference), point.share)
    }

    /// The schedule at a quadrature current `i_q`, A.
    pub fn at(&self, i_q: f32) -> SchedulePoint {
        let place = self.table.grid().place(i_q);
        SchedulePoint {
            reference: odd(i_q, between(self.table.points(), place)),
            per_saliency: between(&self.per_saliency, place),
            share: between(&self.share, place),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Grid;

    /// Slope of a saliency that is fixed to the flux alone.
    fn fixed(a: f32) -> SlopeTable {
        SlopeTable::of_flux_saliency(Grid::REFERENCE, a)
    }

    /// The reference with these values over the torque current, A.
    fn reference(q: impl Fn(f32) -> f32) -> ReferenceTable {
        let values = core::array::from_fn(|n| q(Grid::REFERENCE.current(n)));
        ReferenceTable::from_points(Grid::REFERENCE, values).unwrap()
    }

    #[test]
    fn lookup_is_odd_linear_and_held() {
        let table =
            reference(|i_q| if i_q < 1.0 { 0.04 * i_q } else { 0.035 + 0.005 * i_q.min(3.0) });
        let schedule = GainSchedule::new(&table, &fixed(-0.035), 0.034, 0.7);
        let reference = |i_q| schedule.at(i_q).reference;
        for (i_q, q) in
            [(0.0, 0.0), (0.5, 0.02), (1.0, 0.04), (2.0, 0.045), (3.5, 0.05), (99.0, 0.05)]
        {
            assert!((reference(i_q) - q).abs() < 1e-6, "{i_q}");
            assert!((reference(-i_q) + q).abs() < 1e-6, "-{i_q}");
        }
        assert!(reference(f32::NAN).abs() < 0.3, "not-a-number is found elsewhere");
    }

    #[test]
    fn the_gain_falls_as_the_fast_slope_rises() {
        // Of an independent study, which leaves no least share.
        let schedule = GainSchedule::new(&ReferenceTable::default(), &fixed(-0.035), 0.0338, 0.7);
        for (n, share) in [1.0, 1.0, 0.71, 0.49, 0.38, 0.32, 0.27].into_iter().enumerate() {
            let found = (schedule.at(0.5 * n as f32).share - LEAST_SHARE) / (1.0 - LEAST_SHARE);
            assert!((found - share).abs() < 0.011, "{n}: {found}");
        }
        // With a positive slope the part of the current adds to it below i_d, and takes from it above.
        let schedule = GainSchedule::new(&ReferenceTable::default(), &fixed(0.035), 0.0338, 0.7);
        assert!(schedule.at(0.0).share < 0.93 && schedule.at(2.0).share == 1.0);
    }

    #[test]
    fn the_saliency_tells_the_angle() {
        let table = reference(|i_q| 0.02 * i_q.min(2.0));
        for k in [-0.07_f32, 0.1] {
            // Beyond 1 A the slope is 0.7 of that without current, beyond 2 A a fifth: the gain is held to twice.
            let points = core::array::from_fn(|n| {
                k * [1.0, 0.7, 0.2][n.div_ceil(4).min(3).saturating_sub(1)]
            });
            let slope = SlopeTable::from_points(Grid::REFERENCE, points).unwrap();
            let schedule = GainSchedule::new(&table, &slope, 0.034, 0.7);
            for (i_q, x, seen) in
                [(0.0, 0.1, 0.1), (2.0, -0.2, -0.2), (-1.75, 0.05, 0.05), (3.0, 0.1, 0.04)]
            {
                let q = table.at(i_q) + slope.points()[(4.0 * i_q.abs()) as usize] * x;
                let (error, share) =
                    schedule.angle_error(&Saliency { q, carrier_squared: 0.0, i_q });
                assert!((error - seen).abs() < 1e-5, "{error} for {x} at {i_q} A");
                assert_eq!(share, schedule.at(i_q).share);
            }
        }
    }

    #[test]
    fn what_was_not_learned_stays() {
        let table = reference(|i_q| 0.02 * i_q.min(2.0));
        let schedule = GainSchedule::new(&ReferenceTable::default(), &fixed(-0.035), 0.034, 0.7);
        assert_eq!(
            schedule.with_learned(&table, None, None),
            GainSchedule::new(&table, &fixed(-0.035), 0.034, 0.7)
        );
        assert_eq!(
            schedule.with_learned(&table, Some(&fixed(0.02)), Some(0.02)),
            GainSchedule::new(&table, &fixed(0.02), 0.02, 0.7)
        );
    }
}
