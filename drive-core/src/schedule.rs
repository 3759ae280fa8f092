//! What the synchronous demodulation is compared with, and how strongly it corrects, over the torque
//! current.
//!
//! At the right angle the saliency `q` is not zero but depends on i_q, because part of the saliency
//! follows the stator current. The reference is an odd table over i_q, learned with the shaft locked.
//! The loop gain depends on i_q as well: an error of the angle turns the real current, and with it
//! the current's part of the saliency, so that fast errors see a slope of 2 (|a| + b |i| |cos 2g|)
//! instead of 2 |a|. The gain is scheduled to make up for that.

use core::fmt;

use crate::decimal::Shortest;
use crate::synchronous::Saliency;

/// Points of the tables, from i_q = 0 on.
pub const POINTS: usize = 16;
/// Their distance, A.
pub const STEP_A: f32 = 0.25;
/// Share of the proportional part that is left however steep the fast slope. Only errors faster than
/// the current loop see that slope in full; with all of it taken out the tracking loop has too little
/// damping at large currents. (3.5 Hz, a rotor 30 % warmer than believed, 3 A to -3 A, the worst of
/// 72 runs: 19.8° with 0.3, 17.4° with 0.8, 16.5° with 1; 1.54°, 1.63° and 1.69° rms at constant
/// current.)
const LEAST_SHARE: f32 = 0.8;
/// Largest saliency that is believed.
const LARGEST: f32 = 0.3;

/// The reference of `q` over i_q, odd.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceTable {
    q: [f32; POINTS],
}

/// Why a table was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TableError {
    /// Fewer than two points.
    TooShort,
    /// The first point is not 0 at i_q = 0: the table would not be odd.
    NotOdd,
    /// The currents do not increase strictly, or are not finite, from this point on.
    NotIncreasing(usize),
    /// A value beyond ±0.3, or not finite, at this point.
    TooLarge(usize, f32),
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort => write!(f, "a table needs two points at least"),
            Self::NotOdd => write!(f, "point 0 must be 0 at 0 A: the table is odd"),
            Self::NotIncreasing(n) => write!(f, "point {n}: the currents must increase strictly"),
            Self::TooLarge(n, q) => {
                let (q, largest) = (Shortest(*q), Shortest(LARGEST));
                write!(f, "point {n}: {q} is outside -{largest} to {largest}")
            }
        }
    }
}

impl core::error::Error for TableError {}

impl ReferenceTable {
    /// From points `(i_q in A, q)`, i_q = 0 first; linear between them, constant beyond the last.
    ///
    /// # Errors
    /// See [`TableError`].
    #[inline]
    pub fn new(points: &[(f32, f32)]) -> Result<Self, TableError> {
        let first = points.first().ok_or(TableError::TooShort)?;
        if *first != (0.0, 0.0) {
            return Err(TableError::NotOdd);
        }
        if points.len() < 2 {
            return Err(TableError::TooShort);
        }
        for (n, pair) in points.windows(2).enumerate() {
            // Not-a-number fails the tests.
            if !(pair[1].0 > pair[0].0 && pair[1].0.is_finite()) {
                return Err(TableError::NotIncreasing(n + 1));
            }
            let believable = pair[1].1.abs() <= LARGEST;
            if !believable {
                return Err(TableError::TooLarge(n + 1, pair[1].1));
            }
        }
        Ok(Self { q: sampled(points) })
    }

    /// From its values at multiples of [`STEP_A`]; none when the first is not 0 or any is beyond ±0.3.
    pub fn of_points(q: [f32; POINTS]) -> Option<Self> {
        let believable = all_within(&q, -LARGEST, LARGEST);
        (q[0] == 0.0 && believable).then_some(Self { q })
    }

    /// Its values at multiples of [`STEP_A`].
    pub fn points(&self) -> &[f32; POINTS] {
        &self.q
    }

    /// The reference at a quadrature current, A.
    pub fn at(&self, i_q: f32) -> f32 {
        odd(i_q, between(&self.q, place(i_q)))
    }
}

impl Default for ReferenceTable {
    /// Learned on the simulated motor of Table 5 with a flux-fixed saliency of -3.5 % (experiment
    /// `learn-reference`): it belongs to that motor.
    fn default() -> Self {
        const LEARNED: [f32; POINTS] = [
            0.0, 0.01617, 0.02813, 0.03534, 0.03926, 0.04140, 0.04257, 0.04319, 0.04349, 0.04359,
            0.04356, 0.04345, 0.04328, 0.04308, 0.04308, 0.04308,
        ];
        Self { q: LEARNED }
    }
}

/// A table of the line through points `(i_q in A, value)`, of which there are two at least and whose
/// currents increase; constant beyond the last.
#[inline]
pub(crate) fn sampled(points: &[(f32, f32)]) -> [f32; POINTS] {
    core::array::from_fn(|n| {
        let i_q = n as f32 * STEP_A;
        match points.windows(2).find(|pair| i_q <= pair[1].0) {
            Some(p) => p[0].1 + (p[1].1 - p[0].1) * (i_q - p[0].0) / (p[1].0 - p[0].0),
            None => points[points.len() - 1].1,
        }
    })
}

/// Goes through a table, not in the control step. (By a length that the compiler does not know: else it
/// writes `f` out sixteen times.)
pub(crate) fn each(table: &mut [f32; POINTS], mut f: impl FnMut(usize, f32) -> f32) {
    for (n, x) in core::hint::black_box(table.as_mut_slice()).iter_mut().enumerate() {
        *x = f(n, *x);
    }
}

/// Whether all values of a table lie from `low` to `high`; not in the control step. (See [`each`].)
pub(crate) fn all_within(table: &[f32; POINTS], low: f32, high: f32) -> bool {
    core::hint::black_box(table.as_slice()).iter().all(|x| (low..=high).contains(x))
}

/// The interval of the tables in which a current lies, A, and the share of it that is past. The last
/// value is held beyond the end.
pub(crate) fn place(i_q: f32) -> (usize, f32) {
    let x = i_q.abs() * (1.0 / STEP_A);
    // Saturating cast.
    let n = (x as usize).min(POINTS - 2);
    let past = x - n as f32;
    (n, if past < 1.0 { past } else { 1.0 })
}

/// The value at a [`place`] of a table.
pub(crate) fn between(table: &[f32; POINTS], (n, past): (usize, f32)) -> f32 {
    table[n] + (table[n + 1] - table[n]) * past
}

fn odd(i_q: f32, q: f32) -> f32 {
    if i_q < 0.0 { -q } else { q }
}

/// Reference and gain over i_q, for the control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    table: ReferenceTable,
    share: [f32; POINTS],
    /// What it was made for.
    flux_saliency: f32,
    current_saliency: f32,
    i_d: f32,
    /// Angle error per difference of the saliency, rad.
    pub per_saliency: f32,
}

impl Schedule {
    /// With the flux-fixed saliency `a` at nominal flux, the saliency `b` per ampere of stator
    /// current, 1/A, and the direct-axis current, A.
    #[inline]
    pub fn new(table: &ReferenceTable, a: f32, b: f32, i_d: f32) -> Self {
        let by_current = |n: usize, _: f32| {
            let i_q = n as f32 * STEP_A;
            let length = libm::sqrtf(i_d * i_d + i_q * i_q);
            // b |i| cos 2 gamma, where it adds to the slope
            let current_part = b * (i_q * i_q - i_d * i_d) / length;
            let by_slope =
                a.abs() / (a.abs() + if current_part > 0.0 { current_part } else { 0.0 });
            LEAST_SHARE + (1.0 - LEAST_SHARE) * by_slope
        };
        let mut share = [0.0; POINTS];
        each(&mut share, by_current);
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
        (odd(i_q, between(&self.table.q, place)), between(&self.share, place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_checked() {
        let new = ReferenceTable::new;
        assert_eq!(new(&[]), Err(TableError::TooShort));
        assert_eq!(new(&[(0.0, 0.0)]), Err(TableError::TooShort));
        assert_eq!(new(&[(0.0, 0.01), (1.0, 0.02)]), Err(TableError::NotOdd));
        assert_eq!(new(&[(0.0, 0.0), (1.0, 0.02), (1.0, 0.03)]), Err(TableError::NotIncreasing(2)));
        assert_eq!(new(&[(0.0, 0.0), (f32::NAN, 0.02)]), Err(TableError::NotIncreasing(1)));
        assert_eq!(new(&[(0.0, 0.0), (1.0, 0.31)]), Err(TableError::TooLarge(1, 0.31)));
        assert!(matches!(new(&[(0.0, 0.0), (1.0, f32::NAN)]), Err(TableError::TooLarge(1, _))));
    }

    #[test]
    fn lookup_is_odd_linear_and_held() {
        let table = ReferenceTable::new(&[(0.0, 0.0), (1.0, 0.04), (3.0, 0.05)]).unwrap();
        let schedule = Schedule::new(&table, -0.035, 0.034, 0.7);
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
        let schedule = Schedule::new(&ReferenceTable::default(), -0.035, 0.0338, 0.7);
        for (n, share) in [1.0, 1.0, 0.71, 0.49, 0.38, 0.32, 0.27].into_iter().enumerate() {
            let found = (schedule.at(0.5 * n as f32).1 - LEAST_SHARE) / (1.0 - LEAST_SHARE);
            assert!((found - share).abs() < 0.011, "{n}: {found}");
        }
    }
}
