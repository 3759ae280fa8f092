//! Cost of one PWM period of the plant: it bounds how many times faster than real time the whole
//! simulation can be.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use drive_core::Compare;
use hil_sim::plant::{
    DcLinkSettings, FAMILIES, IronSettings, Load, MeasurementSettings, Plant, PlantSettings,
    SaliencySettings, WarmingSettings,
};

const PERIOD: f64 = 1.0 / 6000.0;

/// A rotating voltage of about 30 V at 20 Hz with 50 V at 600 Hz on it.
fn commands(top: u16) -> Vec<Compare> {
    let middle = 0.5 * f64::from(top);
    (0..300)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 300.0;
            let injection = (12.0 * angle).cos();
            let leg = |shift: f64| {
                let v = 30.0 * (angle - shift).cos() + 50.0 * injection * shift.cos();
                (middle + v / 311.0 * f64::from(top)) as u16
            };
            Compare { a: leg(0.0), b: leg(2.094), c: leg(4.189), enabled: true }
        })
        .collect()
}

fn period(c: &mut Criterion, name: &str, settings: &PlantSettings) {
    let mut plant = Plant::new(settings, 1).expect("settings of the benchmark");
    let commands = commands(settings.inverter.timer_top);
    let mut k = 0;
    c.bench_function(name, |b| {
        b.iter(|| {
            k = if k + 1 == commands.len() { 0 } else { k + 1 };
            plant.advance(black_box(&commands[k]), PERIOD);
            plant.sample()
        });
    });
}

fn plant(c: &mut Criterion) {
    let usual = PlantSettings::default();
    period(c, "averaged, free shaft, noise", &usual);
    let mut locked = usual;
    locked.mechanics.load = Load::Locked;
    period(c, "averaged, locked, noise", &locked);
    let mut quiet = usual;
    quiet.measurement = MeasurementSettings::IDEAL;
    period(c, "averaged, no noise, no filter", &quiet);
    let mut textbook = usual;
    textbook.saliency = SaliencySettings::NONE;
    period(c, "averaged, textbook machine", &textbook);
    let mut resistive = usual;
    resistive.saliency.chi = 1.0;
    period(c, "averaged, chi = 1", &resistive);
    let mut switched = usual;
    switched.inverter.switched = true;
    period(c, "switched", &switched);
    for family in FAMILIES {
        let settings = PlantSettings { iron: Some(family.iron), ..usual };
        period(c, &format!("energy model, {}", family.name), &settings);
    }
    // 200 times real time are 833 ns a period.
    period(c, "energy model, all effects", &all_effects());
}

/// Everything on at once.
fn all_effects() -> PlantSettings {
    let mut all = PlantSettings::default();
    let f = FAMILIES.iter().find(|family| family.name == "f").expect("f");
    all.iron = Some(IronSettings {
        slots: 0.003,
        stator_fixed: 0.003,
        stator_fixed_deg: 20.0,
        loss: 1500.0,
        ..f.iron
    });
    all.warming = WarmingSettings { rs: 0.3, rr: 0.4, ..all.warming };
    all.dc_link = DcLinkSettings { capacitor: 470e-6, chopper_v: 380.0, ..all.dc_link };
    all.inverter.extra_dead_time_us = 0.2;
    all.inverter.node_capacitance = 450e-12;
    all.inverter.on_resistance = 0.3;
    let m = &mut all.measurement;
    (m.cross_talk_a, m.cross_talk_b, m.lag_b_us, m.cubic_error) = (0.005, 0.005, 2.0, 0.005);
    (m.drift_a, m.drift_b, m.both_zero_vectors) = (1e-3, -1e-3, true);
    (m.dc_gain_error, m.dc_lag_us, m.dc_noise_v) = (0.005, 300.0, 0.5);
    let s = &mut all.mechanics;
    (s.static_torque, s.once_torque) = (0.05, 0.03);
    (s.load_inertia, s.stiffness, s.damping) = (0.009, 100.0, 0.01);
    all
}

criterion_group!(benches, plant);
criterion_main!(benches);
