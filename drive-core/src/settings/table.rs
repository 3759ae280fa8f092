//! Tables over the torque current: the reference of the saliency, and the carrier current.

use core::fmt;

use crate::math::decimal::Shortest;

/// Points of the tables, from i_q = 0 on.
pub const POINTS: usize = 16;
/// Their distance, A.
pub const STEP_A: f32 = 0.25;
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
        let believable = q.iter().all(|q| (-LARGEST..=LARGEST).contains(q));
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
pub(crate) fn sampled(points: &[(f32, f32)]) -> [f32; POINTS] {
    core::array::from_fn(|n| {
        let i_q = n as f32 * STEP_A;
        match points.windows(2).find(|pair| i_q <= pair[1].0) {
            Some(p) => p[0].1 + (p[1].1 - p[0].1) * (i_q - p[0].0) / (p[1].0 - p[0].0),
            None => points[points.len() - 1].1,
        }
    })
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

pub(crate) fn odd(i_q: f32, q: f32) -> f32 {
    if i_q < 0.0 { -q } else { q }
}

/// Range of a believable ratio.
const RATIO: (f32, f32) = (0.5, 2.0);

/// The carrier current over i_q, as a ratio to that at i_q = 0; even.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarrierTable {
    ratio: [f32; POINTS],
}

impl CarrierTable {
    /// From its values at multiples of [`STEP_A`](crate::flux::schedule::STEP_A); none when the first is not 1 or any is out of range.
    pub fn of_points(ratio: [f32; POINTS]) -> Option<Self> {
        let believable = ratio.iter().all(|r| (RATIO.0..=RATIO.1).contains(r));
        (ratio[0] == 1.0 && believable).then_some(Self { ratio })
    }

    /// Its values at multiples of [`STEP_A`](crate::flux::schedule::STEP_A).
    pub fn points(&self) -> &[f32; POINTS] {
        &self.ratio
    }
}

impl Default for CarrierTable {
    /// Learned on the simulated motor of Table 5 together with the default
    /// [`ReferenceTable`](crate::flux::schedule::ReferenceTable): it belongs to that motor.
    fn default() -> Self {
        const LEARNED: [f32; POINTS] = [
            1.0, 1.00233, 1.0137, 1.02747, 1.04167, 1.05552, 1.06871, 1.08156, 1.0942, 1.10684,
            1.11946, 1.13211, 1.14488, 1.15781, 1.15781, 1.15781,
        ];
        Self { ratio: LEARNED }
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
    fn a_carrier_table_begins_with_one_and_has_believable_ratios() {
        let mut ratio = [1.1; POINTS];
        assert_eq!(CarrierTable::of_points(ratio), None);
        ratio[0] = 1.0;
        assert_eq!(CarrierTable::of_points(ratio).map(|t| *t.points()), Some(ratio));
        for wrong in [0.49, 2.1, f32::NAN] {
            ratio[15] = wrong;
            assert_eq!(CarrierTable::of_points(ratio), None, "{wrong}");
        }
    }

    #[test]
    fn errors_name_the_point() {
        for (error, text) in [
            (TableError::TooShort, "a table needs two points at least"),
            (TableError::NotOdd, "point 0 must be 0 at 0 A: the table is odd"),
            (TableError::NotIncreasing(2), "point 2: the currents must increase strictly"),
            (TableError::TooLarge(1, 0.31), "point 1: 0.31 is outside -0.3 to 0.3"),
        ] {
            assert_eq!(error.to_string(), text);
        }
    }
}
