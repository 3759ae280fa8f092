//! The tests that led to Table 5, on the simulated motor.

use crate::identification::bench_tests::{Readings, Shaft, measure};
use crate::prelude::*;

/// Runs the experiment: Section 3.6, Table 5.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let plant = plant_settings(context.config);
    let on_the_bench = |shaft| {
        measure(&plant.machine, &plant.saliency, &plant.mechanics, shaft).map_err(Error::refused)
    };
    let (readings, free) = (on_the_bench(Shaft::Driven)?, on_the_bench(Shaft::Free)?);
    let mut outcome = Outcome::default();
    let values = |m: MachineSettings| [m.rs, m.rr, m.lls, m.llr, m.lm];
    let names = [("r_s", "ohm"), ("r_r", "ohm"), ("l_l1", "h"), ("l_l2", "h"), ("l_m", "h")];
    let found = values(readings.as_printed()).into_iter().zip(values(readings.exact()));
    for ((name, unit), (printed, exact)) in names.into_iter().zip(found) {
        outcome.metrics.set(format!("{name}_as_printed_{unit}"), printed);
        outcome.metrics.set(format!("{name}_exact_{unit}"), exact);
    }
    let [r_s, r_r, leakage, _, l_m] = values(readings.as_printed());
    for (place, quantity, value) in [
        ("section 3.6.1", "voltage", readings.dc.0),
        ("section 3.6.1", "r_s", r_s),
        ("section 3.6.2", "phase voltage", readings.locked.1),
        ("section 3.6.2", "theta_rb", readings.locked.3),
        ("section 3.6.2", "|z_rb|", readings.locked_impedance().norm()),
        ("Eq. 3.17", "R_rb", readings.locked_impedance().re),
        ("Eq. 3.17", "X_rb", readings.locked_impedance().im),
        ("section 3.6.2", "r_r", r_r),
        ("section 3.6.2", "L_l1 = L_l2", 1e3 * leakage),
        ("section 3.6.3", "phase current", 1e3 * readings.no_load.2),
        ("section 3.6.3", "|z_ev|", readings.no_load_impedance()),
        ("section 3.6.3", "L_m", 1e3 * l_m),
    ] {
        outcome.compared.push(beside(place, quantity).simulated(value));
    }
    outcome.metrics.set("r_r_of_printed_readings_ohm", Readings::printed().exact().rr);
    let bias = readings.as_printed().rr / plant.machine.rr;
    let low = 1.0 - free.as_printed().lm / readings.as_printed().lm;
    let values = [
        ("bias", bias),
        ("friction", plant.mechanics.friction),
        ("free_a", free.no_load.2),
        ("driven_a", readings.no_load.2),
        ("low_percent", 100.0 * low),
    ];
    texts::add_remarks(&mut outcome, "motor-tests", &values);
    Ok(outcome)
}
