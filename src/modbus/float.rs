//! Settings as floats of 32 bits: their ranges depend on other settings, so no fixed scale would fit them all.

use drive_settings::value::Value;
use modbus_core::Exception;

use crate::settings::FirmwareSettings;
use crate::settings::keys::Key;

/// A setting as the float in its registers: `auto` is NaN, a word is its place in the list, from 0.
pub fn to_float(key: Key, settings: &FirmwareSettings) -> f32 {
    match key.get(settings) {
        Value::Number(value) => value,
        Value::Auto => f32::NAN,
        Value::Whole(value) => value as f32,
        Value::Word(word) => {
            key.words().iter().position(|known| *known == word).unwrap_or(0) as f32
        }
    }
}

/// The value of a setting for a float in its registers.
///
/// # Errors
/// [`Exception::IllegalDataValue`]. The range is checked when the value is staged.
pub fn from_float(key: Key, settings: &FirmwareSettings, float: f32) -> Result<Value, Exception> {
    // The casts saturate, and the way back reveals a fraction.
    let whole = float as u32;
    let is_whole = whole as f32 == float;
    match key.get(settings) {
        Value::Number(_) | Value::Auto if float.is_finite() => Ok(Value::Number(float)),
        Value::Number(_) | Value::Auto if float.is_nan() && key.has_rule() => Ok(Value::Auto),
        Value::Whole(_) if is_whole => Ok(Value::Whole(whole)),
        Value::Word(_) if is_whole => {
            let word = key.words().get(whole as usize);
            word.map(|word| Value::Word(word)).ok_or(Exception::IllegalDataValue)
        }
        _ => Err(Exception::IllegalDataValue),
    }
}
