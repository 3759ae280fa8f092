//! The switching frequency of the inverter: the effect of 12 and 18 kHz, compared with 6 kHz. `docs/performance.md` has the table.

use std::f64::consts::TAU;

use drive_core::current::Modulator;
use drive_core::{Abc, AlphaBeta, AngleSource, Command, Mode};
use drive_settings::Carrier;
use hil_sim::config::LoadMode;
use hil_sim::plant::{Complex, clarke};
use hil_sim::rig::Rig;
use hil_sim::{Config, Error};

/// Returns the dissertation's motor with this switching frequency; every edge is simulated.
fn config(carrier: Carrier) -> Config {
    let mut config = Config::default();
    config.drive.inverter.switching_khz = carrier;
    config.inverter.switched = true;
    config
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, n), value| (sum + value * value, n + 1));
    (sum / f64::from(count)).sqrt()
}

/// Measures, from the samples of a run at a speed with the encoder and without injection, the rms of the current
/// without its fundamental, in % of the fundamental, and of the torque without its mean, in % of the mean.
fn turning(carrier: Carrier, seed: u64) -> Result<[f64; 2], Error> {
    let mut config = config(carrier);
    config.drive.angle_source = AngleSource::Encoder;
    (config.load.mode, config.load.speed_rpm) = (LoadMode::Speed, 150.0);
    let mut rig = Rig::started(&config, seed, Mode::Torque)?;
    rig.settle(&Command::Torque(1.5), 2.0)?;
    let (mut currents, mut torques) = (Vec::new(), Vec::new());
    for _ in 0..12_000 {
        rig.step();
        let along = Complex::from_polar(1.0, -rig.plant.rotor_flux_angle());
        currents.push(rig.plant.current() * along);
        torques.push(rig.plant.torque());
    }
    assert_eq!(rig.fault(), None);
    let n = currents.len() as f64;
    let (i, torque) = (currents.iter().sum::<Complex>() / n, torques.iter().sum::<f64>() / n);
    Ok([
        100.0 * rms(currents.iter().map(|one| (one - i).norm())) / i.norm(),
        100.0 * rms(torques.iter().map(|one| one - torque)) / torque,
    ])
}

/// Measures the angle error of a drive that has learned, at standstill: degrees rms around the mean, and the mean.
fn standing(carrier: Carrier, seed: u64) -> Result<[f64; 2], Error> {
    let mut config = config(carrier);
    config.load.mode = LoadMode::Locked;
    config.prepare.learn = true;
    let mut rig = Rig::started(&config, seed, Mode::Torque)?;
    rig.settle(&Command::Torque(1.5), 1.0)?;
    let mut errors = Vec::new();
    rig.run(4.0, |point| errors.push(point.angle_error_deg));
    assert_eq!(rig.fault(), None);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    Ok([rms(errors.iter().map(|error| error - mean)), mean])
}

/// Ripple of the pulses between the samples, A rms: the voltage of ideal legs minus its mean over a pulse, applied to
/// the leakage inductance, over one revolution of 50 V.
fn ripple(carrier: Carrier) -> f64 {
    let settings = config(carrier).drive;
    let (period, vdc) = (f64::from(settings.inverter.carrier_s()), 311.0);
    let modulator = Modulator::new(0.0, settings.inverter.carrier_s(), false);
    const STEPS: u32 = 600;
    let mut squares = Vec::new();
    for k in 0..90 {
        let angle = TAU * f64::from(k) / 90.0;
        let wanted = AlphaBeta::new((50.0 * angle.cos()) as f32, (50.0 * angle.sin()) as f32);
        let duties = modulator.step(wanted, Abc::ZERO, vdc as f32).duties;
        let mean = clarke(duties.map(|duty| vdc * f64::from(duty)));
        let mut i = Complex::ZERO;
        for step in 0..STEPS {
            // From the top of the counter, where the low sides are on.
            let count = (f64::from(2 * step + 1) / f64::from(STEPS) - 1.0).abs();
            let v = clarke(duties.map(|duty| if count < f64::from(duty) { vdc } else { 0.0 }));
            i += (v - mean) * (period / f64::from(STEPS) / f64::from(settings.motor.sigma_l_s()));
            squares.push(i.norm());
        }
    }
    rms(squares.into_iter())
}

/// Each pulse has its own dead time, which the drive knows. Faster legs therefore have little effect on the samples,
/// and the ripple between the samples falls in proportion to the frequency.
#[test]
fn faster_legs_have_less_ripple_and_the_drive_stands_their_dead_time() {
    let slow = ripple(Carrier::Khz6);
    // Limits for current, torque, angle: a fifth above the values of three seeds.
    for (carrier, most_current, most_torque, most_deg) in [
        (Carrier::Khz6, 0.3, 0.23, 1.8),
        (Carrier::Khz12, 0.4, 0.28, 2.1),
        (Carrier::Khz18, 0.46, 0.3, 2.7),
    ] {
        let ripple = ripple(carrier);
        let share = ripple * f64::from(carrier.pulses()) / slow;
        assert!((share - 1.0).abs() < 0.02, "{carrier:?}: {share} of the one at 6 kHz per rate");
        let [current, torque] = turning(carrier, 1).unwrap();
        let [deg, mean] = standing(carrier, 1).unwrap();
        assert!(current < most_current && torque < most_torque, "{carrier:?}: {current} {torque}");
        assert!(deg < most_deg && mean.abs() < 1.5, "{carrier:?}: {deg} {mean}");
    }
}
