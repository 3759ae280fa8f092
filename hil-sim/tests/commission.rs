//! The commissioning: what it finds on machines and boards drawn at random, and what it refuses.

use hil_sim::{Config, experiments};

fn config(runs: u32) -> Config {
    let mut config = Config::default();
    config.extent.runs = Some(runs);
    config
}

/// Half of the bounds that hold over thousands of machines (1.5 %): a defect of any part shows beyond them.
#[test]
fn random_machines_are_accepted_and_right() {
    for seed in [1, 2] {
        let metrics = experiments::run("commission", &config(40), seed).unwrap().metrics;
        let get = |name: &str| metrics.get(name).unwrap();
        assert_eq!((get("accepted"), get("wrongly_accepted")), (40.0, 0.0), "seed {seed}");
        for name in ["r_s", "sigma_ls", "rr", "lm", "tau_r"] {
            let error = get(&format!("error_q95_pct.{name}"));
            assert!(error < 0.9, "seed {seed}: {name} {error} %");
        }
        // Free shafts; the nameplate's peak; 12 s for all but the check of the current loop.
        assert!(get("shaft_deg_max") < 0.1 && get("current_max_of_peak") < 1.0);
        assert!(get("seconds_max") < 13.0 && get("margin_deg_min") > 45.0);
    }
}

/// The chord of the main flux, with iron that saturates by a fifth: 6 % in 95 of 100.
#[test]
fn iron_is_found_by_the_staircase() {
    let mut config = config(20);
    config.model.plant = hil_sim::config::PlantModel::M4;
    config.model.flux_level = hil_sim::config::FluxLevel::High;
    let metrics = experiments::run("commission", &config, 3).unwrap().metrics;
    let get = |name: &str| metrics.get(name).unwrap();
    assert_eq!((get("accepted"), get("wrongly_accepted")), (20.0, 0.0));
    assert!(get("error_max_pct.lm") < 12.0 && get("error_max_pct.tau_r") < 12.0);
    assert!(get("error_q95_pct.r_s") < 1.0 && get("seconds_max") < 45.0);
}

#[test]
fn every_defect_is_refused_by_its_name_and_changes_nothing() {
    let outcome = experiments::run("commission-refusals", &config(3), 4).unwrap();
    let get = |name: &str| outcome.metrics.get(name).unwrap();
    let all = get("sessions");
    assert_eq!((get("named"), get("unchanged")), (all, all), "{:?}", outcome.tables);
}
