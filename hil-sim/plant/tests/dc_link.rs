//! Checks of the dc link against the energy of motor and shaft, and against an independent integrator.

use std::f64::consts::TAU;

use crate::common::{T, compare, near, plant, settings};
use drive_core::Compare;
use motor_plant::{Complex, DcLinkSettings, InverterSettings, Load, Plant, PlantSettings};

const CAPACITOR: f64 = 470e-6;
const RESISTOR: f64 = 100.0;

fn link() -> DcLinkSettings {
    DcLinkSettings { capacitor: CAPACITOR, pulses: 0, source: 2.0, ..DcLinkSettings::default() }
}

/// Energy of capacitor, inductances and shaft of the linear machine, J.
fn stored(plant: &Plant, s: &PlantSettings) -> f64 {
    let (m, i, psi) = (&s.machine, plant.current(), plant.rotor_flux());
    let rotor = (psi - i * m.lm) / (m.lm + m.llr);
    let stator_flux = i * (m.lm + m.lls) + rotor * m.lm;
    let magnetic = 0.75 * (stator_flux * i.conj() + psi * rotor.conj()).re;
    let shaft = 0.5 * s.mechanics.inertia * plant.mechanical_speed().powi(2);
    0.5 * CAPACITOR * plant.dc_link().powi(2) + magnetic + shaft
}

/// Power that leaves motor, inverter and shaft as heat, W.
fn heat(plant: &Plant, s: &PlantSettings) -> f64 {
    let (m, i) = (&s.machine, plant.current());
    let rotor = (plant.rotor_flux() - i * m.lm) / (m.lm + m.llr);
    let switches: f64 =
        plant.phase_currents().iter().map(|i| s.inverter.residual_v * i.abs()).sum();
    let switches = switches + 1.5 * s.inverter.on_resistance * i.norm_sqr();
    let copper = 1.5 * (m.rs * i.norm_sqr() + m.rr * rotor.norm_sqr());
    copper + switches + s.mechanics.friction * plant.mechanical_speed().powi(2)
}

/// Without mains, the energy of capacitor, inductances and shaft is the initial energy minus the heat and minus the
/// energy of load and chopper. This holds during kinetic buffering, while the shaft brakes into the resistor, and after
/// the outputs have gone off.
#[test]
fn no_energy_is_lost_or_made_between_shaft_and_capacitor() {
    for switched in [false, true] {
        let mut s = settings();
        s.inverter = InverterSettings {
            residual_v: 1.64,
            on_resistance: 0.2,
            dead_time_us: 2.2,
            switched,
            ..InverterSettings::IDEAL
        };
        s.dc_link = DcLinkSettings { outage: 10.0, load: 5.0, ..link() };
        let mut plant = plant(&s);
        plant.set_load(Load::Speed { speed: 188.5 }).expect("a speed");
        plant.set_load(Load::Free { torque: 0.0 }).expect("free");
        let (mut expected, mut highest) = (stored(&plant, &s), 0.0_f64);
        let first = expected;
        for k in 0..3000_u32 {
            let (v, t) = (plant.dc_link(), f64::from(k) * T);
            let duty = if (0.2..0.3).contains(&t) { 0.3 } else { 0.0 };
            plant.set_chopper(duty);
            let before = heat(&plant, &s);
            // 56 Hz at 60 Hz of rotor speed: the motor generates. `compare` is for 311 V.
            let asked = Complex::cis(TAU * 56.0 * t) * (100.0 * 311.0 / v);
            plant.advance(&if t < 0.4 { compare(asked) } else { Compare::OFF }, T);
            let outside = 5.0 + duty * 0.5 * (v * v + plant.dc_link().powi(2)) / RESISTOR;
            expected -= T * (0.5 * (before + heat(&plant, &s)) + outside);
            highest = highest.max(plant.dc_link());
        }
        let (found, spent) = (stored(&plant, &s), first - expected);
        // The sums use the trapezoidal rule at the PWM rate: 0.1 % of the energy that flows.
        near(found - expected, 0.0, 0.001 * spent);
        let last = plant.dc_link();
        // The link was charged and never empty.
        assert!(highest > 320.0 && last > 20.0, "{highest} V, {last} V");
    }
}

/// Compares rectifier and resistance, constant power, sag, outage and chopper, with the outputs off, with steps of a
/// third of a microsecond of `C dv/dt = max(mains - v, 0)/R - P/v - duty v/R_b`.
#[test]
fn the_link_alone_is_that_of_its_equation() {
    let mut s = settings();
    s.dc_link = DcLinkSettings {
        load: 150.0,
        sag_at: 0.1,
        sag: 0.2,
        sag_v: 230.0,
        outage_at: 0.5,
        outage: 0.05,
        ..link()
    };
    let mut plant = plant(&s);
    let mut v = 311.0_f64;
    let (mut lowest, mut at_sag) = (v, 0.0);
    for k in 0..4800_u32 {
        let duty = if k > 4200 { 0.25 } else { 0.0 };
        plant.set_chopper(duty);
        plant.advance(&Compare::OFF, T);
        for n in 0..500 {
            let t = (f64::from(k) + (f64::from(n) + 0.5) / 500.0) * T;
            let sagging = ((t - 0.1).min(0.3 - t) / 0.01).clamp(0.0, 1.0);
            let peak = 311.0 - 81.0 * sagging;
            let mains = if (0.5..0.55).contains(&t) { 0.0 } else { peak };
            let current = (mains - v).max(0.0) / 2.0 - 150.0 / v - duty * v / RESISTOR;
            v += current / CAPACITOR * T / 500.0;
        }
        // The plant resolves instants to half a period. This matters for a link that falls by 1.1 V/ms, a ramp of 8.1
        // V/ms, and a charge from 270 V with 1 ms.
        let edge = if mains_moves(f64::from(k) * T) { 2.0 } else { 0.1 };
        near(plant.dc_link(), v, edge);
        lowest = lowest.min(v);
        if k == 1500 {
            at_sag = plant.dc_link();
        }
    }
    // 150 W through 2 ohm.
    near(at_sag, 230.0 - 2.0 * 150.0 / at_sag, 0.05);
    assert!(lowest < 255.0, "{lowest}");
}

/// Whether the mains voltage changes, or has changed within the last 20 ms.
fn mains_moves(t: f64) -> bool {
    [0.1, 0.3, 0.5, 0.55, 0.7].iter().any(|at| (-0.015..0.02).contains(&(t - at)))
}
