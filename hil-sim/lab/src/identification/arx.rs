//! General ARX model by least squares (appendix A of Barroso 2017):
//!
//! ```text
//! y[k] = -a1 y[k-1] - ... - an y[k-n] + b1 u[k-d-1] + ... + bm u[k-d-m]
//! ```
//!
//! The appendix prints the last row of Eq. A.4 and A.5 one sample too late; this code uses all rows for which every
//! term exists. The sentence below Eq. A.8 omits the inverse that the equation prints.

use nalgebra::{DMatrix, DVector};

use super::NotIdentifiable;
use super::batch::least_squares;

/// Orders of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orders {
    /// Coefficients of past outputs, n.
    pub outputs: usize,
    /// Coefficients of past inputs, m.
    pub inputs: usize,
    /// Samples of delay beyond one, d.
    pub delay: usize,
}

/// The fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Arx {
    /// Coefficients a1 to an.
    pub a: Vec<f64>,
    /// Coefficients b1 to bm.
    pub b: Vec<f64>,
    /// Ratio of the singular values of the regression, with its columns scaled to equal length.
    pub condition: f64,
    /// Root of the remaining mean squared error, in the unit of y.
    pub rms: f64,
}

/// Fits the model to the input `u` and the output `y`.
///
/// # Errors
/// As [`least_squares`]: too few samples, numbers that are not finite, or poor excitation.
pub fn fit(u: &[f64], y: &[f64], orders: Orders) -> Result<Arx, NotIdentifiable> {
    let Orders { outputs, inputs, delay } = orders;
    let first = outputs.max(inputs + delay);
    let count = y.len().min(u.len()).saturating_sub(first);
    let regression = DMatrix::from_fn(count, outputs + inputs, |row, column| {
        let k = first + row;
        if column < outputs { -y[k - 1 - column] } else { u[k - 1 - delay - (column - outputs)] }
    });
    let target = DVector::from_fn(count, |row, _| y[first + row]);
    let solution = least_squares(regression, target)?;
    let theta = solution.theta.as_slice();
    Ok(Arx {
        a: theta[..outputs].to_vec(),
        b: theta[outputs..].to_vec(),
        condition: solution.condition,
        rms: (solution.residual / count as f64).sqrt(),
    })
}
