//! Numbers with a fixed count of significant digits.

use core::fmt;

/// Most digits after the point: enough for nanoamperes.
const MOST_DECIMALS: usize = 9;

/// A number, and how many of its digits are shown; without exponent, and with at most nine digits after the point.
pub struct Significant(pub f32, pub usize);

impl fmt::Display for Significant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, digits) = *self;
        let (mut decimals, mut rest) = (digits.saturating_sub(1), value.abs());
        if rest == 0.0 || !rest.is_finite() {
            return write!(f, "{value:.0}");
        }
        while rest >= 10.0 && decimals > 0 {
            (rest, decimals) = (rest / 10.0, decimals - 1);
        }
        while rest < 1.0 && decimals < MOST_DECIMALS {
            (rest, decimals) = (rest * 10.0, decimals + 1);
        }
        write!(f, "{value:.decimals$}")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn digits_count_from_the_first() {
        for (value, digits, text) in [
            (3.429_285_8, 4, "3.429"),
            (0.001_234_567, 6, "0.00123457"),
            (-1234.56, 4, "-1235"),
            (12.0, 3, "12.0"),
            (0.0, 6, "0"),
            (1e-12, 6, "0.000000000"),
        ] {
            assert_eq!(Significant(value, digits).to_string(), text);
        }
    }

    proptest! {
        #[test]
        fn six_digits_are_within_a_part_in_two_hundred_thousand(value in -1e6_f32..1e6) {
            prop_assume!(value.abs() > 1e-3);
            let shown: f32 = Significant(value, 6).to_string().parse().unwrap();
            prop_assert!((shown / value - 1.0).abs() < 5e-6, "{} for {}", shown, value);
        }
    }
}
