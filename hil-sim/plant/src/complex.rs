//! Space vectors as complex numbers, and the Clarke transformation in `f64`.

/// A space vector in the stator frame: the real part is alpha (along the axis of phase a), the imaginary part beta. It
/// is amplitude-invariant, so its magnitude is a peak phase value.
pub use num_complex::Complex64 as Complex;

const FRAC_1_SQRT_3: f64 = 0.577_350_269_189_625_8;
const HALF_SQRT_3: f64 = 0.866_025_403_784_438_6;

/// Clarke transformation, Eq. 2.3; the zero-sequence component is dropped.
pub fn clarke(abc: [f64; 3]) -> Complex {
    let [a, b, c] = abc;
    Complex::new((2.0 / 3.0) * a - (1.0 / 3.0) * (b + c), FRAC_1_SQRT_3 * (b - c))
}

/// Inverse of [`clarke`] with no zero-sequence component.
pub fn phases(x: Complex) -> [f64; 3] {
    let (half, other) = (0.5 * x.re, HALF_SQRT_3 * x.im);
    [x.re, other - half, -other - half]
}

/// Square of the magnitude, without the square root.
pub(crate) fn square(x: Complex) -> f64 {
    x.re * x.re + x.im * x.im
}

/// Scalar product of two vectors.
pub(crate) fn dot(x: Complex, y: Complex) -> f64 {
    x.re * y.re + x.im * y.im
}
