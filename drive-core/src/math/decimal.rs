//! Numbers as text, without the tables of the core library: its printing of floating-point numbers
//! takes 10 KiB of the microcontroller.

use core::fmt::{self, Write};

/// Prints an `f32` with as few digits as it takes to read it back, nine at most, without a power of
/// ten.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shortest(pub f32);

/// Prints an `f32` with `N` digits after the point; from 10^9 on like [`Shortest`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed<const N: u32>(pub f32);

/// Most digits that an `f32` needs.
const DIGITS: i32 = 9;

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0.abs();
        sign(self.0, f)?;
        if !value.is_finite() {
            return f.write_str(if value.is_nan() { "NaN" } else { "inf" });
        }
        if value == 0.0 {
            return f.write_char('0');
        }
        let wide = f64::from(value);
        // The power of ten of the first digit.
        let mut exponent = 0;
        while wide >= power_of_ten(exponent + 1) {
            exponent += 1;
        }
        while wide < power_of_ten(exponent) {
            exponent -= 1;
        }
        let (mut digits, mut last) = (0, exponent);
        for count in 0..DIGITS {
            last = exponent - count;
            // Of powers that are not exact, the error (1e-15) is far below half of the last digit.
            digits = (wide / power_of_ten(last) + 0.5) as u32;
            if (f64::from(digits) * power_of_ten(last)) as f32 == value {
                break;
            }
        }
        // Rounding up may have carried to one more digit.
        while digits > 0 && digits.is_multiple_of(10) {
            (digits, last) = (digits / 10, last + 1);
        }
        plain(digits, last, f)
    }
}

impl<const N: u32> fmt::Display for Fixed<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fixed(self.0, N as i32, f)
    }
}

/// `N` is no parameter of this one, so that it is there only once.
fn fixed(value: f32, places: i32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let scaled = f64::from(value.abs()) * power_of_ten(places);
    // Not-a-number fails the test.
    if scaled < 1e9 {
        sign(value, f)?;
        plain((scaled + 0.5) as u32, -places, f)
    } else {
        write!(f, "{}", Shortest(value))
    }
}

fn sign(value: f32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if value.is_sign_negative() && !value.is_nan() { f.write_char('-') } else { Ok(()) }
}

fn power_of_ten(exponent: i32) -> f64 {
    let power = (0..exponent.unsigned_abs()).fold(1.0, |power, _| power * 10.0);
    if exponent < 0 { 1.0 / power } else { power }
}

/// `digits` times ten to the power of `last`.
fn plain(digits: u32, last: i32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    // From the highest place that has a digit, or from the ones.
    let mut place = last;
    let mut rest = digits;
    while rest >= 10 {
        rest /= 10;
        place += 1;
    }
    if place < 0 {
        place = 0;
    }
    loop {
        let digit = match u32::try_from(place - last) {
            // Ten digits at most: 10^9 fits, what lies above it is 0.
            Ok(above) => 10_u32.checked_pow(above).map_or(0, |power| digits / power % 10),
            Err(_) => 0,
        };
        f.write_char(char::from(b'0' + digit as u8))?;
        if place <= 0 && place <= last {
            return Ok(());
        }
        if place == 0 {
            f.write_char('.')?;
        }
        place -= 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_are_printed_as_the_core_library_does() {
        for value in [
            0.0,
            -0.0,
            1.0,
            -1.5,
            0.1,
            0.001,
            1000.0,
            123_456.79,
            5.4,
            1e-7,
            2.9171903,
            16_777_216.0,
            3.4e38,
            1e-38,
            0.98,
            14_167.0,
        ] {
            assert_eq!(Shortest(value).to_string(), value.to_string());
            if value < 1e7 {
                assert_eq!(Fixed::<2>(value).to_string(), format!("{value:.2}"), "{value}");
            }
        }
        assert_eq!(Shortest(f32::NAN).to_string(), "NaN");
        assert_eq!(Shortest(f32::NEG_INFINITY).to_string(), "-inf");
        assert_eq!(Fixed::<2>(f32::NAN).to_string(), "NaN");
        assert_eq!(Fixed::<0>(1.4).to_string(), "1");
        assert_eq!(Fixed::<4>(-0.000_04).to_string(), "-0.0000");
    }

    proptest! {
        #[test]
        fn what_is_printed_is_read_back(bits: u32) {
            let value = f32::from_bits(bits);
            prop_assume!(value.is_finite());
            let text = Shortest(value).to_string();
            prop_assert_eq!(text.parse(), Ok(value));
            // At a power of two one digit more may come out.
            prop_assert!(text.len() <= value.to_string().len() + 1, "{}", text);
        }

        #[test]
        fn digits_after_the_point_are_rounded_from_the_value(value in -1e5_f32..1e5) {
            let printed: f64 = Fixed::<3>(value).to_string().parse().unwrap();
            prop_assert!((printed - f64::from(value)).abs() <= 0.000_5 + 1e-9);
        }
    }
}
