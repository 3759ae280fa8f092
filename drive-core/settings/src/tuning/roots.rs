//! Roots of a small real polynomial.
//!
//! Own code: eigenvalue routines of linear-algebra crates need an allocator or are large, while the
//! polynomials here have two or three roots and no control step depends on them.

use num_complex::Complex64;

/// Roots of the monic polynomial z^N + c\[0\] z^(N-1) + … + c\[N-1\] by the simultaneous iteration of
/// Durand and Kerner; `None` if it does not converge (non-finite coefficients).
///
/// Accuracy relative to the largest root: about 1e-14 for simple roots, 1e-7 for double roots.
///
/// ```
/// use induction_drive_settings::tuning::roots;
///
/// // (z - 0.5)(z + 2) = z² + 1.5 z - 1
/// let roots = roots([1.5, -1.0]).unwrap();
/// assert!(roots.iter().any(|z| (z.re - 0.5).abs() < 1e-12 && z.im.abs() < 1e-12));
/// assert!(roots.iter().any(|z| (z.re + 2.0).abs() < 1e-12 && z.im.abs() < 1e-12));
/// ```
pub fn roots<const N: usize>(c: [f64; N]) -> Option<[Complex64; N]> {
    if !c.iter().all(|c| c.is_finite()) {
        return None;
    }
    // No root lies outside 1 + max |c|.
    let bound = c.iter().fold(1.0, |bound, c| f64::max(bound, 1.0 + c.abs()));
    let value = |z| c.iter().fold(Complex64::ONE, |v, c| v * z + Complex64::new(*c, 0.0));
    // Start values neither real nor symmetric about the real axis.
    let seed = Complex64::new(0.4, 0.9);
    let mut power = Complex64::new(bound, 0.0);
    let mut roots = [Complex64::ONE; N].map(|_| {
        power *= seed;
        power
    });
    for _ in 0..1000 {
        let mut moved = 0.0;
        for i in 0..N {
            let here = roots[i];
            let mut others = Complex64::ONE;
            for (_, other) in roots.iter().enumerate().filter(|(j, _)| *j != i) {
                others *= here - *other;
            }
            if others == Complex64::default() {
                // Two estimates coincide: separate them.
                others = Complex64::new(1e-12, 1e-12);
            }
            let step = value(here) / others;
            roots[i] = here - step;
            moved = f64::max(moved, step.norm());
        }
        if moved < 1e-14 * bound {
            return Some(roots);
        }
    }
    // Multiple roots converge slowly; accept them if the residual is at the level of rounding.
    let rounding = 1e-10 * (0..N).fold(1.0, |power, _| power * bound);
    roots.iter().all(|root| value(*root).norm() <= rounding).then_some(roots)
}
