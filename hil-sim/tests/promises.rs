//! The numbers on the first pages equal those of the run that they name.

use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::experiments::{DEFAULT, run};
use sim_bench::rig::Rig;

/// Returns numbers of an experiment.
fn numbers<const N: usize>(experiment: &str, seed: u64, names: [&str; N]) -> [f64; N] {
    let metrics = run(experiment, &Config::default(), seed).unwrap().metrics;
    names.map(|name| metrics.get(name).unwrap())
}

/// Returns the angle error of the torque steps with a seed: rms and largest, degrees.
fn error(seed: u64) -> (f64, f64) {
    numbers(DEFAULT, seed, ["angle_error_rms_deg", "angle_error_max_deg"]).into()
}

/// Returns a page as one line.
fn page(name: &str) -> String {
    let path = format!("{}/../{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_angle_error_of_the_first_command_is_the_printed_one() {
    let (rms, most) = error(1);
    let [first, book, figures] = ["README.md", "docs/README.md", "docs/performance.md"].map(page);
    let sentence = format!("flux angle is {rms:.1}° rms and {most:.0}° at most");
    assert!(first.contains(&sentence) && book.contains(&sentence), "{sentence}");
    let seeds: Vec<_> = (1..=8).map(error).collect();
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = seeds.iter().map(of);
        (values.clone().fold(f64::MAX, f64::min), values.fold(f64::MIN, f64::max))
    };
    let ((a, b), (c, d)) = (ends(|seed| seed.0), ends(|seed| seed.1));
    let row = format!(
        "angle error {rms:.1}° rms, {most:.0}° at most; seeds 1 to 8: {a:.1}° to {b:.1}° rms, {c:.1}° to {d:.1}° at most"
    );
    assert!(figures.contains(&row), "{row}");
}

/// Largest deviation of the torque from its mean at standstill without load, in percent of the rated torque, which is
/// caused by the injection.
fn ripple_pct(motor: &str, set: &[&str]) -> f64 {
    let config = Config::load(Some(motor), None, set).unwrap();
    let mut rig = Rig::oriented(&config, 1, 0.0, 1.0).unwrap();
    let mut torque = Vec::new();
    rig.run(0.1, |p| torque.push(p.torque));
    let mean = torque.iter().sum::<f64>() / torque.len() as f64;
    let most = torque.iter().fold(0.0, |most: f64, torque| most.max((torque - mean).abs()));
    100.0 * most / config.rated_nm()
}

#[test]
fn the_readme_states_the_torque_ripple_of_the_injection() {
    let [low, high] =
        ["low", "high"].map(|flux| ripple_pct("dissertation", &[&format!("sequence.flux={flux}")]));
    let spindle = ripple_pct("spindle-2kw2", &[]);
    let others = Motor::all().into_iter().map(|motor| motor.name);
    let others = others.filter(|name| !["dissertation", "spindle-2kw2"].contains(&name.as_str()));
    let mut others: Vec<f64> = others.map(|name| ripple_pct(&name, &[])).collect();
    others.sort_by(f64::total_cmp);
    let sentence = format!(
        "its peak is {low:.0} % (low flux) to {high:.0} % (high flux) of the rated torque on the dissertation's motor, {:.0} to \
         {:.0} % on {} other [motors](docs/motors.md), and {spindle:.0} % on the spindle",
        others[0],
        others[others.len() - 1],
        others.len()
    );
    assert!(page("README.md").contains(&sentence), "README.md: {sentence}");
}

#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn the_figures_are_those_of_the_runs() {
    let [left_in, torque] = numbers(
        "encoder-orientation",
        1,
        ["angle_error_uncompensated_max_deg", "torque_error_max_pct"],
    );
    let distortion = ["current_distortion_uncompensated_pct", "current_distortion_compensated_pct"];
    let [plain, compensated] = numbers("dead-time", 1, distortion);
    let [rms, peak] = numbers("filters", 1, ["pp_sections_error_rms_a", "pp_sections_error_max_a"]);
    let steps = [
        "load_step_error_max_deg",
        "current_step_error_max_deg",
        "current_step_warm_error_max_deg",
    ];
    let [load, reversal, warm] = numbers("perturbation", 1, steps);
    let figures = page("docs/performance.md");
    for row in [
        format!("(up to {left_in:.1}° without the compensation of the delays)"),
        format!("encoder | within {torque:.2} % |"),
        format!("{plain:.1} % without compensation, {compensated:.2} % with it"),
        format!("≤ {:.0} µA rms, {:.0} µA peak", rms * 1e6, peak * 1e6),
        format!(
            "load step of 0.6 Nm on a free shaft, sensorless | angle error ≤ {load:.1}° in 72 runs"
        ),
        format!(
            "angle error ≤ {reversal:.1}° in 24 runs; rotor 30 % warmer than learned: ≤ {warm:.1}° |"
        ),
    ] {
        assert!(figures.contains(&row), "docs/performance.md lacks: {row}");
    }
}
