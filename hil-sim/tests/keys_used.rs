//! Determines the keys that an experiment uses by changing each of them.

use hil_sim::config::{Config, Key, RangeKind};
use hil_sim::experiments::{Context, EXPERIMENTS, Experiment};
use hil_sim::outcome::Origin;
use hil_sim::progress::Progress;

/// Returns the numbers of a run without its texts, or the refusal.
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

/// Returns other values that a key allows.
fn others(key: Key, config: &Config) -> Vec<String> {
    let now = key.get(config);
    let Some((min, max)) = key.range() else {
        let words = key.words().iter().map(|word| (*word).to_owned());
        return words.filter(|word| *word != now.to_string()).collect();
    };
    let set = match (key.number(config), key) {
        (Some(number), _) if number != 0.0 => number,
        _ if let Some((_, sample)) = SAMPLES.iter().find(|(name, _)| *name == key.name()) => {
            *sample
        }
        (None, Key::Drive(entry)) => entry.number(&config.drive).unwrap_or(1.0).into(),
        _ if max <= 10.0 => 0.2 * max,
        _ => 0.5 * (min.max(0.0) + max.min(100.0)),
    };
    let whole = set.fract() == 0.0 && set.abs() >= 1.0;
    [1.0, 1.25, 0.3, 4.0]
        .map(|factor| (factor * set).clamp(min, max))
        .map(|value| if whole { value.round().max(1.0) } else { value })
        .into_iter()
        .filter(|value| key.number(config) != Some(*value))
        .map(|value| value.to_string())
        .collect()
}

fn short(name: &str) -> Config {
    let mut config = Config::default();
    // The stress test needs a run of each of its kinds.
    config.extent.runs = Some(match name {
        "battery" => 12,
        "full-range" => 1,
        _ => 3,
    });
    // Free shafts, all regions.
    config.full_range.kind = RangeKind::LoadSteps;
    (config.record.minutes, config.record.reversal_s) = (0.05, 1.0);
    config.extent.seconds = Some(match name {
        "demodulators" => 1.0,
        "speed-profile" | "position-step" | "torque-reversal" => 3.0,
        _ => 0.6,
    });
    config
}

/// Settings with which a key has an effect that it does not have with the defaults.
const BESIDE: [&[&str]; 11] = [
    &[],
    &["load.mode=free"],
    &["load.mode=speed", "load.speed_rpm=60"],
    &["angle_source=encoder"],
    &["injection.beside_encoder=yes"],
    &["injection.demodulator=rectified"],
    &["injection.demodulator=rms-impedance"],
    &["spread.machine=1.5"],
    &["current_plant=motor"],
    &["plant=r"],
    &["battery.runs=load"],
];

/// Keys that are used although a short undisturbed run does not show it.
const QUIET: [(&[&str], &str); 12] = [
    (&["nameplate."], "the plate of the motor, whole; the rules take some of its numbers"),
    (&["limits."], "protections: without effect until they act"),
    (&["scales.ntc."], "the simulated thermistor and the drive's are the same"),
    (&["scales.encoder_counts"], "without effect where the encoder is not looked at"),
    (&["measurement.heat_sink_c"], "without effect below the limit"),
    (
        &[
            "injection.allowed_deficit",
            "injection.deficit_s",
            "injection.tracked_rpm",
            "injection.check",
            "injection.monitor",
        ],
        "protections: without effect until they act",
    ),
    (
        &[
            "injection.full_reference_iq_a",
            "injection.reference_a",
            "injection.k_s",
            "injection.z_s",
            "injection.rms_samples",
        ],
        "of other demodulators than the default",
    ),
    (&["scales.current_c.", "scales.shunt_settle_s"], "of a board with three shunts"),
    (&["measurement.dc_lag_us"], "acts where the dc link moves"),
    (&["sequence.stop_a_per_s"], "acts at a stop"),
    (&["battery.relearn"], "acts from the second dozen of runs on, with prepare.learn"),
    (
        &["plant", "flux_level", "iron.", "warming.", "dc_link.", "shaft.", "inverter.open_phase"],
        "of the other machine model, or with an effect beside another key only",
    ),
];

/// An experiment that counts successes: few keys change a count in few runs.
const COUNTING: &str = "lock-monitor";

fn is_quiet(name: &str) -> bool {
    QUIET.iter().flat_map(|(names, _)| names.iter()).any(|quiet| name.starts_with(quiet))
}

/// Returns keys whose change has changed a result, also with one of [`BESIDE`].
fn observed(experiment: &Experiment) -> Vec<Key> {
    let mut used: Vec<Key> = Vec::new();
    for beside in BESIDE {
        let mut base = short(experiment.name);
        let set = beside.iter().map(|one| one.split_once('=').expect("KEY=VALUE"));
        let is_declared =
            |name: &str| Key::named(name).unwrap().iter().all(|key| experiment.uses_key(*key));
        if !set.clone().all(|(name, _)| is_declared(name)) {
            continue;
        }
        set.for_each(|(name, value)| base.set(name, value).expect("a key"));
        let default = result(experiment, &base);
        for key in Key::all() {
            let pending = !used.iter().any(|known| known.name() == key.name() && known.assigned_name() == key.assigned_name())
                // With other settings, only the keys that are still missing.
                && (beside.is_empty() || (experiment.uses_key(key) && !is_quiet(key.name())));
            let changes = |value: String| {
                let mut config = base.clone();
                config.set(&key.assigned_name(), &value).is_ok()
                    && result(experiment, &config) != default
            };
            if pending && others(key, &base).into_iter().any(changes) {
                used.push(key);
            }
        }
    }
    used
}

/// Returns the experiments that `ONLY` selects; all without it.
fn chosen() -> impl Iterator<Item = &'static Experiment> {
    let only = std::env::var("ONLY").unwrap_or_default();
    EXPERIMENTS.iter().filter(move |experiment| {
        let chosen = only.split(',').any(|name| name == experiment.name);
        chosen || only.is_empty()
    })
}

#[test]
#[ignore = "half an hour"]
fn each_experiment_uses_the_keys_it_declares_and_no_others() {
    let mut wrong = Vec::new();
    for experiment in chosen() {
        let used: Vec<String> = observed(experiment).into_iter().map(Key::assigned_name).collect();
        for key in Key::all() {
            let name = key.assigned_name();
            match (experiment.uses_key(key), used.contains(&name)) {
                (true, false) if !is_quiet(key.name()) && experiment.name != COUNTING => {
                    wrong.push(format!(
                        "{}: {name} is declared, but changes nothing",
                        experiment.name
                    ));
                }
                (false, true) => {
                    wrong.push(format!("{}: {name} is not declared, but used", experiment.name));
                }
                _ => {}
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
