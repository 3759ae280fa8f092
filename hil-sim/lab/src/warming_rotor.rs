//! A drive whose rotor warms up, with the online estimate that the idle loop of the firmware runs.

use rotor_id::online::{NoEstimate, Online, RotorEstimate, SAMPLE_S, SpeedInput};

use crate::identification::{Delta, Estimate, model_d};
use crate::prelude::*;

/// Calls of `refine` per second.
const REFINES_PER_S: f64 = 10.0;
/// Acceleration of the dynamometer, rpm/s: the sensorless angle can follow it.
const RAMP_RPM_PER_S: f64 = 150.0;

/// A run with a rotor that warms up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarmingCase {
    /// Speed that the dynamometer holds, rpm.
    pub speed_rpm: f64,
    /// q-axis current, A.
    pub iq_a: f64,
    /// Amplitude of the magnetising current's variation, A, and its frequency, Hz.
    pub excitation: (f64, f64),
    /// Whether the drive uses the estimate.
    pub used: bool,
    /// Times at which the rotor begins and ends to warm up, s, and the relative increase of r_r.
    pub warming: (f64, f64, f64),
    /// End of the run, s.
    pub seconds: f64,
}

/// State of the run, recorded every tenth of a second.
#[derive(Clone, Copy, Debug)]
pub struct WarmingMoment {
    /// Time, s.
    pub t: f64,
    /// True rotor time constant, s.
    pub tau_r: f64,
    /// True speed, electrical rad/s.
    pub omega_m: f64,
    /// The online estimate.
    pub estimate: Result<RotorEstimate, NoEstimate>,
    /// Model D from the same least squares.
    pub model_d: Estimate,
    /// Mean flux angle error, degrees.
    pub angle_error_deg: f64,
}

/// Runs a case. The configuration chooses the angle source; with the encoder the estimate also gets its speed.
///
/// # Errors
/// [`Error::Refused`] if the plant or the drive refuses the case, or the drive stops.
pub fn run(config: &Config, case: &WarmingCase, seed: u64) -> Result<Vec<WarmingMoment>, Error> {
    let settings = drive_settings::Settings { track_rotor: case.used, ..config.drive };
    let plant = plant_settings(config);
    let mut start = Config { drive: settings, ..config.clone() };
    start.load.mode = LoadMode::Locked;
    let mut rig = Rig::from_config(&start, seed)?;
    let mut online = Online::new(&settings).map_err(|_| {
        Error::Refused("the settings do not suit the estimation of the rotor time constant".into())
    })?;
    rig.start(Mode::Torque)?;
    rig.command(&Command::Torque(config.amperes(case.iq_a) as f32))?;
    let steps = 1 + (100.0 * case.speed_rpm.abs() / RAMP_RPM_PER_S) as u32;
    for n in 1..=steps {
        let rpm = case.speed_rpm * f64::from(n) / f64::from(steps);
        rig.set_load(Load::Speed { speed: config.rpm(rpm) * TAU / 60.0 })?;
        rig.wait(0.01);
    }
    rig.wait(1.0);

    let (pole_pairs, i_d) = (f64::from(plant.machine.pole_pairs), f64::from(config.drive.i_d()));
    let encoder = config.drive.angle_source == AngleSource::Encoder;
    let block = (RATE_HZ / REFINES_PER_S) as usize;
    let mut moments = Vec::new();
    for n in 0..(case.seconds * REFINES_PER_S) as usize {
        let t = n as f64 / REFINES_PER_S;
        let (from, to, growth) = case.warming;
        let share = ((t - from) / (to - from)).clamp(0.0, 1.0);
        let warm = plant.machine.rr * (1.0 + growth * share);
        rig.plant.set_resistances(plant.machine.rs, warm).map_err(Error::refused)?;

        let mut angle_error = 0.0;
        for k in 0..block {
            if case.excitation.0 > 0.0 && k.is_multiple_of(block / 10) {
                let t = t + k as f64 / RATE_HZ;
                let more = config.amperes(case.excitation.0) * (TAU * case.excitation.1 * t).sin();
                rig.command(&Command::Magnetising((i_d + more) as f32))?;
            }
            rig.run(1.0 / RATE_HZ, |p| angle_error += p.angle_error_deg / block as f64);
            let telemetry = rig.drive.telemetry();
            online.push(telemetry.measured, telemetry.realised);
        }
        let telemetry = rig.drive.telemetry();
        let seen = telemetry.rotor_freq * (TAU * RATE_HZ) as f32;
        let speed = if encoder { SpeedInput::Known(seen) } else { SpeedInput::Guess(seen) };
        let estimate = online.refine(telemetry.reference, speed);
        if let (true, Ok(tracked)) = (case.used, &estimate) {
            rig.command(&Command::RotorTimeConstant(tracked.tau_r))?;
        }
        let theta = online.rls().latest().map(|x| Complex64::new(x.re.into(), x.im.into()));
        moments.push(WarmingMoment {
            t: (n + 1) as f64 / REFINES_PER_S,
            tau_r: rig.plant.tau_r(),
            omega_m: rig.plant.mechanical_speed() * pole_pairs,
            estimate,
            model_d: model_d(&Delta::from_array(theta), SAMPLE_S.into()),
            angle_error_deg: angle_error,
        });
    }
    Ok(moments)
}
