//! Roots of polynomials.

use nalgebra::DMatrix;
use num_complex::Complex64;

/// Roots of the monic polynomial z^N + c\[0\] z^(N-1) + … + c\[N-1\]: the eigenvalues of its companion matrix. Finite coefficients.
pub fn roots(c: &[f64]) -> Vec<Complex64> {
    let companion = |row: usize, column: usize| {
        if row == 0 { -c[column] } else { f64::from(row == column + 1) }
    };
    DMatrix::from_fn(c.len(), c.len(), companion).complex_eigenvalues().as_slice().to_vec()
}

/// Largest magnitude of the [`roots`] of a polynomial.
pub fn largest_pole(c: &[f64]) -> f64 {
    roots(c).iter().map(|p| p.norm()).fold(0.0, f64::max)
}
