//! Elementary functions in `f64`, made small: what is here runs when a setting changes, on a core that
//! computes `f64` in software.
//!
//! `libm`'s are right to the last bit and take 10 KiB of the microcontroller, these 1 KiB.

use core::f64::consts::{FRAC_PI_2, PI};

/// Square root, to 3e-16; of 0 or not-a-number the same, of what is negative not-a-number.
pub fn sqrt(x: f64) -> f64 {
    if x == 0.0 || x.is_infinite() && x > 0.0 {
        return x;
    }
    if x < 0.0 {
        return f64::NAN;
    }
    // Half the exponent, to 4 %; then Newton's iteration, which squares the error: 8e-4, 3e-7, 5e-14.
    let mut root = f64::from_bits((x.to_bits() >> 1) + 0x1ff7_a3be_a91d_9b1b);
    for _ in 0..4 {
        root = 0.5 * (root + x / root);
    }
    root
}

/// Angle of the point (x, y) in (-π, π], to 9e-16 (two units in the last place of π).
pub fn atan2(y: f64, x: f64) -> f64 {
    // Within the first eighth of the turn, then back.
    let (along, across) = (x.abs(), y.abs());
    let steep = across > along;
    let (above, below) = if steep { (along, across) } else { (across, along) };
    let first = if above == 0.0 { 0.0 } else { atan_below_one(above / below) };
    let quarter = if steep { FRAC_PI_2 - first } else { first };
    let half = if x < 0.0 { PI - quarter } else { quarter };
    if y < 0.0 { -half } else { half }
}

/// tan(π/16) and tan(π/32).
const STEP: f64 = 0.198_912_367_379_658;
const HALF_STEP: f64 = 0.098_491_403_357_164_25;

/// atan of 0 to 1: less as many sixteenths of π as it takes to come near zero, then its series.
fn atan_below_one(mut tan: f64) -> f64 {
    let mut sixteenths = 0.0;
    while tan > HALF_STEP {
        tan = (tan - STEP) / (1.0 + tan * STEP);
        sixteenths += 1.0;
    }
    let square = tan * tan;
    // 1 - x²/3 + x⁴/5 - ...: the first term left out is below 1e-17.
    let mut sum = 0.0;
    for n in (0..8_u8).rev() {
        sum = 1.0 / f64::from(2 * n + 1) - square * sum;
    }
    sixteenths * (PI / 16.0) + tan * sum
}

/// e^x - 1 for |x| up to 700, to 2e-15 of it and 5e-16 more for every 1 of x: by its series for a small part of
/// x, and (1 + y)² - 1 = y (2 + y).
pub fn exp_m1(x: f64) -> f64 {
    let (mut part, mut doublings) = (x, 0_u8);
    // (What is not finite ends too.)
    while part.abs() > 0.125 && doublings < 13 {
        part *= 0.5;
        doublings += 1;
    }
    // 1 + x/2 (1 + x/3 (1 + ...)): the first term left out is below 1e-17.
    let mut sum = 1.0;
    for n in (2..=11_u8).rev() {
        sum = 1.0 + part / f64::from(n) * sum;
    }
    let mut y = part * sum;
    for _ in 0..doublings {
        y *= 2.0 + y;
    }
    y
}

/// Sine and cosine, to 2e-16 for angles up to a thousand turns.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    // To within an eighth of a turn. The upper part of a quarter turn has 33 bits: its multiples are
    // exact.
    const UPPER: f64 = 1.570_796_326_734_125_6;
    const LOWER: f64 = 6.077_100_506_506_192e-11;
    let quarters = angle / FRAC_PI_2;
    let quarter = if quarters < 0.0 { (quarters - 0.5) as i64 } else { (quarters + 0.5) as i64 };
    let n = quarter as f64;
    let x = angle - n * UPPER - n * LOWER;

    // Taylor's series: the first term left out is below 1e-17.
    let square = x * x;
    let series = |terms: &[f64]| terms.iter().fold(0.0, |sum, term| 1.0 - sum * square * term);
    let cos = series(&COSINE);
    let sin = x * series(&SINE);
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// 1/((2k)(2k - 1)), from k = 9 down: cos x = 1 - x²/2 (1 - x²/12 (1 - …)).
const COSINE: [f64; 9] = over_products(-1.0);
/// 1/((2k)(2k + 1)): sin x = x (1 - x²/6 (1 - x²/20 (1 - …))).
const SINE: [f64; 9] = over_products(1.0);

const fn over_products(beside: f64) -> [f64; 9] {
    let mut terms = [0.0; 9];
    let mut i = 0;
    while i < terms.len() {
        let even = 2.0 * (terms.len() - i) as f64;
        terms[i] = 1.0 / (even * (even + beside));
        i += 1;
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_angles_and_exponentials_are_those_of_libm() {
        for n in 1..=400_000_i32 {
            let x = libm::pow(10.0, f64::from(n) * 1.5e-3 - 300.0);
            assert!((sqrt(x) / libm::sqrt(x) - 1.0).abs() < 3e-16, "sqrt {x}");
            let angle = (f64::from(n) - 200_000.0) * 1.57e-5;
            let (y, x) = (libm::sin(angle) * 3e-7, libm::cos(angle) * 3e-7);
            assert!((atan2(y, x) - libm::atan2(y, x)).abs() < 9e-16, "atan2 {y} {x}");
            let x = (f64::from(n) - 200_000.0) * 5e-5;
            let allowed = 2e-15 + 5e-16 * x.abs();
            let off = exp_m1(x) - libm::expm1(x);
            assert!(off.abs() <= allowed * libm::expm1(x).abs(), "exp_m1 {x}: {off}");
        }
        for (y, x) in [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (1.0, -1.0)] {
            assert!((atan2(y, x) - libm::atan2(y, x)).abs() < 9e-16, "atan2 {y} {x}");
        }
        assert_eq!((sqrt(0.0), sqrt(f64::INFINITY)), (0.0, f64::INFINITY));
        assert!(sqrt(-1.0).is_nan() && sqrt(f64::NAN).is_nan());
        assert!(atan2(f64::NAN, 1.0).is_nan() && exp_m1(f64::NAN).is_nan());
        assert!((exp_m1(700.0) / libm::expm1(700.0) - 1.0).abs() < 4e-13);
        assert_eq!((exp_m1(f64::INFINITY), exp_m1(0.0)), (f64::INFINITY, 0.0));
    }

    #[test]
    fn sine_and_cosine_are_those_of_libm() {
        for n in -200_000_i32..=200_000 {
            let angle = f64::from(n) * 3.141_7e-2;
            let (sin, cos) = sin_cos(angle);
            // Angles beyond a few turns come with their own rounding, up to 4.5e-13 at 6283 rad.
            let allowed = 3e-16 + 1e-19 * angle.abs();
            assert!((sin - libm::sin(angle)).abs() < allowed, "sin {angle}");
            assert!((cos - libm::cos(angle)).abs() < allowed, "cos {angle}");
        }
        for angle in [0.0, -0.0, 1e-300, FRAC_PI_2, PI, -PI, 0.25 * PI] {
            let (sin, cos) = sin_cos(angle);
            assert!(
                (sin - libm::sin(angle)).abs() < 2e-16 && (cos - libm::cos(angle)).abs() < 2e-16
            );
        }
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
    }
}
