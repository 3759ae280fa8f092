//! Reference and slope of the saliency for the synchronous demodulation over the torque current.
//!
//! At the true angle the saliency `q` is not zero but depends on i_q, because part of the saliency
//! follows the stator current. With the angle error e, flux less estimate,
//!
//! ```text
//! q = q_ref(i_q) + k(i_q) e          e = (q - q_ref(i_q)) / k(i_q)
//! ```
//!
//! The reference is an odd table over i_q and the slope k an even one, of either sign; both are learned with the shaft
//! locked. The learned slope is that of an error that lasts: current and flux have settled. It tells the size of such an error. (An
//! angle error that is faster than the current loop rotates the current with the frame and with it the current-dependent part b
//! of the saliency, so such errors see the slope k + 2 b |i| cos 2g, with cos 2g = (i_d^2 - i_q^2)/|i|^2.)
//!
//! An error that is faster than the flux is seen with the slope without load, also where load has made the lasting one smaller.
//! That slope is the most that the loop of the angle takes: with the gain of the lasting one, up to twice as large, an oscillation
//! of 17 Hz grew near zero stator frequency.

use crate::table::{POINTS, ReferenceTable, SlopeTable, between, odd};

/// Largest angle error per deviation of the saliency, relative to that without q-axis current.
const MOST_GAIN: f32 = 2.0;

/// Reference of the saliency and inverse slope over i_q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainSchedule {
    table: ReferenceTable,
    /// Angle error per deviation of the saliency, rad.
    per_saliency: [f32; POINTS],
}

/// The schedule at a torque current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchedulePoint {
    /// Reference of the saliency.
    pub reference: f32,
    /// Angle error per deviation of the saliency, rad: of an error that lasts, and for the loop, at most that without load.
    pub lasting: f32,
    pub gain: f32,
}

impl GainSchedule {
    /// Schedule for a reference and a slope on the same grid.
    pub fn new(table: &ReferenceTable, slope: &SlopeTable) -> Self {
        Self { table: *table, per_saliency: slope.inverses(MOST_GAIN) }
    }

    /// Schedule for the same motor with a learned reference and, if learned, another slope.
    pub fn with_learned(&self, table: &ReferenceTable, slope: Option<&SlopeTable>) -> Self {
        match slope {
            Some(slope) => Self::new(table, slope),
            None => Self { table: *table, ..*self },
        }
    }

    /// The schedule at a quadrature current `i_q`, A.
    pub fn at(&self, i_q: f32) -> SchedulePoint {
        let place = self.table.grid().place(i_q);
        let (lasting, [at_rest, ..]) = (between(&self.per_saliency, place), self.per_saliency);
        SchedulePoint {
            reference: odd(i_q, between(self.table.points(), place)),
            lasting,
            gain: if lasting.abs() > at_rest.abs() { at_rest } else { lasting },
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
        let schedule = GainSchedule::new(&table, &fixed(-0.035));
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
    fn the_saliency_tells_the_angle() {
        let table = reference(|i_q| 0.02 * i_q.min(2.0));
        for k in [-0.07_f32, 0.1] {
            // Beyond 1 A the slope is 0.7 of that without current, beyond 2 A a fifth: the angle is held to twice, the gain to once.
            let points = core::array::from_fn(|n| {
                k * [1.0, 0.7, 0.2][n.div_ceil(4).min(3).saturating_sub(1)]
            });
            let slope = SlopeTable::from_points(Grid::REFERENCE, points).unwrap();
            let schedule = GainSchedule::new(&table, &slope);
            for (i_q, x, seen, by_gain) in [
                (0.0, 0.1, 0.1, 0.1),
                (2.0, -0.2, -0.2, -0.14),
                (-1.75, 0.05, 0.05, 0.035),
                (3.0, 0.1, 0.04, 0.02),
            ] {
                let q = table.at(i_q) + slope.points()[(4.0 * i_q.abs()) as usize] * x;
                let point = schedule.at(i_q);
                let deviation = q - point.reference;
                let close = |of: f32, seen: f32| (of * deviation - seen).abs() < 1e-5;
                assert!(close(point.lasting, seen), "{} for {x} at {i_q} A", point.lasting);
                assert!(close(point.gain, by_gain), "{} for {x} at {i_q} A", point.gain);
            }
        }
    }

    #[test]
    fn what_was_not_learned_stays() {
        let table = reference(|i_q| 0.02 * i_q.min(2.0));
        let schedule = GainSchedule::new(&ReferenceTable::default(), &fixed(-0.035));
        assert_eq!(schedule.with_learned(&table, None), GainSchedule::new(&table, &fixed(-0.035)));
        assert_eq!(
            schedule.with_learned(&table, Some(&fixed(0.02))),
            GainSchedule::new(&table, &fixed(0.02))
        );
    }
}
