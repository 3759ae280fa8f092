//! The commissioning: its results on random machines and boards, and its refusals.

use hil_sim::config::{FluxLevel, LoadMode, PlantModel};
use hil_sim::{Config, experiments};

fn config(runs: u32) -> Config {
    let mut config = Config::default();
    config.extent.runs = Some(runs);
    config
}

/// Different resistances are distinguished from the gains of the sensors, which `accept` scales, for any gains.
#[test]
fn a_resistance_is_no_gain() {
    let with = |percent: f64, gain: f64| {
        let mut config = Config::default();
        let more = percent / 100.0 * config.motor.r_s;
        (config.inverter.more_ohm_b, config.inverter.more_ohm_c) = (-more, more);
        config.measurement.gain_error_a = gain;
        config
    };
    for (percent, gain) in [(0.52, 0.0), (0.87, 0.0), (0.87, 0.01), (-1.3, 0.0), (-1.3, -0.01)] {
        let config = with(percent, gain);
        let settings = experiments::commission::commissioned(&config, 3).unwrap();
        let [a, b] = [settings.scales.current_a, settings.scales.current_b].map(|line| line.gain);
        let [a, b] =
            [a / config.drive.scales.current_a.gain, b / config.drive.scales.current_b.gain];
        let scaled = f64::from(b / a) - 1.0;
        assert!((scaled - gain).abs() < 0.002, "{percent} %, gain {gain}: scaled by {scaled}");
        // A gain error of sensor a is half a common one, which appears in the resistance.
        let r_s = f64::from(settings.motor.r_s) / config.motor.r_s - 1.0 + 0.5 * gain;
        assert!(r_s.abs() < 0.003, "{percent} %, gain {gain}: r_s by {r_s}");
    }
    let refusal =
        |config: &Config| experiments::commission::commissioned(config, 3).unwrap_err().to_string();
    let text = refusal(&with(5.0, 0.0));
    assert!(text.contains("r_b over r_c") && text.contains("cable"), "{text}");
    let text = refusal(&with(0.0, 0.06));
    assert!(text.contains("gain mismatch = 0.06"), "{text}");
    // A leg that is late by 0.8 us, with a constant current across it; a shaft at 10 rpm.
    let mut config = Config::default();
    config.inverter.more_dead_time_b_us = 0.8;
    let text = refusal(&config);
    assert!(text.contains("legs b and c differ"), "{text}");
    let mut config = Config::default();
    config.load.mode = LoadMode::Speed;
    config.load.speed_rpm = 10.0;
    let text = refusal(&config);
    assert!(text.contains("the shaft turns"), "{text}");
}

/// Node capacitances of 50 to 140 pF lie near the threshold of the decision.
#[test]
fn the_capacitance_of_the_nodes_is_no_resistance() {
    for picofarad in [0.0, 50.0, 100.0, 140.0, 200.0, 500.0, 1000.0] {
        let mut config = Config::default();
        config.inverter.node_capacitance_f = 1e-12 * picofarad;
        for (plant, level) in [(PlantModel::A, FluxLevel::Low), (PlantModel::M4, FluxLevel::High)] {
            (config.model.plant, config.model.flux_level) = (plant, level);
            let settings = experiments::commission::commissioned(&config, 9).unwrap();
            let error = f64::from(settings.motor.r_s) / config.motor.r_s - 1.0;
            assert!(error.abs() < 0.003, "{picofarad} pF, {plant:?}: r_s by {error}");
        }
    }
}

#[test]
fn every_defect_is_refused_by_its_name_and_changes_nothing() {
    let outcome = experiments::run("commission-refusals", &config(3), 4).unwrap();
    let get = |name: &str| outcome.metrics.get(name).unwrap();
    let all = get("sessions");
    assert_eq!((get("named"), get("unchanged")), (all, all), "{:?}", outcome.tables);
}
