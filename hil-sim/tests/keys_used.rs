//! Which keys an experiment uses, found by changing each of them.

use hil_sim::config::{Allowed, Config, Key, Value};
use hil_sim::experiments::{Context, EXPERIMENTS, Experiment};
use hil_sim::outcome::Origin;
use hil_sim::progress::Progress;

/// Numbers of a run without its texts; or the refusal.
fn result(experiment: &Experiment, config: &Config) -> Result<serde_json::Value, String> {
    let seconds = config.extent.seconds;
    let context = Context { config, seed: 1, seconds, progress: Progress::hidden(), file: None };
    let outcome = (experiment.run)(&context).map_err(|error| error.to_string())?;
    let text = outcome.to_json("", &Origin::default()).expect("JSON");
    let mut object: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    object.as_object_mut().expect("an object").remove("remarks");
    Ok(object)
}

/// Values for keys that follow a rule or are zero unless they are set.
const SAMPLES: [(&str, f64); 12] = [
    ("saliency.b1", 0.02),
    ("saliency.hold_a", 0.4),
    ("saliency.psi_n", 0.1),
    ("inverter.residual_v", 4.0),
    ("measurement.noise_a", 0.01),
    ("measurement.lsb_a", 0.004),
    ("measurement.dc_link_range_v", 600.0),
    ("load.torque_nm", 0.3),
    ("load.speed_rpm", 40.0),
    ("reference.iq_a", 0.7),
    ("runs", 4.0),
    ("seconds", 0.5),
];

/// Other values that a key allows.
fn others(key: Key, config: &Config) -> Vec<Value> {
    let set = match key.get(config) {
        Value::Number(value) if value != 0.0 => value,
        Value::Switch(on) => return vec![Value::Switch(!on)],
        Value::Word(word) if word != "auto" => {
            let Allowed::Words(words) = key.allowed() else { return Vec::new() };
            let others = words.iter().filter(|other| **other != word);
            return others.map(|other| Value::Word((*other).to_owned())).collect();
        }
        value => {
            let sample = SAMPLES.iter().find(|(name, _)| *name == key.name());
            match (sample, key, value) {
                (Some((_, sample)), ..) => *sample,
                (_, Key::Drive(entry), Value::Word(_)) => {
                    entry.number(&config.drive).unwrap_or(1.0).into()
                }
                _ => match key.allowed() {
                    Allowed::Range { max, .. } if max <= 10.0 => 0.2 * max,
                    Allowed::Range { min, max } => 0.5 * (min.max(0.0) + max.min(100.0)),
                    _ => return Vec::new(),
                },
            }
        }
    };
    let Allowed::Range { min, max } = key.allowed() else { return Vec::new() };
    let whole = set.fract() == 0.0 && set.abs() >= 1.0;
    [1.0, 1.25, 0.3, 4.0]
        .map(|factor| (factor * set).clamp(min, max))
        .map(|value| Value::Number(if whole { value.round().max(1.0) } else { value }))
        .into_iter()
        .filter(|value| *value != key.get(config))
        .collect()
}

fn short(name: &str) -> Config {
    let mut config = Config::default();
    config.extent.runs = Some(3);
    config.extent.seconds = Some(match name {
        "demodulators" => 1.0,
        "speed-profile" | "position-step" | "torque-reversal" => 3.0,
        _ => 0.6,
    });
    config
}

#[test]
#[ignore = "long"]
fn observed() {
    let only = std::env::var("ONLY").unwrap_or_default();
    for experiment in EXPERIMENTS {
        if !only.is_empty() && !only.split(',').any(|name| name == experiment.name) {
            continue;
        }
        let base = short(experiment.name);
        let default = result(experiment, &base);
        let mut used = Vec::new();
        for key in Key::all() {
            let changes = others(key, &base).into_iter().any(|value| {
                let mut config = base.clone();
                config.set(&key.assigned_name(), &value).is_ok()
                    && result(experiment, &config) != default
            });
            if changes {
                used.push(key.assigned_name());
            }
        }
        println!("{} {} {}", experiment.name, default.is_ok(), used.join(" "));
    }
}
