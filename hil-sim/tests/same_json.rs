//! Every experiment prints the same JSON as another build of the program, to the last digit. This is the check for a
//! change that moves experiments and must not change a number.
//!
//! ```text
//! OLD=PATH cargo test --release -p hil-sim same_json -- --ignored --nocapture
//! ```
//!
//! `OLD` is the program as built before the change, `ONLY` a part of the names of the experiments. The tables below
//! list experiments and keys that got another name; an experiment that is not in `OLD` is not compared.

use std::env;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Renamed or removed experiments: the old name, and the new one.
const RENAMED: &[(&str, Option<&str>)] = &[];
/// Renamed keys of the results: the experiment, the old name, and the new one.
const KEYS: &[(&str, &str, &str)] = &[];

/// Settings that make an experiment short.
const SHORT: &[(&str, &[&str])] = &[
    ("battery", &["runs=12"]),
    ("commission", &["runs=4"]),
    ("commission-refusals", &["runs=2"]),
    ("foreign-motors", &["runs=3"]),
    ("full-range", &["runs=1"]),
    ("lock-monitor", &["runs=8"]),
    ("monte-carlo", &["runs=12"]),
    ("record", &["record.minutes=0.1", "record.reversal_s=5"]),
];

/// Returns the result of an experiment of this name from a program.
fn result(program: &Path, name: &str) -> Value {
    let short = SHORT.iter().find(|(known, _)| *known == name).map_or(&[][..], |(_, set)| set);
    let mut command = Command::new(program);
    command.args(["run", name, "--json", "--quiet", "--seed", "5"]);
    for set in short {
        command.args(["--set", set]);
    }
    // Experiments with a user's input file get one.
    if name == "profile" {
        command.args(["--input", &format!("{}/examples/profile.csv", env!("CARGO_MANIFEST_DIR"))]);
    }
    let output = command.output().expect("the program runs");
    let text = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{name}: {error}: {text}"))
}

/// Returns the names of the experiments of a program.
fn names(program: &Path) -> Vec<String> {
    let output = Command::new(program).args(["list", "--json"]).output().expect("it runs");
    let list: Vec<Value> = serde_json::from_slice(&output.stdout).expect("a JSON list");
    let names = list.iter().filter_map(|experiment| experiment["name"].as_str());
    names.map(str::to_owned).collect()
}

/// Returns the first difference of two values, with both values.
pub fn difference(at: &str, now: &Value, then: &Value) -> Option<String> {
    match (now, then) {
        (Value::Object(now), Value::Object(then)) => {
            now.keys().chain(then.keys()).find_map(|key| {
                let [now, then] = [now, then].map(|map| map.get(key).unwrap_or(&Value::Null));
                difference(&format!("{at}.{key}"), now, then)
            })
        }
        (Value::Array(now), Value::Array(then)) if now.len() == then.len() => {
            let mut pairs = now.iter().zip(then).enumerate();
            pairs.find_map(|(n, (now, then))| difference(&format!("{at}[{n}]"), now, then))
        }
        _ if now == then => None,
        _ => {
            let short = |value: &Value| value.to_string().chars().take(200).collect::<String>();
            Some(format!("{at}: {} instead of {}", short(now), short(then)))
        }
    }
}

/// Returns the old result with the present keys.
fn renamed(name: &str, value: Value) -> Value {
    match value {
        Value::Object(map) => map
            .into_iter()
            .map(|(key, value)| {
                let of_today = KEYS.iter().find(|(of, old, _)| *of == name && *old == key);
                (of_today.map_or(key, |(_, _, new)| (*new).to_owned()), renamed(name, value))
            })
            .collect(),
        Value::Array(list) => list.into_iter().map(|value| renamed(name, value)).collect(),
        other => other,
    }
}

#[test]
#[ignore = "it compares with another build"]
fn every_experiment_prints_what_the_other_build_prints() {
    let old = env::var("OLD").expect("OLD is the path of the other build");
    let (old, now) = (Path::new(&old), Path::new(env!("CARGO_BIN_EXE_hil-sim")));
    let only = env::var("ONLY").unwrap_or_default();
    let mut differ = Vec::new();
    for name in names(old).iter().filter(|name| name.contains(&only)) {
        let today = RENAMED.iter().find(|(known, _)| known == name).map(|(_, new)| *new);
        let Some(today) = today.unwrap_or(Some(name)) else { continue };
        let began = std::time::Instant::now();
        let found = difference(name, &result(now, today), &renamed(name, result(old, name)));
        println!("{name}: {:.1} s", began.elapsed().as_secs_f64());
        differ.extend(found);
    }
    assert!(differ.is_empty(), "{}", differ.join("\n"));
}
