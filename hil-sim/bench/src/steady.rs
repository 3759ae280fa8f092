//! A run at constant q-axis current and speed, the unit of the statistics.

use crate::prelude::*;
use crate::statistics::fault_code;
use crate::stats::exact;

/// Operating point and seed of a run.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct OperatingPoint {
    /// Speed, rpm.
    pub rpm: f64,
    /// q-axis current, A.
    #[serde(rename = "iq_a")]
    pub iq: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Result of a run.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct SteadyRun {
    /// Operating point and seed.
    pub case: OperatingPoint,
    /// Angle error, degrees.
    pub error: Stats,
    /// Mean torque, Nm.
    #[serde(with = "exact", rename = "torque_nm")]
    pub torque: f64,
    /// Whether the angle error exceeded 45° at any time, or the drive stopped itself.
    pub lost: bool,
    /// The fault with which the drive stopped itself.
    #[serde(with = "fault_code")]
    pub fault: Option<Fault>,
}

impl SteadyRun {
    /// Returns the reason why the lock was lost, after the operating point; nothing if the lock held.
    pub fn lost_text(&self) -> Option<String> {
        let OperatingPoint { rpm, iq, seed } = self.case;
        let angle = || format!("angle error beyond {LOST_DEG}°");
        let reason = self.fault.map_or_else(angle, fault_text);
        self.lost.then(|| format!("{iq:.2} A at {rpm:.0} rpm, seed {seed}: {reason}"))
    }
}

/// Acceleration of the dynamometer, rpm/s.
const RAMP_RPM_PER_S: f64 = 600.0;

/// Makes a drive that has been started, brought up to speed without torque, and given its torque.
///
/// # Errors
/// If the configuration is refused or the drive does not start.
pub fn at_speed(config: &Config, case: OperatingPoint) -> Result<Rig, Error> {
    let mut rig = prepared(config, case.seed)?;
    bring_up(&mut rig, case.rpm)?;
    rig.command(&Command::Torque(case.iq as f32))?;
    Ok(rig)
}

/// Makes a drive that is off, coupled to a dynamometer at rest.
///
/// # Errors
/// As [`Rig::from_config`].
pub fn prepared(config: &Config, seed: u64) -> Result<Rig, Error> {
    let mut config = config.clone();
    config.load.mode = LoadMode::Speed;
    config.load.speed_rpm = 0.0;
    Rig::from_config(&config, seed)
}

/// Starts a drive and brings it up to speed, rpm, without torque. The drive may have stopped itself on the way.
///
/// # Errors
/// If the drive does not start.
pub fn bring_up(rig: &mut Rig, rpm: f64) -> Result<(), Error> {
    rig.start(Mode::Torque)?;
    let steps = (rpm.abs() / RAMP_RPM_PER_S / 0.01).ceil() as u32;
    rig.bring_to(rpm, steps, 0.01)?;
    rig.wait(0.3);
    Ok(())
}

/// Runs at speed and torque: one second to settle, then `seconds` that are judged.
///
/// # Errors
/// If the configuration is refused or the drive does not start.
pub fn steady_run(config: &Config, case: OperatingPoint, seconds: f64) -> Result<SteadyRun, Error> {
    judged(prepared(config, case.seed)?, case, seconds)
}

/// Does a [`steady_run`] with a drive that is off.
///
/// # Errors
/// If the drive does not start.
pub fn judged(mut rig: Rig, case: OperatingPoint, seconds: f64) -> Result<SteadyRun, Error> {
    bring_up(&mut rig, case.rpm)?;
    if let Some(fault) = rig.drive.state().fault() {
        return Ok(SteadyRun { case, lost: true, fault: Some(fault), ..SteadyRun::default() });
    }
    rig.settle(&Command::Torque(case.iq as f32), 1.0)?;
    let [error, torque] = rig.stats(seconds, |p| [p.angle_error_deg, p.torque]);
    let fault = rig.drive.state().fault();
    let lost = is_lost(error.largest(), fault.is_some());
    Ok(SteadyRun { case, error, torque: torque.mean(), lost, fault })
}
