//! Old names of keys. They stay accepted.

use super::Value;

/// An old name, the name of today, and the value of today.
struct Alias {
    old: &'static str,
    name: &'static str,
    value: fn(&Value) -> Value,
}

const fn renamed(old: &'static str, name: &'static str) -> Alias {
    Alias { old, name, value: Value::clone }
}

static ALIASES: [Alias; 16] = [
    renamed("motor.rs", "motor.r_s"),
    renamed("motor.rr", "motor.r_r"),
    renamed("motor.lls", "motor.l_ls"),
    renamed("motor.llr", "motor.l_lr"),
    renamed("motor.lm", "motor.l_m"),
    renamed("drive.motor.rs", "drive.motor.r_s"),
    renamed("drive.motor.rr", "drive.motor.r_r"),
    renamed("drive.motor.lls", "drive.motor.l_ls"),
    renamed("drive.motor.llr", "drive.motor.l_lr"),
    renamed("drive.motor.lm", "drive.motor.l_m"),
    renamed("inverter.vdc", "inverter.dc_link_v"),
    Alias { old: "inverter.dead_time_us", name: "inverter.dead_time_s", value: micro },
    renamed("angle.source", "angle_source"),
    Alias { old: "angle.compensate_delays", name: "ignore_delays", value: negated },
    renamed("reference.id_a", "sequence.i_d"),
    renamed("drive.learn", "prepare.learn"),
];

/// The name of today for a name, and the value for a value.
pub fn today(name: &str, value: &Value) -> (String, Value) {
    match ALIASES.iter().find(|alias| alias.old == name) {
        Some(alias) => (alias.name.to_owned(), (alias.value)(value)),
        None => (name.to_owned(), value.clone()),
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
