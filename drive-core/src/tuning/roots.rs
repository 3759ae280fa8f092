//! Roots of a small real polynomial.

use num_complex::Complex64;

/// Roots of the monic polynomial z^N + c\[0\] z^(N-1) + … + c\[N-1\], by Durand and Kerner's
/// simultaneous iteration; `None` where it does not converge (coefficients that are not finite).
///
/// Simple roots come to about 1e-14 of the largest, double roots to 1e-7.
pub fn roots<const N: usize>(c: [f64; N]) -> Option<[Complex64; N]> {
    // No root lies outside 1 + max |c|.
    let mut bound = 1.0;
    for c in c {
        if !c.is_finite() {
            return None;
        }
        if 1.0 + c.abs() > bound {
            bound = 1.0 + c.abs();
        }
    }
    // Any start that is neither real nor symmetric about the real axis.
    let seed = Complex64::new(0.4, 0.9);
    let mut roots = [Complex64::ONE; N];
    let mut power = Complex64::new(bound, 0.0);
    for r in &mut roots {
        power *= seed;
        *r = power;
    }
    for _ in 0..1000 {
        let mut moved = 0.0;
        for i in 0..N {
            let here = roots[i];
            let mut value = Complex64::ONE;
            for c in c {
                value = value * here + Complex64::new(c, 0.0);
            }
            let mut others = Complex64::ONE;
            for (j, other) in roots.iter().enumerate() {
                if j != i {
                    others *= here - *other;
                }
            }
            if others == Complex64::default() {
                // Two estimates fell together: part them.
                others = Complex64::new(1e-12, 1e-12);
            }
            let step = value / others;
            roots[i] = here - step;
            if step.norm() > moved {
                moved = step.norm();
            }
        }
        if moved < 1e-14 * bound {
            return Some(roots);
        }
    }
    // A multiple root creeps; take it if it has come to rest as far as rounding lets it.
    let close = |r: &Complex64| {
        let value = c.iter().fold(Complex64::ONE, |v, c| v * *r + Complex64::new(*c, 0.0));
        value.norm() <= 1e-10 * (0..N).fold(1.0, |power, _| power * bound)
    };
    roots.iter().all(close).then_some(roots)
}
