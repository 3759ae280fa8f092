//! The lists of experiments, keys and motors.

use serde_json::json;

use crate::config::motors::Motor;
use crate::config::{Key, Value, file};
use crate::experiments::{EVERYDAY, EXPERIMENTS, WITH_INPUT};
use crate::prelude::*;

/// Lists all experiments as JSON, or as text the most used ones or the others.
///
/// # Errors
/// [`Error::Internal`] if JSON cannot be made.
pub fn experiments(as_json: bool, lab: bool) -> Result<String, Error> {
    let all = EXPERIMENTS.iter().chain(&*WITH_INPUT);
    if as_json {
        let object = |e: &Experiment| json!({ "name": e.name, "stands_for": e.stands_for, "about": e.about, "everyday": EVERYDAY.iter().any(|name| name == e.name), "uses": e.uses, "not": e.not });
        return pretty(&all.map(object).collect());
    }
    let place = |e: &&Experiment| EVERYDAY.iter().position(|name| *name == e.name);
    let mut shown: Vec<_> = all.filter(|e| place(e).is_none() == lab).collect();
    shown.sort_by_key(place);
    let mut text = String::new();
    for Experiment { name, stands_for, about, .. } in shown {
        let sourced = format!("{about} ({stands_for})");
        let about = report::paragraph(if lab { &sourced } else { about }, 4);
        text.push_str(&format!("{name}\n{about}\n\n"));
    }
    if !lab {
        text.push_str("Run one with `cargo sim run NAME`. The others repeat figures and tables of the two sources: `list --lab`.\n");
    }
    Ok(text)
}

fn pretty(value: &serde_json::Value) -> Result<String, Error> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::Internal(e.to_string()))?;
    Ok(format!("{text}\n"))
}

/// Lists the keys that begin with `prefix`, or the configuration as TOML.
///
/// # Errors
/// As [`Input::config`]; [`Error::Unknown`] if no key begins so.
pub fn keys(prefix: Option<&str>, as_toml: bool, input: &Input) -> Result<String, Error> {
    let config = input.config()?;
    let prefix = prefix.unwrap_or_default();
    // The keys of `after.` repeat the plant's, so they are shown only on request.
    let after = Key::after().filter(|_| !prefix.is_empty());
    let found: Vec<Key> =
        Key::all().chain(after).filter(|key| key.assigned_name().starts_with(prefix)).collect();
    if found.is_empty() {
        let groups = Key::all().filter_map(|key| key.name().split_once('.'));
        let known = groups.map(|(group, _)| group).chain(Key::all().map(Key::name));
        return Err(Error::unknown("key", prefix, known));
    }
    if as_toml {
        return Ok(file::toml(&config, &found));
    }
    Ok(found.into_iter().map(|key| key_text(key, &config)).collect())
}

fn key_text(key: Key, config: &Config) -> String {
    let value = match key.get(config) {
        Value::Number(number) => format!("{number} {}", key.unit()).trim_end().to_owned(),
        other => other.to_string(),
    };
    let text = format!("{}; allowed: {}", key.help(), key.allowed_text());
    format!("{} = {value}\n{}\n", key.assigned_name(), report::paragraph(&text, 4))
}

/// Lists all motors; or describes one, with sources and lines for the console.
///
/// # Errors
/// As [`Motor::find`] and [`Motor::apply`].
pub fn motors(name: Option<&str>, as_json: bool) -> Result<String, Error> {
    match (name, as_json) {
        (None, false) => Ok(report::table(&table_of_motors())),
        (None, true) => pretty(&Motor::all().iter().map(motor_json).collect()),
        (Some(name), true) => pretty(&motor_json(&Motor::find(name)?)),
        (Some(name), false) => motor_text(&Motor::find(name)?),
    }
}

fn motor_json(motor: &Motor) -> serde_json::Value {
    let settings: serde_json::Map<_, _> =
        motor.settings().into_iter().map(|(key, value)| (key, json!(value))).collect();
    json!({
        "name": motor.name,
        "title": motor.title,
        "about": motor.about.trim(),
        "settings": settings,
        "source": motor.source,
    })
}

fn table_of_motors() -> Table {
    let mut table = Table::new("", &["motor", "rated data", "numbers"]);
    for motor in Motor::all() {
        let recalled = motor.source.iter().filter(|source| source.unverified);
        let keys: Vec<_> = recalled.flat_map(|source| source.keys.clone()).collect();
        let numbers = match keys[..] {
            [] => "all with a source".to_owned(),
            _ => format!("unverified: {}", keys.join(", ")),
        };
        table.row([motor.name, motor.title, numbers].map(Cell::from));
    }
    table
}

fn motor_text(motor: &Motor) -> Result<String, Error> {
    let mut config = Config::default();
    motor.apply(&mut config)?;
    let mut table = Table::new("", &["key", "value", "unit", "source"]);
    for (key, _) in motor.settings() {
        let known = Key::named(&key)?[0];
        let source = motor.source_of(&key).map_or("no source stated".to_owned(), |source| {
            format!("{}{}", if source.unverified { "UNVERIFIED: " } else { "" }, source.from)
        });
        let value = known.get(&config).to_string();
        table.row([key, value, known.unit().to_owned(), source].map(Cell::from));
    }
    for (key, value, why) in motor.implied(&config) {
        let unit = Key::named(key)?.first().map_or("", |key| key.unit());
        table.row([key, &value, unit, why].map(Cell::from));
    }
    let Motor { name, title, about, .. } = motor;
    let about = Some(about.trim()).filter(|about| !about.is_empty());
    let about = about.map_or(String::new(), |about| format!("\n{}\n", report::paragraph(about, 0)));
    let table = report::table(&table);
    let (m, carrier) = (config.drive.motor, config.drive.carrier_v());
    let (amperes, nm) =
        (config.drive.injection_a(), config.drive.injection_nm(&config.drive.reference()));
    let percent = 100.0 * f64::from(nm) / config.rated_nm();
    let (leakage, tau_r) = (1e3 * m.sigma_l_s(), 1e3 * m.tau_r());
    let lines = motor.console_lines().join("\n");
    Ok(format!(
        "{name}: {title}\n{about}\n{table}Leakage inductance {leakage:.4} mH, rotor time constant {tau_r:.0} ms, \
         injected voltage {carrier:.1} V.\nTorque ripple of the injection at standstill: {nm:.3} Nm at 600 Hz, {percent:.0} % of the \
         rated torque, by an injection current of {amperes:.3} A peak.\n\nTo type at the console of your board:\n{lines}\n"
    ))
}
