//! Tests of parts of the laboratory: models, signals, filters and designs, each against known results.

use std::f64::consts::FRAC_PI_3;

use drive_core::printed::DemodulatorKind;
use drive_settings::tuning::rule_3_8;
use sim_bench::Config;
use sim_bench::rig::Rig;
use sim_lab::angle_identification::measure::{Record, filter_alone, steps};
use sim_lab::angle_identification::model::{Model, Pii};
use sim_lab::identification::Complex;
use sim_lab::identification::signals::{Filter, Prbs, schroeder, six_step};
use sim_lab::pi_design;
use sim_lab::poles::largest_pole;
use sim_lab::recomputed::{PERIOD_S, plant};

#[test]
fn a_known_plant_is_found_and_stabilised() {
    let plant = Model::printed(2);
    let mut prbs = Prbs::default();
    let bits: Vec<f64> = (0..255).map(|_| prbs.step()).collect();
    let u: Vec<f64> = bits.iter().flat_map(|&bit| [bit; 20]).collect();
    let y = plant.simulate(&u.repeat(3)).split_off(2 * u.len());
    let record = Record { u, y };
    for model in Model::identify(&record).unwrap() {
        assert!((model.k / plant.k - 1.0).abs() < 1e-6, "{model:?}");
        assert!(model.fit(&record) > 99.99);
    }
    let (pii, crossover) = plant.design().unwrap();
    assert!(largest_pole(&plant.closed_loop(pii)) < 0.9999);
    assert!((plant.open_loop(pii, crossover).norm() - 1.0).abs() < 1e-9);
    // The loop must remain stable with slightly more gain and phase lag than the margin of that peak, which is 1/Ms.
    let more = Pii { k_s: 1.4 * pii.k_s, ..pii };
    assert!(largest_pole(&plant.closed_loop(more)) < 1.0);
}

/// The poles of Table 6 at 1.5 A come out of the post-processing filter alone with short steps, and not with long ones.
#[test]
fn table_6_needs_no_motor() {
    let printed = Model::printed(2).poles()[0];
    let apart = |hold, noise| {
        let pole = Model::identify(&filter_alone(hold, noise, 1)).unwrap()[0].poles()[0];
        (pole.re - printed.re).abs().max((pole.im - printed.im).abs())
    };
    let short = (10..=20).flat_map(|hold| [0.006, 0.008].map(|noise| apart(hold, noise)));
    let least = short.fold(f64::MAX, f64::min);
    assert!(least < 0.003, "{least}");
    assert!([0.006, 0.008].iter().all(|&noise| apart(60, noise) > 0.01));
}

#[test]
fn the_printed_controller_is_at_the_limit_on_the_printed_plants() {
    // Values from an independent study: .99992, 1.00016, 1.00015, 1.00032, 1.00049, 1.00021.
    let expected = [0.99992, 1.00016, 1.00015, 1.00032, 1.00049, 1.00021];
    for (row, expected) in expected.into_iter().enumerate() {
        let found = largest_pole(&Model::printed(row).closed_loop(Pii::printed()));
        assert!((found - expected).abs() < 2e-5, "{row}: {found}");
    }
}

/// Slow gain with the axis alone and with the current, by demodulation.
fn gains(demodulator: DemodulatorKind, iq: f64) -> [f64; 2] {
    let mut config = Config::default();
    config.drive.injection.demodulator = demodulator;
    steps(Rig::oriented(&config, 5, iq, 0.8).unwrap()).unwrap()
}

#[test]
fn the_leak_turns_with_the_current_and_the_flux_does_not() {
    // The leakage: sqrt2 * 0.01 * 0.944 * iq while the current is held, zero if it rotates with the axis.
    let [held, slow] = gains(DemodulatorKind::Literal, 2.0);
    let leak = 2f64.sqrt() * 0.01 * 0.944_061 * 2.0;
    assert!((held / leak - 1.0).abs() < 0.03, "{held} {leak}");
    assert!(slow.abs() < 0.05 * leak, "{slow}");

    // The saliency: 2 (|a| + b |i| |cos 2 gamma|) and 2 |a|. The chord over 4° and the errors of dead time and noise
    // cause a few tenths.
    let [held, slow] = gains(DemodulatorKind::Synchronous, 2.0);
    let cos_2_gamma = (4.0 - 0.49) / (4.0 + 0.49);
    let fast = 2.0 * (0.035 + 0.036 * 4.49_f64.sqrt() * cos_2_gamma);
    assert!((held / fast - 1.0).abs() < 0.2, "{held} {fast}");
    assert!((slow / 0.07 - 1.0).abs() < 0.25, "{slow}");
}

#[test]
fn controllers_of_section_3_8() {
    let expected = [(53.000, 0.947726), (66.527, 0.953803), (51.215, 0.953374)];
    for ((place, ..), (k_c, z_c)) in pi_design::PLANTS.iter().zip(expected) {
        let rule = rule_3_8(plant(place), PERIOD_S).unwrap();
        assert!((rule.k_c / k_c - 1.0).abs() < 1e-4, "{place}: {}", rule.k_c);
        assert!((rule.z_c / z_c - 1.0).abs() < 1e-4, "{place}: {}", rule.z_c);
    }
}

#[test]
fn the_sequence_has_the_longest_period() {
    let mut prbs = Prbs::default();
    let states = [(); Prbs::PERIOD].map(|()| {
        prbs.step();
        prbs.0
    });
    assert!((1..=255).all(|state| states.contains(&state)), "each state once");
    assert_eq!((0..Prbs::PERIOD).map(|_| prbs.step()).sum::<f64>(), 1.0, "one more +1 than -1");
}

#[test]
fn six_steps_per_period_and_a_jump_on_the_sample() {
    for k in 0..2000u32 {
        let v = six_step(2.0, 60.0, f64::from(k) * 50e-6);
        // 60 Hz at 50 us: a jump every 55.5 samples, exactly on every 500th sample.
        let sector = (k * 9 / 500) % 6;
        assert!((v - Complex::from_polar(2.0, FRAC_PI_3 * f64::from(sector))).norm() < 1e-12);
    }
}

#[test]
fn schroeder_peaks_lower_than_cosines_and_is_flat() {
    let values: Vec<f64> = (0..1000).map(|n| schroeder(1.0, f64::from(n) / 1000.0)).collect();
    let peak = values.iter().fold(0.0f64, |peak, r| peak.max(r.abs()));
    assert!((peak - 2.83).abs() < 0.01, "{peak}");
    let power = values.iter().map(|r| r * r).sum::<f64>() / 1000.0;
    assert!((power - 2.5).abs() < 1e-9);
}

#[test]
fn the_filter_has_its_corner() {
    // At omega_n a third-order section of this kind has |1/(1+j)|³ = 2^(-3/2); Tustin's rule warps omega_n h = 0.1 by
    // h² omega_n² / 12.
    let (omega, h) = (1000.0, 1e-4);
    let mut filter = Filter::new(omega, h);
    let mut gain = 0.0;
    for n in 0..10_000 {
        gain = filter.step(Complex::from_polar(1.0, omega * h * f64::from(n))).norm();
    }
    assert!((gain - 0.5f64.powf(1.5)).abs() < 1e-3, "{gain}");
}
