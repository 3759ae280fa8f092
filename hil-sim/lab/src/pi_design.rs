//! The design of the current controllers in the w plane, and its margins with everything that is
//! really in the loop.

mod differences;

use drive_core::FirstOrder;
use drive_core::filter::LPF;
use drive_settings::tuning::{
    CurrentLoopDesign, DELAY, RuleDesign, design_current_loop, motor_plant, pi_response, rule_3_8,
};
use num_complex::Complex64;
use sim_bench::bode::{Bode, RATE, fictitious, frequencies, omega_t};
use sim_bench::outcome::Style;
use sim_bench::prelude::*;

/// Figures 23 to 25, section 3.8.
pub const EXPERIMENT: Experiment = Experiment {
    name: "pi-design",
    stands_for: "Figures 23, 24, 25, Eq. 3.35 to 3.42",
    about: "The current controllers by the rule of section 3.8, beside the printed ones, and their \
            margins with the filter, the delay and the motor.",
    uses: &[&["motor.", "drive.motor."]],
    not: &[TURNING, &["drive.motor.inertia"]],
    run,
};

const PERIOD_S: f64 = 1.0 / RATE;

/// An identified plant (A/V) and the printed controller for it.
struct Identified {
    name: &'static str,
    key: &'static str,
    plant: FirstOrder,
    /// Crossover (fictitious, Hz), z_c, k_c.
    printed: Option<[f64; 3]>,
}

#[rustfmt::skip] // a plant a line
const IDENTIFIED: [Identified; 3] = [
    Identified { name: "Eq. 3.34", key: "motor", plant: FirstOrder { k: 0.0040532, p: 0.93916 }, printed: Some([204.5, 0.94786, 52.48]) },
    Identified { name: "Eq. 3.41, d axis", key: "d", plant: FirstOrder { k: 0.002837, p: 0.9511 }, printed: None },
    Identified { name: "Eq. 3.42, q axis", key: "q", plant: FirstOrder { k: 0.003721, p: 0.9503 }, printed: None },
];

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let motor = context.config.drive.motor.into();
    let physical = motor_plant(&motor, PERIOD_S).map_err(Error::refused)?;
    let mut outcome = Outcome::default();
    let rules = IDENTIFIED.map(|i| rule_3_8(i.plant, PERIOD_S).map(|rule| (i, rule)));
    let rules = rules.into_iter().collect::<Result<Vec<_>, _>>().map_err(Error::refused)?;
    outcome.figures.push(w_plane(IDENTIFIED[0].plant, rules[0].1));
    outcome.tables.push(rule_table(&rules));
    let mut designs = Vec::new();
    for (identified, rule) in &rules {
        let design =
            design_current_loop(identified.plant, physical, PERIOD_S).map_err(Error::refused)?;
        for (name, value) in [
            ("kc_v_per_a", rule.k_c),
            ("zc", rule.z_c),
            ("crossover_fictitious_hz", hz(rule.v)),
            ("kc_reduced_v_per_a", design.k_c),
            ("phase_margin_rule_deg", design.rule_margins.phase_margin_deg),
            ("ms_rule", design.rule_margins.ms),
            ("phase_margin_deg", design.margins.phase_margin_deg),
            ("ms", design.margins.ms),
        ] {
            outcome.metrics.set(format!("{}_{name}", identified.key), value);
        }
        designs.push((identified.name, design));
    }
    outcome.tables.push(margin_table(&designs));
    outcome.figures.push(real_loop(&designs[1].1, physical));
    outcome.tables.push(differences::table(&motor, physical));
    outcome.remarks.push(format!(
        "Section 3.7 prefers the identified plant because the computed one seems faster. It is not: \
         its pole is at {:.1} Hz, below the identified ones; Eq. 3.20 to 3.22 and 3.32 hold a slip \
         of a factor {:.2}. The gain k_FTD survives it because the factor cancels.",
        -physical.p.ln() * RATE / std::f64::consts::TAU,
        physical.k / (1.0 - physical.p) / 0.01973,
    ));
    Ok(outcome)
}

fn hz(v: f64) -> f64 {
    v / std::f64::consts::TAU
}

fn w_plane(plant: FirstOrder, rule: RuleDesign) -> Figure {
    let one = Complex64::ONE;
    let g = |w: f64| plant.response(w);
    let integrated = |w: f64| plant.response(w) / (Complex64::cis(w) - one);
    let with_zero = |w: f64| plant.response(w) * pi_response(1.0, rule.z_c, w);
    let grid = frequencies(1.0, 2800.0, 800);
    let bode = Bode { hz: &grid, label: "fictitious frequency v (Hz)", shown: fictitious };
    let responses: [(&str, &dyn Fn(f64) -> Complex64); 3] = [
        ("G (Fig. 23)", &g),
        ("G/(z − 1) (Fig. 24)", &integrated),
        ("G (z − zc)/(z − 1) (Fig. 25)", &with_zero),
    ];
    let (gain, phase) = bode.panels(responses);
    let at = |low, high| {
        Series::limit("crossover by the rule", vec![(hz(rule.v), low), (hz(rule.v), high)])
    };
    Figure::new("w-plane", "Identified plant of Eq. 3.34 in the w plane", "Figures 23, 24, 25")
        .panel(gain.y_range(-100.0, 20.0).with(at(-100.0, 20.0)))
        .panel(phase.y_range(-360.0, 0.0).with(at(-360.0, 0.0)))
}

fn rule_table(rules: &[(Identified, RuleDesign)]) -> Table {
    let heads = ["plant", "", "crossover v (Hz)", "zc = pf", "kc (V/A)", "phase of L at v (°)"];
    let mut table = Table::new("Rule of section 3.8", &heads);
    for (Identified { name, plant, printed, .. }, rule) in rules {
        let phase = |v_hz: f64, z_c: f64| {
            let w = 2.0 * (v_hz * std::f64::consts::PI * PERIOD_S).atan();
            (pi_response(1.0, z_c, w) * plant.response(w)).arg().to_degrees()
        };
        let mut row = |how: &str, [v, z_c, k_c]: [f64; 3], decimals: [usize; 2]| {
            table.row([
                Cell::from(*name),
                Cell::from(how),
                Cell::fixed(v, 2),
                Cell::fixed(z_c, decimals[0]),
                Cell::fixed(k_c, decimals[1]),
                Cell::fixed(phase(v, z_c), 1),
            ]);
        };
        row("computed", [hz(rule.v), rule.z_c, rule.k_c], [6, 3]);
        if let Some(printed) = *printed {
            row("printed", printed, [5, 2]);
        }
    }
    table.note(
        "The printed values were read off a graph; the source prints no controllers for 3.41 and \
         3.42. Eq. 3.38 prints the zero with the wrong sign of w, which would put it at 1.055.",
    )
}

fn margin_table(designs: &[(&str, CurrentLoopDesign)]) -> Table {
    let mut table = Table::new("Margins on the motor, with LPF and one period of delay", &[]);
    for (name, design) in designs {
        let rows = [
            ("by the rule", design.rule_k_c, design.rule_margins),
            ("used", design.k_c, design.margins),
        ];
        for (label, k_c, margins) in rows {
            table.record([
                ("identified plant", Cell::from(*name)),
                ("gain", Cell::from(label)),
                ("kc (V/A)", Cell::fixed(k_c, 2)),
                ("crossover (Hz)", Cell::fixed(margins.crossover_hz, 1)),
                ("phase margin (°)", Cell::fixed(margins.phase_margin_deg, 1)),
                ("Ms", Cell::fixed(margins.ms, 2)),
                ("at (Hz)", Cell::fixed(margins.ms_hz, 0)),
                ("gain margin", Cell::fixed(margins.gain_margin, 2)),
            ]);
        }
    }
    table.note(
        "The rule sees neither the filter nor the delay. Where it leaves less than 45° or a \
         sensitivity peak Ms above 2.2, kc is lowered until both hold.",
    )
}

fn real_loop(design: &CurrentLoopDesign, physical: FirstOrder) -> Figure {
    let open_loop = |k_c: f64| {
        move |w: f64| {
            pi_response(k_c, design.z_c, w)
                * physical.response(w)
                * LPF.response(w)
                * Complex64::cis(-DELAY * w)
        }
    };
    let (rule, used) = (open_loop(design.rule_k_c), open_loop(design.k_c));
    let grid = frequencies(5.0, 2900.0, 1200);
    let bode = Bode { hz: &grid, label: "frequency (Hz)", shown: |hz| hz };
    let names = [
        format!("by the rule, kc = {:.1}", design.rule_k_c),
        format!("used, kc = {:.1}", design.k_c),
    ];
    let (mut gain, mut phase) = bode.panels([(&names[0], &rule), (&names[1], &used)]);
    // The phases are the same: dashed, the rule does not hide behind the other.
    for panel in [&mut gain, &mut phase] {
        panel.series[0].style = Style::Reference;
    }
    let sensitivity = |l: &dyn Fn(f64) -> Complex64| {
        grid.iter().map(|&hz| (hz, 1.0 / (Complex64::ONE + l(omega_t(hz))).norm())).collect()
    };
    let ends = |level: f64| vec![(grid[0], level), (grid[grid.len() - 1], level)];
    let sensitivity = Panel::new("frequency (Hz)", "|1/(1 + L)|")
        .log_x()
        .y_range(0.0, 3.0)
        .with(Series::reference(&*names[0], sensitivity(&rule)))
        .with(Series::line(&*names[1], sensitivity(&used)))
        .with(Series::limit("largest allowed, 2.2", ends(2.2)));
    Figure::new(
        "real-loop",
        "Open loop L of the d axis (Eq. 3.41) with filter, delay and motor",
        "",
    )
    .panel(gain.y_range(-60.0, 30.0).with(Series::limit("", ends(0.0))))
    .panel(phase.with(Series::limit("", ends(-180.0))))
    .panel(sensitivity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controllers_of_section_3_8() {
        let expected = [(53.000, 0.947726), (66.527, 0.953803), (51.215, 0.953374)];
        for (identified, (k_c, z_c)) in IDENTIFIED.iter().zip(expected) {
            let rule = rule_3_8(identified.plant, PERIOD_S).unwrap();
            assert!((rule.k_c / k_c - 1.0).abs() < 1e-4, "{}: {}", identified.name, rule.k_c);
            assert!((rule.z_c / z_c - 1.0).abs() < 1e-4, "{}: {}", identified.name, rule.z_c);
        }
    }
}
