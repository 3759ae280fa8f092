//! Tests with all outputs off: the diodes bring the currents to zero.

use std::f64::consts::TAU;

use crate::common::{T, behind, compare, plant};
use drive_core::Compare;
use motor_plant::{
    Complex, InverterSettings, Load, Machine, MachineSettings, MachineState, Mechanics,
    MechanicsSettings, MotorModel, Plant, SaliencySettings, clarke, phases,
};

/// Returns a motor at a held speed after 0.3 s of a voltage of `volts` that rotates synchronously from `start`, and the
/// angle by which both rotate in a period, rad.
fn magnetised(rpm: f64, volts: f64, start: f64) -> (Plant, f64) {
    let speed = rpm * TAU / 60.0;
    let mut settings = behind(InverterSettings::default());
    settings.mechanics.load = Load::Speed { speed };
    let mut plant = plant(&settings);
    let turning = 2.0 * speed * T;
    for k in 0..1800 {
        let angle = start + turning * f64::from(k);
        plant.advance(&compare(Complex::from_polar(volts, angle)), T);
    }
    (plant, turning)
}

#[test]
fn outputs_off_ends_the_current_and_keeps_it_at_zero() {
    for rpm in [0.0, 30.0, 1440.0] {
        for direction in 0..24 {
            let start = TAU * f64::from(direction) / 24.0 + 0.01;
            let (mut plant, turning) = magnetised(rpm, 22.0, start);
            assert!(plant.current().norm() > 0.15, "{rpm} rpm: {}", plant.current());
            let mut periods = 0;
            while plant.current() != Complex::ZERO {
                let before = plant.current().norm();
                plant.advance(&Compare::OFF, T);
                assert!(plant.current().norm() < before, "{rpm} rpm: the current must fall");
                periods += 1;
                // 4 A from 207 V on 52 mH take a millisecond.
                assert!(periods < 12, "{rpm} rpm: {} A is left", plant.current());
            }
            let (flux, angle) = (plant.rotor_flux().norm(), plant.rotor_flux_angle());
            for _ in 0..600 {
                plant.advance(&Compare::OFF, T);
                assert_eq!(plant.current(), Complex::ZERO);
            }
            // psi decays by rr/Lr = 5.37 1/s and rotates with the rotor.
            let decayed = flux * (-1.1f64 / 0.2047 * 0.1).exp();
            let turned = Complex::from_polar(1.0, angle + 600.0 * turning);
            let expected = turned * decayed;
            assert!((plant.rotor_flux() - expected).norm() < 1e-7 * flux, "{rpm} rpm");
            // The terminals show the back-EMF, (Lm/Lr) |alpha - j w| psi.
            let w = 2.0 * rpm * TAU / 60.0;
            let emf = 0.1771 / 0.2047 * (1.1f64 / 0.2047).hypot(w) * decayed;
            // The voltage is averaged over a period in which it rotates and decays a little.
            let v = plant.applied_voltage().norm();
            assert!((v - emf).abs() < 2e-3 * emf + 1e-9, "{rpm} rpm: {v} V, not {emf}");
        }
    }
}

#[test]
fn with_the_outputs_off_a_high_emf_charges_the_link_and_a_low_one_does_not() {
    let mut s = behind(InverterSettings { residual_v: 0.0, ..Default::default() });
    let speed = 1440.0 * TAU / 60.0;
    s.mechanics.load = Load::Speed { speed };
    let mut plant = plant(&s);
    for k in 0..3000 {
        let angle = 2.0 * speed * T * f64::from(k);
        plant.advance(&compare(Complex::from_polar(40.0, angle)), T);
    }
    for _ in 0..20 {
        plant.advance(&Compare::OFF, T);
    }
    assert_eq!(plant.current(), Complex::ZERO);
    // The line-to-line back-EMF is sqrt(3) of its magnitude.
    let emf = plant.applied_voltage().norm() * 3f64.sqrt();
    plant.set_dc_link(1.05 * emf).expect("voltage");
    for _ in 0..20 {
        plant.advance(&Compare::OFF, T);
        assert_eq!(plant.current(), Complex::ZERO);
    }
    plant.set_dc_link(0.3 * emf).expect("voltage");
    let (mut most, mut charged) = (0f64, 0f64);
    for _ in 0..200 {
        plant.advance(&Compare::OFF, T);
        let i = plant.current();
        assert!(i.is_finite());
        most = most.max(i.norm());
        // Power into the machine, from the mean voltage of the period and the current at its end.
        charged -= 1.5 * (i.conj() * plant.applied_voltage()).re * T;
    }
    assert!(most > 0.05 && charged > 0.0, "{most} A, {charged} J");
    // The energy comes from the flux, so the flux and the current decay.
    for _ in 0..12_000 {
        plant.advance(&Compare::OFF, T);
    }
    assert_eq!(plant.current(), Complex::ZERO);
}

/// Largest difference of the currents, A, over these periods with the outputs off, from a bridge whose diodes are not
/// ideal: its legs go from rail to rail between -1 mA and 1 mA.
fn worst_against_soft_diodes(plant: &mut Plant, periods: u32) -> f64 {
    let load = Load::Speed { speed: plant.mechanical_speed() };
    let shaft = Mechanics::new(&MechanicsSettings { load, ..Default::default() }).expect("shaft");
    let machine = Machine::new(&MachineSettings::DEFAULT, &SaliencySettings::DEFAULT);
    let mut reference = MotorModel::new(machine.expect("machine"), shaft);
    let (i, psi) = (plant.current(), plant.rotor_flux());
    reference.state.electrical = MachineState { i, psi, ..Default::default() };
    let vdc = plant.dc_link();
    let mut worst = 0f64;
    for _ in 0..periods {
        plant.advance(&Compare::OFF, T);
        // 311 V/2 mA on 51 mH is a pole at 3e6 rad/s; the Runge-Kutta method is stable up to 2.7 of it per step.
        for _ in 0..400 {
            let legs = phases(reference.state.electrical.i).map(|i| (-i / 1e-3).clamp(-1.0, 1.0));
            reference.step(clarke(legs) * (0.5 * vdc), T / 400.0);
        }
        worst = worst.max((plant.current() - reference.state.electrical.i).norm());
    }
    worst
}

#[test]
fn outputs_off_is_a_bridge_of_diodes() {
    let mut worst = 0f64;
    for rpm in [0.0, 1440.0] {
        for direction in 0..12 {
            let start = TAU * f64::from(direction) / 12.0 + 0.1;
            let (mut plant, _) = magnetised(rpm, 40.0, start);
            assert!(plant.current().norm() > 0.4, "{}", plant.current());
            // First the current decays against a high link. Then the link is below the back-EMF, if there is one, and
            // the diodes conduct again and again through several turns of the rotor.
            worst = worst.max(worst_against_soft_diodes(&mut plant, 8));
            plant.set_dc_link(20.0).expect("voltage");
            worst = worst.max(worst_against_soft_diodes(&mut plant, 200));
        }
    }
    // The soft diodes carry up to 1 mA in each phase when the ideal ones carry none, and switch correspondingly later.
    assert!(worst < 3e-3, "{worst} A");
}
