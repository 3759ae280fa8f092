//! Tests of optional effects of inverter, dc link and sensors, by their physical consequences.

use std::f64::consts::TAU;

use crate::common::{T, compare, held, near, plant, settings};
use drive_core::Compare;
use motor_plant::{
    Complex, DcLinkSettings, FAMILIES, InverterSettings, MeasurementSettings, Plant, PlantSettings,
    phases,
};

/// Currents that the drive would read, A, without the errors of the ADC.
fn read(plant: &mut Plant, settings: &PlantSettings) -> [f64; 2] {
    let lines = settings.measurement.calibration();
    let sample = plant.sample();
    let conversions = if settings.measurement.both_zero_vectors { 2.0 } else { 1.0 };
    let current = |code: u16, k: usize| {
        f64::from(code) / conversions * lines[k].a_per_code + lines[k].a_at_zero
    };
    [current(sample.current_a, 0), current(sample.current_b, 1)]
}

#[test]
fn sensors_have_the_errors_they_are_given() {
    // Phase a carries 2.2 A; b and c each carry half of it back.
    let v = Complex::cis(0.3) * 12.0;
    let error = |change: &dyn Fn(&mut MeasurementSettings), seconds: f64| {
        let mut settings = settings();
        change(&mut settings.measurement);
        let mut plant = held(&settings, v, seconds);
        let [a, b, _] = plant.phase_currents();
        let [read_a, read_b] = read(&mut plant, &settings);
        (a, b, read_a - a, read_b - b)
    };
    let step = 2e-4; // one ADC count
    let (_, _, da, db) = error(&|_| {}, 1.0);
    near(da.abs() + db.abs(), 0.0, step);
    let (a, b, da, db) = error(&|m| (m.cross_talk_a, m.cross_talk_b) = (0.02, -0.01), 1.0);
    near(da, 0.02 * b, step);
    near(db, -0.01 * a, step);
    let (a, _, da, _) = error(&|m| m.cubic_error = 0.05, 1.0);
    near(da, 0.05 * a * (a / 4.4727).powi(2), step);
    assert!(da > 0.02);
    let (_, _, da, db) = error(&|m| (m.drift_a, m.drift_b) = (0.05, -0.02), 1.0);
    near(da, 0.05, step);
    near(db, -0.02, step);
    // After 2 ms the current still rises, so the reading of b is the current of 40 us before.
    let slope = (error(&|_| {}, 0.0025).1 - error(&|_| {}, 0.0015).1) / 0.001;
    let (_, _, _, db) = error(&|m| m.lag_b_us = 40.0, 0.002);
    near(db, -40e-6 * slope, 0.1 * (40e-6 * slope).abs() + step);
    assert!((40e-6 * slope).abs() > 5.0 * step);
}

#[test]
fn two_conversions_a_period_have_less_noise_and_are_a_quarter_older() {
    let deviation = |both: bool| {
        let mut settings = settings();
        (settings.measurement.noise_a, settings.measurement.lsb_a) = (0.01, 0.000_28);
        settings.measurement.both_zero_vectors = both;
        let mut plant = plant(&settings);
        let readings: Vec<f64> = (0..20_000)
            .map(|_| {
                plant.advance(&compare(Complex::ZERO), T);
                read(&mut plant, &settings)[0]
            })
            .collect();
        (readings.iter().map(|r| r * r).sum::<f64>() / readings.len() as f64).sqrt()
    };
    near(deviation(false), 0.01, 2e-4);
    near(deviation(true), 0.01 / 2.0_f64.sqrt(), 2e-4);
    // The current rises, 12 V on 51 mH, so the mean is T/4 late.
    let mut settings = settings();
    (settings.measurement.both_zero_vectors, settings.measurement.lsb_a) = (true, 0.000_28);
    let mut plant = held(&settings, Complex::from(12.0), 0.002);
    let slope = {
        let before = plant.clone().current().re;
        let mut later = plant.clone();
        later.advance(&compare(Complex::from(12.0)), T);
        (later.current().re - before) / T
    };
    let behind = plant.current().re - read(&mut plant, &settings)[0];
    near(behind, 0.25 * T * slope, 0.05 * T * slope + 2e-4);
    // With the outputs off there is no current, in the middle of the period either.
    for _ in 0..100 {
        plant.advance(&Compare::OFF, T);
    }
    near(read(&mut plant, &settings)[0], 0.0, 2e-4);
}

/// Inverter voltage error at a constant current, and that current.
fn lost(change: impl Fn(&mut InverterSettings), volts: f64) -> (f64, f64) {
    let mut settings = settings();
    settings.inverter = InverterSettings { residual_v: 0.0, ..InverterSettings::default() };
    change(&mut settings.inverter);
    let v = Complex::from(volts);
    let plant = held(&settings, v, 1.0);
    let [a, b, c] = phases(v).map(|v| ((0.5 + v / 311.0) * 14_167.0).round() / 14_167.0 * 311.0);
    let asked = motor_plant::clarke([a, b, c]).re;
    (asked - plant.applied_voltage().re, plant.current().re)
}

#[test]
fn the_inverter_has_the_errors_it_is_given() {
    // Phase a in series with b and c in parallel: 4/3 of the error of a leg.
    let leg = |error: f64| 4.0 / 3.0 * error;
    let dead = 2.2e-6 * 6000.0 * 311.0;
    let (error, _) = lost(|_| {}, 15.0);
    near(error, leg(dead), 1e-6);
    let (error, _) = lost(|i| i.extra_dead_time_us = 0.5, 15.0);
    near(error, leg(dead * 2.7 / 2.2), 1e-6);
    let (error, i) = lost(|i| i.on_resistance = 0.5, 15.0);
    near(error, leg(dead) + 0.5 * i, 1e-3);
    // Lines and legs of b and c, which share the current.
    let (error, i) = lost(|s| s.more_ohm = [0.0, 0.6, 0.6], 15.0);
    near(error, leg(dead) + 0.2 * i, 1e-3);
    let (error, _) = lost(|s| s.more_dead_time_us = [0.0, 0.5, 0.5], 15.0);
    near(error, 2.0 / 3.0 * dead * (1.0 + 2.7 / 2.2), 1e-6);
    // A capacitance of 20 nF needs 2.8 A to be charged within the dead time. Below that current, the error of a leg is
    // i t^2/(2 C) of a period.
    let (error, i) = lost(|i| i.node_capacitance = 20e-9, 10.0);
    let swing = |i: f64| i * 2.2e-6 * 2.2e-6 / (2.0 * 20e-9) * 6000.0;
    assert!(i > 0.5 && i < 2.8);
    near(error, 2.0 / 3.0 * (swing(i) + swing(0.5 * i)), 1e-3);
    // Far above that current the error is the full error minus C V^2/(2 i) of a period.
    let (error, i) = lost(|i| i.node_capacitance = 450e-12, 15.0);
    let full = |i: f64| dead - 450e-12 * 311.0 * 311.0 / (2.0 * i) * 6000.0;
    near(error, 2.0 / 3.0 * (full(i) + full(0.5 * i)), 1e-3);
    let switched =
        InverterSettings { switched: true, node_capacitance: 1e-9, ..InverterSettings::default() };
    let refused = PlantSettings { inverter: switched, ..settings() };
    let text = Plant::new(&refused, 1).expect_err("refused").to_string();
    assert!(text.starts_with("inverter.node_capacitance = "), "{text}");
}

#[test]
fn the_dc_link_ripples_holds_up_and_is_braked() {
    let mut settings = settings();
    settings.dc_link = DcLinkSettings { ripple: 0.1, ripple_hz: 100.0, ..Default::default() };
    let mut rippling = plant(&settings);
    let volts: Vec<f64> = (0..600)
        .map(|_| {
            rippling.advance(&compare(Complex::ZERO), T);
            rippling.dc_link()
        })
        .collect();
    near(volts.iter().fold(0.0, |a, &b| f64::max(a, b)), 342.1, 0.1);
    let crossings = volts.windows(2).filter(|w| (w[0] < 311.0) != (w[1] < 311.0)).count();
    // Two crossings a period; the last may fall on the end.
    assert!((19..=20).contains(&crossings), "{crossings}");

    // Without mains, the energy that the motor takes comes from the capacitor.
    settings.dc_link = DcLinkSettings { capacitor: 470e-6, outage: 1.0, ..Default::default() };
    let mut alone = plant(&settings);
    let mut taken = 0.0;
    for _ in 0..900 {
        let before = alone.current();
        alone.advance(&compare(Complex::from(20.0)), T);
        let mean = (before + alone.current()) * 0.5;
        taken += 1.5 * (mean.conj() * alone.applied_voltage()).re * T;
    }
    let left = 0.5 * 470e-6 * (311.0 * 311.0 - alone.dc_link().powi(2));
    // The plant uses the mean over half a period.
    near(left / taken, 1.0, 1e-4);
    assert!(taken > 5.0 && alone.dc_link() < 290.0);

    // Without load, six pulses of 50 Hz leave the peak; under load the ripple is 300 Hz.
    settings.dc_link = DcLinkSettings { capacitor: 470e-6, ..Default::default() };
    let mut fed = plant(&settings);
    for _ in 0..3000 {
        fed.advance(&compare(Complex::from(20.0)), T);
    }
    let volts: Vec<f64> = (0..600)
        .map(|_| {
            fed.advance(&compare(Complex::from(20.0)), T);
            fed.dc_link()
        })
        .collect();
    let mean = volts.iter().sum::<f64>() / 600.0;
    let rising = volts.windows(2).filter(|w| w[0] < mean && w[1] >= mean).count();
    assert_eq!(rising, 30);
    assert!(mean > 300.0 && mean < 311.0, "{mean}");

    // A chopper brings an overcharged link down to 98 % of its threshold, with the time constant R C, and then stops.
    settings.dc_link = DcLinkSettings {
        capacitor: 470e-6,
        chopper_v: 400.0,
        chopper: 100.0,
        // The mains would otherwise have a peak of 420 V.
        outage: 10.0,
        ..Default::default()
    };
    let mut braked = plant(&settings);
    braked.set_dc_link(420.0).expect("in range");
    for k in 0..600 {
        braked.advance(&Compare::OFF, T);
        if k == 5 {
            near(braked.dc_link(), 420.0 * (-6.0 * T / 0.047).exp(), 0.1);
        }
    }
    near(braked.dc_link(), 391.0, 1.0);
}

#[test]
fn the_dc_link_sensor_has_gain_lag_and_noise() {
    let code = |change: &dyn Fn(&mut MeasurementSettings), periods: u32| {
        let mut settings = settings();
        change(&mut settings.measurement);
        let mut plant = plant(&settings);
        plant.advance(&Compare::OFF, T);
        plant.set_dc_link(200.0).expect("in range");
        for _ in 0..periods {
            plant.advance(&Compare::OFF, T);
        }
        f64::from(plant.sample().dc_link) * settings.measurement.dc_link_v
    };
    near(code(&|_| {}, 1), 200.0, 0.06);
    near(code(&|m| m.dc_gain_error = 0.05, 1), 210.0, 0.06);
    let lagging = 200.0 + 111.0 * (-2.0 * T / 1e-3).exp();
    near(code(&|m| m.dc_lag_us = 1000.0, 2), lagging, 0.06);
    let noisy = code(&|m| m.dc_noise_v = 5.0, 1);
    assert!((noisy - 200.0).abs() > 0.06 && (noisy - 200.0).abs() < 25.0);
}

#[test]
fn an_open_phase_has_no_current_and_the_others_have_the_same() {
    let g = FAMILIES.iter().find(|family| family.name == "g").expect("g").iron;
    for iron in [None, Some(g)] {
        for (open, switched) in [(0, false), (1, false), (2, true)] {
            let mut settings = settings();
            settings.iron = iron;
            settings.inverter = InverterSettings { switched, ..InverterSettings::default() };
            let mut plant = plant(&settings);
            let turning = |k: u32| compare(Complex::cis(TAU * 20.0 * f64::from(k) * T) * 40.0);
            for k in 0..300 {
                plant.advance(&turning(k), T);
            }
            assert!(plant.phase_currents().iter().all(|i| i.abs() > 0.01));
            plant.set_open_phase(Some(open)).expect("a phase");
            let mut largest = 0.0_f64;
            for k in 300..900 {
                plant.advance(&turning(k), T);
                let i = plant.phase_currents();
                assert!(i[open].abs() < 1e-12, "{i:?}");
                largest = largest.max(i[(open + 1) % 3].abs());
            }
            assert!(largest > 0.3, "{largest}");
            // With the outputs off the other two currents decay; the open phase stays without current.
            for _ in 0..300 {
                plant.advance(&Compare::OFF, T);
                assert!(plant.phase_currents()[open].abs() < 1e-12);
            }
            assert_eq!(plant.current(), Complex::ZERO);
            plant.set_open_phase(None).expect("none");
            plant.advance(&turning(0), T);
            assert!(plant.current().norm() > 1e-3);
        }
    }
}

#[test]
fn refusals_name_the_setting() {
    type Case = (&'static str, fn(&mut PlantSettings));
    let cases: [Case; 13] = [
        ("warming.rr", |s| s.warming.rr = 3.0),
        ("dc_link.pulses", |s| s.dc_link.pulses = 4),
        ("dc_link.load", |s| s.dc_link.load = -1.0),
        ("dc_link.sag_v", |s| s.dc_link.sag_v = 2000.0),
        ("dc_link.sag_ramp", |s| s.dc_link.sag_ramp = 0.0),
        ("dc_link.capacitor", |s| s.dc_link.capacitor = 1.0),
        ("mechanics.static_torque", |s| s.mechanics.static_torque = -1.0),
        ("mechanics.stiffness", |s| {
            (s.mechanics.load_inertia, s.mechanics.stiffness) = (0.009, 1e6);
        }),
        ("measurement.cross_talk_a", |s| s.measurement.cross_talk_a = 0.5),
        ("measurement.lag_b_us", |s| s.measurement.lag_b_us = f64::NAN),
        ("measurement.cubic_error", |s| s.measurement.cubic_error = 1.0),
        ("inverter.extra_dead_time_us", |s| s.inverter.extra_dead_time_us = -3.0),
        ("inverter.on_resistance", |s| s.inverter.on_resistance = -0.1),
    ];
    for (name, change) in cases {
        let mut settings = settings();
        change(&mut settings);
        let text = Plant::new(&settings, 1).expect_err(name).to_string();
        assert!(text.starts_with(&format!("{name} = ")) && text.contains("allowed"), "{text}");
    }
}
