//! Measured against simulated current, with estimated and with classical parameters: Figure 5 and
//! Tables 6 and 7 of Jacobina, Lima, Ribeiro 1996.

use sim_bench::prelude::*;

use crate::identification::models::model_c;
use crate::identification::structured::model_s;
use crate::identification::study::{Case, errors};
use crate::identification::trial::Noise;
use crate::identification::{Complex, Parameters, Signal, Trial};

/// Figure 5, Tables 6 and 7.
pub const EXPERIMENT: Experiment = Experiment {
    name: "identify-validate",
    stands_for: "Jacobina 1996, Figure 5, Tables 6 and 7",
    about: "The current of a machine beside the current simulated with estimated and with \
            classical parameters, and the parameters themselves beside the printed ones.",
    uses: &[],
    not: &[],
    run,
};

const H: f64 = 50e-6;
/// Noise of a real converter: a tenth of that of section 5.
const LEVEL: Noise = Noise { voltage: 0.005, current: 0.02 };

/// Title, and the printed estimates of Model C with S_g and with S_s.
const PRINTED: [(&str, Parameters, Parameters); 2] = [
    (
        "Table 6: 60 Hz, 366 rad/s",
        Parameters { r_s: 2.52, tau_r: 0.0114, sigma_l_s: 0.0197, l_s: 0.1127, omega_m: 364.01 },
        Parameters { r_s: 2.42, tau_r: 0.0115, sigma_l_s: 0.0197, l_s: 0.1121, omega_m: 365.84 },
    ),
    (
        "Table 7: 10 Hz, 57.6 rad/s",
        Parameters { r_s: 1.20, tau_r: 0.0211, sigma_l_s: 0.0204, l_s: 0.1178, omega_m: 53.97 },
        Parameters { r_s: 2.34, tau_r: 0.0222, sigma_l_s: 0.0205, l_s: 0.1163, omega_m: 56.14 },
    ),
];
/// Measured speeds, electrical rad/s.
const SPEEDS: [f64; 2] = [366.0, 57.6];

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    for ((title, sg, ss), speed) in PRINTED.into_iter().zip(SPEEDS) {
        let machine = ss.at(speed);
        let mut table = Table::new(title, &[]);
        let data = |signal| Trial::printed(machine, signal, H, LEVEL).run(context.seed, 0);
        let [by_sg, by_ss] = Signal::ALL.map(|signal| data(signal).regression());
        let (by_sg, by_ss) = (by_sg.map_err(Error::refused)?, by_ss.map_err(Error::refused)?);
        let c = [&by_sg, &by_ss].map(|regression| model_c(&regression.delta, H).array());
        let s = model_s(&by_ss, H, None).map(|fit| fit.parameters.array());
        for (k, name) in Parameters::NAMES.into_iter().enumerate() {
            let value = |x: Option<f64>| Cell::or_dash(x.map(|x| Cell::significant(x, 3)));
            table.record([
                ("parameter", Cell::from(name)),
                ("rbv, printed", value((k < 4).then(|| Parameters::RBV.array()[k]))),
                ("C with Sg, printed", value(Some(sg.array()[k]))),
                ("C with Ss, printed", value(Some(ss.array()[k]))),
                ("simulated machine", value(Some(machine.array()[k]))),
                ("C with Sg, ours", value(c[0][k].ok())),
                ("C with Ss, ours", value(c[1][k].ok())),
                ("S with Ss, ours", value(s.ok().map(|s| s[k]))),
            ]);
        }
        outcome.tables.push(table.note(
            "SI units. What was measured is not printed, so the simulated machine is that of the \
             printed estimate with S_s at the measured speed: an assumption. Our estimates say how \
             far Model C gets back to the machine, at a tenth of the noise of section 5.",
        ));
        if speed == SPEEDS[0] {
            // Figure 5 uses the estimate with S_s.
            let estimated = model_c(&by_ss.delta, H).parameters().map_err(Error::refused)?;
            figure_5(&machine, &estimated.at(speed), &mut outcome);
        }
    }
    // Error of tau_r on such a machine with the printed noise, ten times that of a real converter.
    let [sg, ss] = Signal::ALL.map(|signal| {
        let case = Case { speed: 375.0, signal, period: 0 };
        errors(Parameters::RBV, case, Noise::PRINTED, context.seed, 7).continuous[1][1].percent
    });
    outcome.metrics.set("tau_r_error_of_rbv_sg_printed_noise_pct", sg);
    outcome.metrics.set("tau_r_error_of_rbv_ss_printed_noise_pct", ss);
    outcome.remarks.push(format!(
        "The paper does not discuss that τ_r by Model C (0.0114 s at 60 Hz, 0.021 s at 10 Hz) is \
         73 and 50 % below the 0.0427 s of the locked-rotor and no-load tests, nor that it doubles \
         at the lower frequency. The bias of Model C on the machine rbv is 0.3 % at 50 µs. All the \
         noise of section 5, said to be far above that of the measurements, makes a mean error of \
         {sg:.0} % with S_g and of {ss:.0} % with S_s at 375 rad/s; both signals gave the same \
         τ_r. The gap stays unexplained."
    ));
    Ok(outcome)
}

/// Current of the d axis: the machine, and simulated with the same voltage and speed.
fn figure_5(machine: &Parameters, estimated: &Parameters, outcome: &mut Outcome) {
    let current = |p: &Parameters| -> Vec<Complex> {
        let trial = Trial::printed(*p, Signal::SixStep, H, Noise::NONE);
        trial.raw().skip(20_000).take(1000).map(|sample| sample.1).collect()
    };
    let measured = current(machine);
    let mut figure = Figure::new("currents", "Measured and simulated current", "Figure 5");
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
        figure = figure.panel(
            Panel::new("time (s)", format!("i_d, {name} (A)"))
                .with(Series::reference("machine", points(&|n| measured[n].re)))
                .with(Series::line("simulated", points(&|n| simulated[n].re)))
                .with(Series::line("error", points(&|n| measured[n].re - simulated[n].re))),
        );
    }
    outcome.figures.push(figure);
}
