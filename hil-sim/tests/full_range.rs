//! The runs over the full speed range, compared with each other; those with bounds are in `bounds.toml`.

use hil_sim::{Config, experiments};

/// A run that is selected by its number equals the same run among all, and has curves.
#[test]
fn one_run_is_repeated_and_recorded() {
    let outcome = |set: &str| {
        let set = ["angle_source=encoder", "full_range.kind=reversals", set];
        let config = Config::load(None, None, &set).expect("allowed settings");
        experiments::run("full-range", &config, 1).expect("an outcome")
    };
    let (all, one) = (outcome("runs=1"), outcome("full_range.index=4"));
    let error = "reversals_750_1200_angle_error_rms_deg";
    assert!(all.metrics.get(error).is_some() && all.metrics.get(error) == one.metrics.get(error));
    assert_eq!((all.metrics.get("runs"), one.metrics.get("runs")), (Some(8.0), Some(1.0)));
    assert_eq!((all.figures.len(), one.figures[0].panels.len()), (0, 6));
}
