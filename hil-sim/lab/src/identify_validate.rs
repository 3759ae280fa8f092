//! Measured against simulated current, with estimated and with classical parameters: Figure 5 and Tables 6 and 7 of
//! Jacobina, Lima, Ribeiro 1996.

use crate::identification::printed::Case;
use crate::identification::study::errors;
use crate::identification::{Noise, Parameters, Signal, Trial, model_c};
use crate::prelude::*;

const H: f64 = 50e-6;

/// Returns a printed row of a table.
fn printed(table: &str, row: &str) -> Parameters {
    let of = |name| source::number("S0", &format!("{table}, {row}"), name);
    Parameters::of(Parameters::NAMES.map(of))
}
/// Measured speeds, electrical rad/s.
const SPEEDS: [f64; 2] = [366.0, 57.6];

/// Runs the experiment: Figure 5, Tables 6 and 7.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    for (table, speed) in [("Table 6", SPEEDS[0]), ("Table 7", SPEEDS[1])] {
        let machine = printed(table, "Ss").at(speed);
        let data = |signal| Trial::printed(machine, signal, H, Noise::TENTH).run(context.seed, 0);
        let [by_sg, by_ss] = Signal::ALL.map(|signal| data(signal).regression());
        let (by_sg, by_ss) = (by_sg.map_err(Error::refused)?, by_ss.map_err(Error::refused)?);
        let sg = model_c(&by_sg.delta, H).array();
        for (k, name) in Parameters::NAMES.into_iter().enumerate() {
            let [of_sg, of_ss] = ["Sg", "Ss"].map(|row| {
                Compared::with("S0", format!("{table}, {row}"), name).unknown("what was measured")
            });
            outcome.compared.extend(sg[k].ok().map(|value| of_sg.simulated(value)));
            // The values of the simulated machine itself.
            outcome.compared.push(of_ss);
            if k < 4 {
                let place = Compared::with("S0", format!("{table}, rbv"), name);
                outcome.compared.push(place.used(Parameters::RBV.array()[k]));
            }
        }
        outcome.compared.push(Compared::with("S0", table, "speed").used(speed));
        if speed == SPEEDS[0] {
            // Figure 5 uses the estimate with S_s.
            let estimated = model_c(&by_ss.delta, H).parameters().map_err(Error::refused)?;
            figure_5(&machine, &estimated.at(speed), &mut outcome);
        }
    }
    let error =
        |key: &str| outcome.metrics.get(&format!("current_error_{key}_pct")).unwrap_or(f64::NAN);
    let [estimated, rbv] = ["estimated", "rbv"].map(error);
    outcome.compared.extend([
        named("small_error").simulated(estimated < 5.0),
        named("much_smaller_error").simulated(estimated < 0.3 * rbv),
    ]);
    // Error of tau_r on such a machine with the printed noise, which is ten times that of a real ADC.
    let [sg, ss] = Signal::ALL.map(|signal| {
        let case = Case { speed: 375.0, signal, period: 0 };
        errors(Parameters::RBV, case, Noise::PRINTED, context.seed, 7).continuous[1][1]
    });
    outcome.metrics.set("tau_r_error_of_rbv_sg_printed_noise_pct", sg);
    outcome.metrics.set("tau_r_error_of_rbv_ss_printed_noise_pct", ss);
    texts::add_remarks(&mut outcome, "identify-validate", &[]);
    Ok(outcome)
}

/// Current of the d axis: of the machine, and simulated with the same voltage and speed.
fn figure_5(machine: &Parameters, estimated: &Parameters, outcome: &mut Outcome) {
    let current = |p: &Parameters| -> Vec<Complex64> {
        let trial = Trial::printed(*p, Signal::SixStep, H, Noise::NONE);
        trial.raw().skip(20_000).take(1000).map(|sample| sample.1).collect()
    };
    let measured = current(machine);
    let mut figure = texts::figure("identify-validate", "currents");
    let rms = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let scale = rms(&mut measured.iter().map(|i| i.re));
    for (name, key, p) in [
        ("estimated parameters", "estimated", *estimated),
        ("rbv parameters", "rbv", Parameters::RBV.at(machine.omega_m)),
    ] {
        let simulated = current(&p);
        let error = rms(&mut measured.iter().zip(&simulated).map(|(a, b)| a.re - b.re)) / scale;
        outcome.metrics.set(format!("current_error_{key}_pct"), 100.0 * error);
        let points = |of: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
            (0..measured.len()).map(|n| (n as f64 * H, of(n))).collect()
        };
        let panel = Panel::new("time (s)", format!("i_d, {name} (A)"))
            .with(Series::reference("machine", points(&|n| measured[n].re)))
            .with(Series::line("simulated", points(&|n| simulated[n].re)))
            .with(Series::line("error", points(&|n| measured[n].re - simulated[n].re)));
        figure = figure.panel(panel);
    }
    outcome.figures.push(figure);
}
