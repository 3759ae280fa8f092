//! Numbers in JSON that are read back to the bit. JSON has no word for a number that is not finite: it becomes a text,
//! `NaN`, `inf` or `-inf`.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serializer};

/// For `#[serde(with)]`.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.serialize_str(&value.to_string())
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Number(f64),
    Text(String),
}

/// For `#[serde(with)]`.
///
/// # Errors
/// Those of the deserializer; a text that is no number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    match Written::deserialize(deserializer)? {
        Written::Number(number) => Ok(number),
        Written::Text(text) => text.parse().map_err(D::Error::custom),
    }
}

#[cfg(test)]
mod tests {
    use crate::stats::Stats;

    /// Numbers whose shortest decimal form a careless parser reads one bit off, and numbers that JSON does not have.
    #[test]
    fn statistics_are_read_back_to_the_bit() {
        let hard = [0.1 + 0.2, 1.0 / 3.0, 5e-324, 1.797_693_134_862_315_7e308, -0.0, 2.5e-310];
        let mut seed = 1_u64;
        let random = std::iter::repeat_with(|| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            f64::from_bits(seed)
        });
        for value in hard.into_iter().chain(random.take(2000)) {
            let stats = Stats { count: 3, sum: value, squares: f64::NAN, largest: f64::INFINITY };
            let text = serde_json::to_string(&stats).unwrap();
            let back: Stats = serde_json::from_str(&text).unwrap();
            let is_same =
                back.sum.to_bits() == value.to_bits() || value.is_nan() && back.sum.is_nan();
            assert!(is_same, "{text}");
            assert!(back.squares.is_nan() && back.largest == f64::INFINITY);
        }
    }
}
