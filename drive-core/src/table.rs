//! Tables over the q-axis current: saliency offset, saliency sensitivity, and injection current.

/// Number of points of a table, from i_q = 0 on.
pub const POINTS: usize = 16;
/// Largest current of a table, as a multiple of the distance of the points.
const STEPS: f32 = 14.0;

/// The q-axis currents of the points: 0, a step, two steps, and so on. By default the step is 0, so every current is at the first point.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Grid {
    step_a: f32,
    per_step: f32,
}

impl Grid {
    /// The points of the dissertation's motor.
    pub const REFERENCE: Self = Self { step_a: 0.25, per_step: 4.0 };

    /// Returns points `step_a` apart, A; `None` unless that is a positive number.
    pub fn of_step(step_a: f32) -> Option<Self> {
        let per_step = 1.0 / step_a;
        let usable = step_a > 0.0 && per_step > 0.0 && per_step.is_finite();
        usable.then_some(Self { step_a, per_step })
    }

    /// Returns points for currents up to `largest_a`, A peak, a positive number.
    pub fn for_current(largest_a: f32) -> Self {
        Self { step_a: largest_a / STEPS, per_step: STEPS / largest_a }
    }

    /// Returns the distance of the points, A.
    pub fn step_a(self) -> f32 {
        self.step_a
    }

    /// Returns the q-axis current at point `n`, A.
    pub fn current(self, n: usize) -> f32 {
        n as f32 * self.step_a
    }

    /// Returns the interval that contains |i_q|, A, and the position in it, 0 to 1. Beyond the end the last value is used.
    pub(crate) fn place(self, i_q: f32) -> (usize, f32) {
        let x = i_q.abs() * self.per_step;
        // The cast saturates.
        let n = (x as usize).min(POINTS - 2);
        let past = x - n as f32;
        (n, if past < 1.0 { past } else { 1.0 })
    }
}

/// Values over the q-axis current at the points of a grid, of one of three kinds: [`ReferenceTable`], [`CarrierTable`] or
/// [`SlopeTable`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Table<const KIND: u8> {
    grid: Grid,
    values: [f32; POINTS],
}

const REFERENCE: u8 = 0;
const CARRIER: u8 = 1;
const SLOPE: u8 = 2;

/// Offset of the saliency `q` over i_q: odd, linear between the points, constant beyond the last. The first value is 0, and
/// all values are within ±0.3.
///
/// ```
/// use induction_drive_core::table::{Grid, POINTS, ReferenceTable};
///
/// let values = core::array::from_fn(|n| 0.002 * n as f32);
/// let table = ReferenceTable::from_points(Grid::REFERENCE, values).unwrap();
/// assert_eq!((table.at(0.5), table.at(-0.625)), (0.004, -0.005));
/// assert_eq!(table.at(4.5), values[POINTS - 1]);
/// ```
pub type ReferenceTable = Table<REFERENCE>;
/// Injection current over i_q relative to its value at i_q = 0; even. The first value is 1, and all values are within 0.5 to 2.
pub type CarrierTable = Table<CARRIER>;
/// Saliency sensitivity dq/de, the change of the saliency per angle error, over i_q, 1/rad: even, of one sign. All values are
/// within ±(0.001 to 0.6).
///
/// The error e is the angle of the flux less the angle of the estimated frame. The sensitivity is the steady one: current
/// and flux have settled at every e. A saliency `a` that is fixed to the flux alone has the sensitivity 2a, which is
/// negative if the inductance along the flux is the larger one.
pub type SlopeTable = Table<SLOPE>;

impl<const KIND: u8> Table<KIND> {
    /// Returns a table from its values at the points of `grid`; `None` if the first value or any other violates the limits of the
    /// type.
    pub fn from_points(grid: Grid, values: [f32; POINTS]) -> Option<Self> {
        let first = values[0];
        let believable = |value: &f32| match KIND {
            REFERENCE => first == 0.0 && (-0.3..=0.3).contains(value),
            CARRIER => first == 1.0 && (0.5..=2.0).contains(value),
            _ => (0.001..=0.6).contains(&value.abs()) && value * first > 0.0,
        };
        values.iter().all(believable).then_some(Self { grid, values })
    }

    /// Returns the q-axis currents of the points.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns the values at the points.
    pub fn points(&self) -> &[f32; POINTS] {
        &self.values
    }

    /// Returns the default table at these currents, which is used until the table of the motor is learned.
    pub fn guessed(grid: Grid) -> Self
    where
        Self: Default,
    {
        Self { grid, ..Self::default() }
    }
}

impl Default for ReferenceTable {
    /// Returns the table that was learned on the simulated motor of Table 5 with a flux-fixed
    /// saliency of -3.5 % (experiment `learn-reference`). It belongs to that motor.
    fn default() -> Self {
        let values = [
            0.0, 0.01617, 0.02813, 0.03534, 0.03926, 0.04140, 0.04257, 0.04319, 0.04349, 0.04359,
            0.04356, 0.04345, 0.04328, 0.04308, 0.04308, 0.04308,
        ];
        Self { grid: Grid::REFERENCE, values }
    }
}

impl Default for CarrierTable {
    /// Returns the table that was learned on the simulated motor of Table 5 together with the
    /// default [`ReferenceTable`]. It belongs to that motor.
    fn default() -> Self {
        let values = [
            1.0, 1.00233, 1.0137, 1.02747, 1.04167, 1.05552, 1.06871, 1.08156, 1.0942, 1.10684,
            1.11946, 1.13211, 1.14488, 1.15781, 1.15781, 1.15781,
        ];
        Self { grid: Grid::REFERENCE, values }
    }
}

impl ReferenceTable {
    /// Returns the saliency offset at a q-axis current `i_q`, A.
    pub fn at(&self, i_q: f32) -> f32 {
        odd(i_q, between(&self.values, self.grid.place(i_q)))
    }
}

/// Interpolates a table linearly at a [`place`](Grid::place).
pub(crate) fn between(table: &[f32; POINTS], (n, past): (usize, f32)) -> f32 {
    table[n] + (table[n + 1] - table[n]) * past
}

/// Returns the odd continuation: the value `q` at |i_q| with the sign of `i_q`.
pub(crate) fn odd(i_q: f32, q: f32) -> f32 {
    if i_q < 0.0 { -q } else { q }
}

impl SlopeTable {
    /// Returns the sensitivity of a saliency `a` that is fixed to the flux.
    pub fn of_flux_saliency(grid: Grid, a: f32) -> Self {
        Self { grid, values: [2.0 * a; POINTS] }
    }

    /// Returns the sensitivity without q-axis current, 1/rad.
    pub fn at_rest(&self) -> f32 {
        self.values[0]
    }

    /// Returns the inverses, rad, at most `most` times the inverse without q-axis current.
    #[cold]
    pub(crate) fn inverses(&self, most: f32) -> [f32; POINTS] {
        let first = self.at_rest();
        self.values.map(|k| {
            let ratio = first / k;
            (if ratio < most { ratio } else { most }) / first
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_begins_with_zero_and_is_believable() {
        let mut q = [0.02; POINTS];
        assert_eq!(ReferenceTable::from_points(Grid::REFERENCE, q), None);
        q[0] = 0.0;
        assert!(ReferenceTable::from_points(Grid::REFERENCE, q).is_some());
        for wrong in [0.31, -0.31, f32::NAN] {
            q[15] = wrong;
            assert_eq!(ReferenceTable::from_points(Grid::REFERENCE, q), None, "{wrong}");
        }
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

    /// The defaults are for 3.5 A; for twice that current they have the same values at twice the currents.
    #[test]
    fn a_guess_is_in_proportion_to_the_largest_current() {
        let grid = Grid::for_current(7.0);
        let (reference, carrier) = (ReferenceTable::guessed(grid), CarrierTable::guessed(grid));
        for n in 0..POINTS {
            let (i_q, twice) = (0.25 * n as f32, reference.grid().current(n));
            assert!((twice - 2.0 * i_q).abs() < 1e-5);
            assert!((reference.at(twice) - ReferenceTable::default().at(i_q)).abs() < 1e-6);
        }
        assert_eq!(carrier.grid(), reference.grid());
        assert_eq!(carrier.points(), CarrierTable::default().points());
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
}
