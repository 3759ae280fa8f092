//! The largest torque of each motor in percent of its rated torque, as the page of the motors prints it.

use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::error::Error;
use hil_sim::experiments::torque_limit::{TorqueLimit, learned_limit};

use crate::generated;

fn limit(motor: &str, set: &[&str]) -> (Config, TorqueLimit) {
    let (config, limit) = learned(motor, set);
    (config, limit.unwrap_or_else(|e| panic!("{motor}: {e}")))
}

fn learned(motor: &str, set: &[&str]) -> (Config, Result<TorqueLimit, Error>) {
    let config = Config::load(Some(motor), None, set).expect("allowed settings");
    let limit = learned_limit(&config, 1).map(|(_, limit)| limit);
    (config, limit)
}

/// Names the limiting factor in a word.
fn word(limit: &TorqueLimit) -> &'static str {
    if limit.binds.contains("slope") {
        "slope"
    } else if limit.binds.contains("last learned") {
        "last point"
    } else if limit.binds.contains("range_a") {
        "sensors"
    } else {
        "limit"
    }
}

/// The table of the page is made from drives that have learned, on model A and on the saturation models with teeth.
#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn the_page_prints_the_torque_limits() {
    let first = concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md");
    let first = std::fs::read_to_string(first).expect("the page");
    let first = first.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut others = Vec::new();
    let mut table =
        "| name | rated | `a` | `r` | `r5` | `g7` |\n|---|---|---|---|---|---|\n".to_owned();
    for motor in Motor::all() {
        let name = &motor.name;
        let (config, on_a) = limit(name, &[]);
        let cells = ["plant=r", "plant=r5", "plant=g7"].map(|plant| {
            match learned(name, &[plant, "flux_level=high"]).1 {
                Ok(limit) => format!("{:.0} %, {}", limit.percent, word(&limit)),
                Err(error) => error.to_string().replace("the drive does not learn: ", ""),
            }
        });
        let row = format!(
            "| `{name}` | {:.1} Nm | {:.0} %, {} | {} |",
            config.rated_nm(),
            on_a.percent,
            word(&on_a),
            cells.join(" | ")
        );
        table += &(row + "\n");
        if name == "dissertation" {
            let (_, high) = limit(name, &["sequence.flux=high"]);
            let sentence = format!(
                "gives {:.2} Nm at rest, {:.0} % of its rated torque, if the drive keeps the [low flux](docs/control-law.md#flux-level) that the dissertation uses. With `sequence.flux=high` it gives {:.2} Nm, {:.0} % of its rated torque",
                on_a.nm, on_a.percent, high.nm, high.percent
            );
            assert!(first.contains(&sentence), "README.md: {sentence}");
        } else {
            others.push(on_a.percent);
        }
    }
    let least = others.iter().copied().fold(f64::MAX, f64::min);
    let most = others.iter().copied().fold(0.0, f64::max);
    assert!(most - least < 1.0, "one number is enough for all: {others:?}");
    let sentence = format!(
        "[Other motors](docs/performance.md#torque-at-standstill) reach up to {least:.0} % of their rated torque,"
    );
    assert!(first.contains(&sentence), "README.md: {sentence}");
    generated::check("performance.md", "torque", &table);
}

/// 3/2 P L_m^2/L_r i_d i_q, compared with power and speed of the nameplate: the default motor takes 2.25 A at 0.7 A
/// with the learned limit, 0.724 Nm of 6.107 Nm. A larger magnetising current is the first remedy while it is below
/// that of rated flux and current. The limiting factor is named: here the learned saliency sensitivity, at 2 A of
/// magnetising current the current limit.
#[test]
fn a_limit_says_what_binds_and_what_raises_it() {
    let (config, low) = limit("dissertation", &[]);
    let nm = 1.5 * 2.0 * 0.1771 * 0.1771 / 0.2047 * 0.7 * low.i_q;
    assert!((low.nm / nm - 1.0).abs() < 1e-3 && (2.0..2.8).contains(&low.i_q), "{low:?}");
    assert!((low.percent - 100.0 * nm / 6.107).abs() < 0.05, "{low:?}");
    assert!(low.more.contains("sequence.flux=high"), "{low:?}");
    let text = low.text(&config);
    for part in ["Nm", "% of the rated torque of 6.1 Nm", "Limited by: ", "More: "] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let sensors = TorqueLimit::new(&config, (3.5_f64.powi(2) - 0.7 * 0.7).sqrt());
    assert!(sensors.binds.contains("`limits.current_a`"), "{sensors:?}");
    let mut small = config.clone();
    small.set("measurement.range_a", 3.0).unwrap();
    let limit_a = f64::from(small.drive.current_limit_a());
    let by_range = TorqueLimit::new(&small, (limit_a * limit_a - 0.49).sqrt());
    assert!(by_range.binds.contains("`measurement.range_a`"), "{by_range:?}");
    // The limit of the speed loop does not limit torque commands: with a third of it the drive accepts the same
    // current, if the saliency sensitivity allows all of it.
    let (_, last) = limit("rewound-48v", &[]);
    let (_, third) = limit("rewound-48v", &["speed.i_q_limit_a=3"]);
    assert!(last.binds.contains("`limits.current_a`"), "{last:?}");
    assert_eq!(last, third);
}
