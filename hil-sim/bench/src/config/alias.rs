//! Old names of keys, which stay accepted.

use drive_settings::renamed::RENAMED;

use super::{DRIVE, Value};

/// Old names, the current names, and the conversion to the current value.
type Alias = (&'static str, &'static str, fn(&Value) -> Value);

static ALIASES: [Alias; 11] = [
    ("motor.rs", "motor.r_s", Value::clone),
    ("motor.rr", "motor.r_r", Value::clone),
    ("motor.lls", "motor.l_ls", Value::clone),
    ("motor.llr", "motor.l_lr", Value::clone),
    ("motor.lm", "motor.l_m", Value::clone),
    ("inverter.vdc", "inverter.dc_link_v", Value::clone),
    ("inverter.dead_time_us", "inverter.dead_time_s", micro),
    ("angle.source", "angle_source", Value::clone),
    ("angle.compensate_delays", "ignore_delays", negated),
    ("reference.id_a", "sequence.i_d", Value::clone),
    ("drive.learn", "prepare.learn", Value::clone),
];

/// Converts a name to its current name, and its value to the current value.
pub fn today(name: &str, value: &Value) -> (String, Value) {
    // The drive has the names of the motor as well.
    let of_drive = name.starts_with("drive.motor.");
    let (prefix, bare) = name.split_at(if of_drive { DRIVE.len() } else { 0 });
    match ALIASES.iter().find(|(old, ..)| *old == bare) {
        Some((_, today, of)) => (format!("{prefix}{today}"), of(value)),
        None => {
            let now = RENAMED.iter().find(|(_, old)| *old == bare).map_or(bare, |(now, _)| now);
            (format!("{prefix}{now}"), value.clone())
        }
    }
}

fn micro(value: &Value) -> Value {
    match value {
        Value::Number(us) => Value::Number(us * 1e-6),
        other => other.clone(),
    }
}

fn negated(value: &Value) -> Value {
    match value {
        Value::Switch(on) => Value::Switch(!on),
        other => other.clone(),
    }
}
