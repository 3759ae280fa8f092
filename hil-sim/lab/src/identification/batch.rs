//! Least squares over all samples at once: Model A with four complex unknowns (Eq. 22 to 24), and the regression of
//! Model B with seven real unknowns (Eq. 31).

use nalgebra::{ComplexField, DMatrix, DVector, Matrix4, Vector4};

use super::{Complex, Delta, FirstOrderTheta, NotIdentifiable};

/// Largest ratio of the singular values of a regression, with its columns scaled to equal length, that still gives a
/// result. Clean six-step data have up to 1e5, a constant signal above 6e9.
pub const CONDITION_LIMIT: f64 = 1e8;

/// Sampled voltage (V) and current (A), filtered alike: `v[k]` is applied from sample k to k+1.
#[derive(Clone, Debug, Default)]
pub struct Data {
    /// Voltage, V.
    pub v: Vec<Complex>,
    /// Current, A.
    pub i: Vec<Complex>,
}

/// A solved least-squares problem.
#[derive(Clone, Debug)]
pub struct Solution<T: ComplexField> {
    /// The estimate with the least squared error.
    pub theta: DVector<T>,
    /// Upper triangular factor of the regression: the squared error exceeds its minimum by |R (theta - minimum)|².
    pub r: DMatrix<T>,
    /// Ratio of the singular values, with the columns scaled to equal length.
    pub condition: f64,
    /// Squared error at the minimum.
    pub residual: f64,
}

/// Minimises |A theta - y|² by QR factorisation.
///
/// # Errors
/// If a number is not finite, if there are fewer rows than columns, or if the condition number exceeds
/// [`CONDITION_LIMIT`].
pub fn least_squares<T: ComplexField<RealField = f64>>(
    mut a: DMatrix<T>,
    mut y: DVector<T>,
) -> Result<Solution<T>, NotIdentifiable> {
    let n = a.ncols();
    if a.nrows() < n || n == 0 || y.len() != a.nrows() {
        return Err(NotIdentifiable::TooFewSamples);
    }
    let lengths: Vec<f64> = a.column_iter().map(|column| column.norm()).collect();
    if !(lengths.iter().sum::<f64>() + y.norm()).is_finite() {
        return Err(NotIdentifiable::NotFinite);
    }
    if lengths.contains(&0.0) {
        return Err(NotIdentifiable::PoorExcitation);
    }
    for (mut column, length) in a.column_iter_mut().zip(&lengths) {
        column.unscale_mut(*length);
    }
    let qr = a.qr();
    qr.q_tr_mul(&mut y);
    let mut r = qr.unpack_r();
    let singular = r.clone().svd(false, false).singular_values;
    let condition = singular.max() / singular.min();
    if condition.is_nan() || condition > CONDITION_LIMIT {
        return Err(NotIdentifiable::PoorExcitation);
    }
    let top = y.rows(0, n).into_owned();
    let residual = y.rows(n, y.len() - n).norm_squared();
    let Some(mut theta) = r.solve_upper_triangular(&top) else {
        return Err(NotIdentifiable::PoorExcitation);
    };
    for (k, length) in lengths.iter().enumerate() {
        theta[k] = theta[k].clone().unscale(*length);
        r.column_mut(k).scale_mut(*length);
    }
    Ok(Solution { theta, r, condition, residual })
}

/// Returns the real parts, followed by the imaginary parts.
pub fn parts<'a>(values: impl Iterator<Item = &'a Complex>) -> DVector<f64> {
    DVector::from_vec(values.flat_map(|z| [z.re, z.im]).collect())
}

/// Model A: the coefficients of the equation in differences, and how accurately the data determine them.
#[derive(Clone, Copy, Debug)]
pub struct Regression {
    /// The least-squares estimate.
    pub delta: Delta,
    /// Upper triangular factor of the regression, for unknowns in the order of [`Delta::array`].
    pub r: Matrix4<Complex>,
}

impl Data {
    /// Complex rows in differences: D i(t+h), and [D i(t), i(t-h), D v(t), v(t-h)].
    fn rows(&self) -> impl Iterator<Item = (Complex, [Complex; 4])> {
        let (i, v) = (&self.i, &self.v);
        (1..self.i.len().min(self.v.len()).saturating_sub(1))
            .map(move |k| (i[k + 1] - i[k], [i[k] - i[k - 1], i[k - 1], v[k] - v[k - 1], v[k - 1]]))
    }

    /// Fits Model A (Eq. 22 to 24) with four complex unknowns. The solution equals that of the eight real unknowns of
    /// Eq. 24 to within 1e-12.
    ///
    /// # Errors
    /// As [`least_squares`].
    pub fn regression(&self) -> Result<Regression, NotIdentifiable> {
        let (y, rows): (Vec<_>, Vec<_>) = self.rows().unzip();
        let a = DMatrix::from_fn(rows.len(), 4, |row, column| rows[row][column]);
        let solution = least_squares(a, DVector::from_vec(y))?;
        let theta: Vector4<Complex> = solution.theta.fixed_rows::<4>(0).into();
        Ok(Regression {
            delta: Delta::from_array(theta.into()),
            r: solution.r.fixed_view::<4, 4>(0, 0).into(),
        })
    }

    /// Fits the regression of Model B (Eq. 31), in differences.
    ///
    /// # Errors
    /// As [`least_squares`].
    pub fn first_order(&self) -> Result<FirstOrderTheta, NotIdentifiable> {
        let rows: Vec<_> = self.rows().collect();
        // Eq. 31 multiplies theta_2, theta_4 and theta_7 by -j times the signal.
        let a = DMatrix::from_fn(2 * rows.len(), 7, |row, column| {
            let [di, i, dv, v] = rows[row / 2].1;
            let turned = |x: Complex| Complex::new(x.im, -x.re);
            let x = [di, turned(di), i, turned(i), dv, v, turned(v)][column];
            if row.is_multiple_of(2) { x.re } else { x.im }
        });
        let theta = least_squares(a, parts(rows.iter().map(|row| &row.0)))?.theta;
        let [t1_minus_1, t2, _, t2_t4, t5, t5_t6, _] = std::array::from_fn(|k| theta[k]);
        Ok(FirstOrderTheta { t1_minus_1, t2, t2_t4, t5, t5_t6 })
    }
}
