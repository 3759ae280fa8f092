//! Tables over the torque current: reference of the saliency, its slope over the angle, and carrier current.

use core::fmt;

/// Number of points of a table, from i_q = 0 on.
pub const POINTS: usize = 16;
/// The largest regulated current lies at this multiple of the distance of the points.
const STEPS: f32 = 14.0;

/// The torque currents of the points: 0, a step, two steps, and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    step_a: f32,
    per_step: f32,
}

impl Grid {
    /// The points of the dissertation's motor.
    pub const REFERENCE: Self = Self { step_a: 0.25, per_step: 4.0 };

    /// Points `step_a` apart, A; `None` unless that is a positive number.
    pub fn of_step(step_a: f32) -> Option<Self> {
        let per_step = 1.0 / step_a;
        let usable = step_a > 0.0 && per_step > 0.0 && per_step.is_finite();
        usable.then_some(Self { step_a, per_step })
    }

    /// Points for currents up to `largest_a`, A peak, a positive number.
    pub fn for_current(largest_a: f32) -> Self {
        Self { step_a: largest_a / STEPS, per_step: STEPS / largest_a }
    }

    /// Distance of the points, A.
    pub fn step_a(self) -> f32 {
        self.step_a
    }

    /// Torque current at point `n`, A.
    pub fn current(self, n: usize) -> f32 {
        n as f32 * self.step_a
    }

    /// Interval that contains |i_q|, A, and the position in it, 0 to 1. The last value is held beyond the end.
    pub(crate) fn place(self, i_q: f32) -> (usize, f32) {
        let x = i_q.abs() * self.per_step;
        // Saturating cast.
        let n = (x as usize).min(POINTS - 2);
        let past = x - n as f32;
        (n, if past < 1.0 { past } else { 1.0 })
    }
}
/// Largest accepted saliency.
const LARGEST: f32 = 0.3;

/// Reference of the saliency `q` over i_q: odd, linear between the points, constant beyond the last.
///
/// ```
/// use drive_core::settings::table::{Grid, ReferenceTable};
///
/// let table = ReferenceTable::new(Grid::REFERENCE, &[(0.0, 0.0), (1.0, 0.02), (2.0, 0.03)])?;
/// assert!((table.at(0.5) - 0.01).abs() < 1e-6 && (table.at(-1.5) + 0.025).abs() < 1e-6);
/// assert_eq!(table.at(3.5), 0.03);
/// # Ok::<(), drive_core::settings::table::TableError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceTable {
    grid: Grid,
    q: [f32; POINTS],
}

/// Why a table was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TableError {
    /// Fewer than two points.
    TooShort,
    /// The first point is not 0 at i_q = 0: the table would not be odd.
    NotOdd,
    /// The current of this point is not above the previous one, or not finite.
    NotIncreasing(usize),
    /// The value of this point is beyond ±0.3, or not finite.
    TooLarge(usize, f32),
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort => write!(f, "a table needs two points at least"),
            Self::NotOdd => write!(f, "point 0 must be 0 at 0 A: the table is odd"),
            Self::NotIncreasing(n) => write!(f, "point {n}: the currents must increase strictly"),
            Self::TooLarge(n, q) => {
                write!(f, "point {n}: {q} is outside -{LARGEST} to {LARGEST}")
            }
        }
    }
}

impl core::error::Error for TableError {}

impl ReferenceTable {
    /// Table from points `(i_q in A, q)` with increasing i_q, (0, 0) first; linear between them, constant
    /// beyond the last.
    ///
    /// # Errors
    /// See [`TableError`].
    pub fn new(grid: Grid, points: &[(f32, f32)]) -> Result<Self, TableError> {
        let first = points.first().ok_or(TableError::TooShort)?;
        if *first != (0.0, 0.0) {
            return Err(TableError::NotOdd);
        }
        if points.len() < 2 {
            return Err(TableError::TooShort);
        }
        for (n, pair) in points.windows(2).enumerate() {
            // NaN fails the comparisons.
            if !(pair[1].0 > pair[0].0 && pair[1].0.is_finite()) {
                return Err(TableError::NotIncreasing(n + 1));
            }
            let believable = pair[1].1.abs() <= LARGEST;
            if !believable {
                return Err(TableError::TooLarge(n + 1, pair[1].1));
            }
        }
        Ok(Self { grid, q: sampled(grid, points) })
    }

    /// Table from its values at the points of `grid`; `None` when the first is not 0 or any is beyond ±0.3.
    pub fn from_points(grid: Grid, q: [f32; POINTS]) -> Option<Self> {
        let believable = q.iter().all(|q| (-LARGEST..=LARGEST).contains(q));
        (q[0] == 0.0 && believable).then_some(Self { grid, q })
    }

    /// The torque currents of the points.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The values at the points.
    pub fn points(&self) -> &[f32; POINTS] {
        &self.q
    }

    /// Reference at a quadrature current `i_q`, A.
    pub fn at(&self, i_q: f32) -> f32 {
        odd(i_q, between(&self.q, self.grid.place(i_q)))
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
        Self { grid: Grid::REFERENCE, q: LEARNED }
    }
}

impl ReferenceTable {
    /// The default in proportion to the largest regulated current, A peak: a beginning until the motor's own is
    /// learned.
    pub fn guessed(largest_a: f32) -> Self {
        Self { grid: Grid::for_current(largest_a), ..Self::default() }
    }
}

/// Samples the line through `points` `(i_q in A, value)` on a grid; constant beyond the last. At least two points
/// with increasing currents.
pub(crate) fn sampled(grid: Grid, points: &[(f32, f32)]) -> [f32; POINTS] {
    core::array::from_fn(|n| {
        let i_q = grid.current(n);
        match points.windows(2).find(|pair| i_q <= pair[1].0) {
            Some(p) => p[0].1 + (p[1].1 - p[0].1) * (i_q - p[0].0) / (p[1].0 - p[0].0),
            None => points[points.len() - 1].1,
        }
    })
}

/// Linear interpolation of a table at a [`place`](Grid::place).
pub(crate) fn between(table: &[f32; POINTS], (n, past): (usize, f32)) -> f32 {
    table[n] + (table[n + 1] - table[n]) * past
}

/// Odd continuation: the sign of `i_q` on the value `q` at |i_q|.
pub(crate) fn odd(i_q: f32, q: f32) -> f32 {
    if i_q < 0.0 { -q } else { q }
}

/// Accepted range of the ratio.
const RATIO: (f32, f32) = (0.5, 2.0);

/// Carrier current over i_q as a ratio to that at i_q = 0; even.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarrierTable {
    grid: Grid,
    ratio: [f32; POINTS],
}

impl CarrierTable {
    /// Table from its values at the points of `grid`; `None` when the first is not 1 or any is outside 0.5 to 2.
    pub fn from_points(grid: Grid, ratio: [f32; POINTS]) -> Option<Self> {
        let believable = ratio.iter().all(|r| (RATIO.0..=RATIO.1).contains(r));
        (ratio[0] == 1.0 && believable).then_some(Self { grid, ratio })
    }

    /// The torque currents of the points.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The values at the points.
    pub fn points(&self) -> &[f32; POINTS] {
        &self.ratio
    }
}

impl Default for CarrierTable {
    /// Learned on the simulated motor of Table 5 together with the default
    /// [`ReferenceTable`]: it belongs to that motor.
    fn default() -> Self {
        const LEARNED: [f32; POINTS] = [
            1.0, 1.00233, 1.0137, 1.02747, 1.04167, 1.05552, 1.06871, 1.08156, 1.0942, 1.10684,
            1.11946, 1.13211, 1.14488, 1.15781, 1.15781, 1.15781,
        ];
        Self { grid: Grid::REFERENCE, ratio: LEARNED }
    }
}

impl CarrierTable {
    /// As [`ReferenceTable::guessed`].
    pub fn guessed(largest_a: f32) -> Self {
        Self { grid: Grid::for_current(largest_a), ..Self::default() }
    }
}

/// Accepted magnitude of the slope, 1/rad.
const SLOPE: (f32, f32) = (0.001, 0.6);

/// Slope dq/de of the saliency over the angle error over i_q, 1/rad: even, of one sign.
///
/// The error e is the angle of the flux less that of the estimated frame, and the slope the slow one: current and flux have
/// settled at every e. A saliency `a` that is fixed to the flux and to nothing else has the slope 2a; it is negative where
/// the inductance along the flux is the larger one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeTable {
    grid: Grid,
    k: [f32; POINTS],
}

impl SlopeTable {
    /// Table from its values at the points of `grid`; `None` when one is outside ±(0.001 to 0.6) or has not the sign of
    /// the first.
    pub fn from_points(grid: Grid, k: [f32; POINTS]) -> Option<Self> {
        let believable = |k_n: &f32| (SLOPE.0..=SLOPE.1).contains(&k_n.abs()) && k_n * k[0] > 0.0;
        k.iter().all(believable).then_some(Self { grid, k })
    }

    /// The slope of a saliency `a` that is fixed to the flux.
    pub fn of_flux_saliency(grid: Grid, a: f32) -> Self {
        Self { grid, k: [2.0 * a; POINTS] }
    }

    /// The torque currents of the points.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The values at the points, 1/rad.
    pub fn points(&self) -> &[f32; POINTS] {
        &self.k
    }

    /// The slope without torque current, 1/rad.
    pub fn at_rest(&self) -> f32 {
        self.k[0]
    }

    /// The inverses, rad, at most `most` times that without torque current.
    pub(crate) fn inverses(&self, most: f32) -> [f32; POINTS] {
        let [first, ..] = self.k;
        self.k.map(|k| {
            let ratio = first / k;
            (if ratio < most { ratio } else { most }) / first
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_checked() {
        let new = |points: &[(f32, f32)]| ReferenceTable::new(Grid::REFERENCE, points);
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
        assert_eq!(CarrierTable::from_points(Grid::REFERENCE, ratio), None);
        ratio[0] = 1.0;
        assert_eq!(
            CarrierTable::from_points(Grid::REFERENCE, ratio).map(|t| *t.points()),
            Some(ratio)
        );
        for wrong in [0.49, 2.1, f32::NAN] {
            ratio[15] = wrong;
            assert_eq!(CarrierTable::from_points(Grid::REFERENCE, ratio), None, "{wrong}");
        }
    }

    #[test]
    fn slopes_have_one_sign_and_bounded_inverses() {
        let mut k = [-0.04; POINTS];
        (k[3], k[4]) = (-0.025, -0.01);
        let inverses = SlopeTable::from_points(Grid::REFERENCE, k).unwrap().inverses(2.0);
        for (n, inverse) in [(0, -25.0), (3, -40.0), (4, -50.0)] {
            assert!((inverses[n] - inverse).abs() < 1e-3, "{n}: {inverses:?}");
        }
        for wrong in [0.01, 0.0, -0.0009, -0.61, f32::NAN] {
            k[7] = wrong;
            assert_eq!(SlopeTable::from_points(Grid::REFERENCE, k), None, "{wrong}");
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
