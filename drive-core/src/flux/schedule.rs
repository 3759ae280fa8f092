//! Saliency offset and saliency sensitivity over the q-axis current, for the synchronous demodulation.
//!
//! At the true angle the saliency `q` is not zero but has an offset that depends on i_q, because
//! part of the saliency follows the stator current. With the angle error e, flux less estimate,
//!
//! ```text
//! q = q_ref(i_q) + k(i_q) e          e = (q - q_ref(i_q)) / k(i_q)
//! ```
//!
//! The offset q_ref is an odd table over i_q, and the sensitivity k an even one, of either sign; both are learned with the shaft
//! locked. The learned sensitivity is valid for a lasting error, for which current and flux have settled, and gives the size of
//! such an error. (An angle error that is faster than the current loop rotates the current with the frame, and with it the
//! current-dependent part b of the saliency. Its sensitivity is k + 2 b |i| cos 2g, with cos 2g = (i_d^2 - i_q^2)/|i|^2.)
//!
//! An error that is faster than the flux has the sensitivity without load, even where the load has made the lasting sensitivity
//! smaller. The gain of the angle loop is at most the gain for that sensitivity. With the gain for the lasting sensitivity,
//! which is up to twice as large, an oscillation of 17 Hz grew near zero stator frequency.

use crate::table::{POINTS, ReferenceTable, SlopeTable, between, odd};

/// Largest angle error per deviation of the saliency, relative to its value without q-axis current.
const MOST_GAIN: f32 = 2.0;

/// Saliency offset and inverse sensitivity over i_q.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GainSchedule {
    table: ReferenceTable,
    /// Angle error per deviation of the saliency, rad.
    per_saliency: [f32; POINTS],
}

/// The schedule at a q-axis current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchedulePoint {
    /// Saliency offset.
    pub reference: f32,
    /// Angle error per deviation of the saliency, rad: for a lasting error, and for the loop, which is at most the value without
    /// load.
    pub lasting: f32,
    pub gain: f32,
}

impl GainSchedule {
    /// Creates the schedule from an offset and a sensitivity on the same grid.
    pub fn new(table: &ReferenceTable, slope: &SlopeTable) -> Self {
        Self { table: *table, per_saliency: slope.inverses(MOST_GAIN) }
    }

    /// Returns the schedule for the same motor with a learned offset and, if learned, another sensitivity.
    pub fn with_learned(&self, table: &ReferenceTable, slope: Option<&SlopeTable>) -> Self {
        match slope {
            Some(slope) => Self::new(table, slope),
            None => Self { table: *table, ..*self },
        }
    }

    /// Returns the schedule at a q-axis current `i_q`, A.
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

    /// Returns the sensitivity of a saliency that is fixed to the flux alone.
    fn fixed(a: f32) -> SlopeTable {
        SlopeTable::of_flux_saliency(Grid::REFERENCE, a)
    }

    /// Returns the offset with these values over the q-axis current, A.
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
            // Beyond 1 A the sensitivity is 0.7 of its value without current, beyond 2 A a fifth. The angle is limited to twice its
            // value without current, the gain to once.
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
