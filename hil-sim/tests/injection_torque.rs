//! Torque ripple of the injection: the figure that the program shows, the simulated motor, and an independent integration of the machine's
//! equations agree.

use std::f64::consts::TAU;

use drive_core::{Command, Mode};
use drive_settings::Settings;
use hil_sim::Config;
use hil_sim::config::LoadMode;
use hil_sim::plant::Complex;
use hil_sim::rig::Rig;

/// Rate of the control, Hz, and of the independent integration.
const RATE: usize = 6000;
const FINE: usize = 1_000_000;

/// Returns the amplitude at 600 Hz of values that are sampled at a rate over whole injection periods.
fn at_600_hz(values: &[f64], rate: usize) -> f64 {
    let turn = |k: usize| Complex::from_polar(1.0, -TAU * 600.0 * k as f64 / rate as f64);
    let sum: Complex = values.iter().enumerate().map(|(k, value)| turn(k) * *value).sum();
    2.0 * sum.norm() / values.len() as f64
}

/// Integrates stator current and rotor flux of the locked machine in the stator's frame, by the T circuit, in steps of 1 us. Along the flux the voltage carries the d-axis current, across it there is the injection, which changes once a control period.
fn integrated(settings: &Settings) -> f64 {
    let m = &settings.motor;
    let [r_s, r_r, l_ls, l_lr, l_m] = [m.r_s, m.r_r, m.l_ls, m.l_lr, m.l_m].map(f64::from);
    let (l_s, l_r) = (l_m + l_ls, l_m + l_lr);
    let [i_d, volts] = [settings.i_d(), settings.carrier_v()].map(f64::from);
    let (mut i, mut psi) = (Complex::new(i_d, 0.0), Complex::new(l_m * i_d, 0.0));
    let mut torques = Vec::new();
    for k in 0..FINE / 5 {
        let injection = volts * (TAU * 600.0 * (k * RATE / FINE) as f64 / RATE as f64).sin();
        let v = Complex::new(r_s * i_d, injection);
        let d_psi = (i * l_m - psi) * (r_r / l_r);
        let d_i = (v - i * r_s - d_psi * (l_m / l_r)) / (l_s - l_m * l_m / l_r);
        (i, psi) = (i + d_i / FINE as f64, psi + d_psi / FINE as f64);
        torques.push(1.5 * f64::from(m.pole_pairs) * l_m / l_r * (psi.conj() * i).im);
    }
    // The second half, without the transient of the first periods: 60 injection periods.
    at_600_hz(&torques[FINE / 10..], FINE)
}

/// Returns the torque ripple of the drive on its simulated motor, with a locked shaft and no torque.
fn simulated(config: &Config) -> f64 {
    let mut rig = Rig::started(config, 1, Mode::Torque).expect("a learned drive");
    rig.settle(&Command::Torque(0.0), 0.5).expect("no torque");
    let torques: Vec<_> = (0..RATE).map(|_| (rig.step(), rig.plant.torque()).1).collect();
    assert_eq!(rig.fault(), None);
    at_600_hz(&torques, RATE)
}

#[test]
fn the_shown_torque_ripple_is_that_of_the_motor() {
    for name in ["dissertation", "motulator-2kw2", "krause-3hp", "spindle-2kw2"] {
        let mut config = Config::of_motor(Some(name)).unwrap();
        config.load.mode = LoadMode::Locked;
        let shown = f64::from(config.drive.injection_nm());
        for (by, nm) in
            [("integrated", integrated(&config.drive)), ("simulated", simulated(&config))]
        {
            assert!((nm / shown - 1.0).abs() < 0.1, "{name}: shown {shown} Nm, {by} {nm} Nm");
        }
    }
}
