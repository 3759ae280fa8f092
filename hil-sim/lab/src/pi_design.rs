//! The design of the current controllers in the w plane, and its margins with all parts of the actual loop.

use drive_core::filter::BPF;
use drive_settings::tuning::{
    CurrentLoopDesign, RuleDesign, design_current_loop, motor_plant, pi_response, rule_3_8,
};

use crate::prelude::*;
use crate::recomputed::{PERIOD_S, plant};

/// The identified plants: the place where they are printed, and their names in the tables and in the metrics.
pub const PLANTS: [(&str, &str, &str); 3] = [
    ("Eq. 3.34", "Eq. 3.34", "motor"),
    ("Eq. 3.41", "Eq. 3.41, d axis", "d"),
    ("Eq. 3.42", "Eq. 3.42, q axis", "q"),
];

/// Runs the experiment: Figures 23 to 25, section 3.8.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let motor = context.config.drive.motor.into();
    let physical = motor_plant(&motor, PERIOD_S).map_err(Error::refused)?;
    let mut outcome = Outcome::default();
    let mut loops = Vec::new();
    for (place, name, key) in PLANTS {
        let identified = plant(place);
        let rule = rule_3_8(identified, PERIOD_S).map_err(Error::refused)?;
        let design = design_current_loop(identified, physical, PERIOD_S).map_err(Error::refused)?;
        for (metric, value) in [
            ("kc_v_per_a", rule.k_c),
            ("zc", rule.z_c),
            ("crossover_fictitious_hz", hz(rule.v)),
            ("kc_reduced_v_per_a", design.k_c),
            ("phase_margin_rule_deg", design.rule_margins.phase_margin_deg),
            ("ms_rule", design.rule_margins.ms),
            ("phase_margin_deg", design.margins.phase_margin_deg),
            ("ms", design.margins.ms),
        ] {
            outcome.metrics.set(format!("{key}_{metric}"), value);
        }
        loops.push((name, identified, rule, design));
    }
    let (_, identified, rule, _) = loops[0];
    outcome.figures.push(w_plane(identified, rule));
    outcome.tables.push(margin_table(&loops));
    // Section 2.5: the crossover of the rule beside the lower edge of BPF.
    let edges = crate::filters::edges_hz(&BPF, -0.6);
    outcome.metrics.set("bpf_lower_edge_hz", edges[0]);
    outcome.metrics.set("bpf_upper_edge_hz", edges[1]);
    let gain = -20.0 * rule.k_c.log10();
    let at = "gain with the zero at the crossover";
    outcome.compared.push(beside("Figure 24", "crossover, fictitious").recomputed(hz(rule.v)));
    outcome.compared.push(beside("Figure 25", at).recomputed(gain));
    outcome.compared.push(named("loop_below_bpf").recomputed(hz(rule.v) < edges[0]));
    let (k_ft, t_ft) = (physical.k / (1.0 - physical.p), -1e3 * PERIOD_S / physical.p.ln());
    outcome.compared.push(beside("Eq. 3.20", "k_FT").recomputed(k_ft));
    outcome.compared.push(beside("Eq. 3.22", "T_FT").recomputed(t_ft));
    let values = [
        ("pole_hz", -physical.p.ln() * RATE / std::f64::consts::TAU),
        ("factor", k_ft / printed("Eq. 3.20", "k_FT")),
    ];
    texts::add_remarks(&mut outcome, "pi-design", &values);
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
    let crossover = printed("Figure 24", "crossover, fictitious");
    let mark = |place, quantity| (crossover, printed(place, quantity));
    let gains = vec![mark("Figure 25", "gain with the zero at the crossover"); 2];
    let phases = vec![
        mark("section 3.8", "phase desired at the crossover"),
        mark("section 3.8", "phase of the plant with integrator at the crossover"),
    ];
    let [gains, phases] = [gains, phases].map(|marks| Series::points("printed", marks));
    texts::figure("pi-design", "w-plane")
        .panel(gain.y_range(-100.0, 20.0).with(at(-100.0, 20.0)).with(gains))
        .panel(phase.y_range(-360.0, 0.0).with(at(-360.0, 0.0)).with(phases))
}

fn margin_table(loops: &[(&str, FirstOrder, RuleDesign, CurrentLoopDesign)]) -> Table {
    let rows = loops.iter().flat_map(|(name, .., design)| {
        [
            ("by the rule", design.rule_k_c, design.rule_margins),
            ("used", design.k_c, design.margins),
        ]
        .map(|(label, k_c, margins)| {
            [
                ("identified plant", Cell::from(*name)),
                ("gain", Cell::from(label)),
                ("kc (V/A)", Cell::fixed(k_c, 2)),
                ("crossover (Hz)", Cell::fixed(margins.crossover_hz, 1)),
                ("phase margin (°)", Cell::fixed(margins.phase_margin_deg, 1)),
                ("Ms", Cell::fixed(margins.ms, 2)),
                ("at (Hz)", Cell::fixed(margins.ms_hz, 0)),
                ("gain margin", Cell::fixed(margins.gain_margin, 2)),
            ]
        })
    });
    texts::table("pi-design", "margins").records(rows)
}
