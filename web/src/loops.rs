//! The figures of the control loops that the drive designs for its settings.

use std::f64::consts::TAU;

use drive_settings::tuning::{Margins, TuningError};
use drive_settings::{SETTINGS, Settings};
use serde_json::{Value, json};

/// The loops for the settings of these lines of `describe`, staged ones included: name, crossover, Hz, phase margin, degrees, peak
/// of the sensitivity, gains; or the rule that cannot be met.
pub fn of(described: &[String]) -> Value {
    let mut settings = Settings::default();
    for object in described.iter().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
        let text = object["value"].as_str().map_or(object["value"].to_string(), str::to_owned);
        let entry = SETTINGS.iter().find(|entry| object["name"] == entry.name);
        if let Some((entry, value)) = entry.and_then(|e| Some((e, e.parse(&text).ok()?))) {
            entry.set(&mut settings, value);
        }
    }
    figures(&settings).unwrap_or_else(|why| json!({ "error": why.to_string() }))
}

fn figures(settings: &Settings) -> Result<Value, TuningError> {
    let row =
        |name, m: &Margins, gains| json!([name, m.crossover_hz, m.phase_margin_deg, m.ms, gains]);
    let [d, q] = settings.current_loops()?;
    let motion = settings.motion_loops()?;
    let gains = &motion.gains;
    let pi = |k: f64, unit: &str, z: f64| format!("{k:.4} {unit}, zero at {z:.4}");
    let speed = Margins::of(&|omega_t| motion.open_loop(omega_t), 2, gains.period_s);
    let mut rows = vec![
        row("current d", &d.margins, pi(d.k_c, "V/A", d.z_c)),
        row("current q", &q.margins, pi(q.k_c, "V/A", q.z_c)),
    ];
    rows.extend(speed.map(|m| row("speed", &m, pi(gains.k_c, "A s per turn", gains.z_c))));
    let position = format!("{:.4} turns/s per turn", gains.k_x);
    rows.push(json!(["position", gains.k_x / TAU, null, null, position]));
    Ok(rows.into())
}
