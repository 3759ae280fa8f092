//! Limits of the q-axis current, in proportion to which the runs have their currents and torques.

use crate::prelude::*;

/// Largest q-axis current of the dissertation's drive, A.
pub const MOST_A: f64 = 3.0;

/// The q-axis current, A peak, that the drive's current limit leaves beside the magnetising current.
pub fn torque_limit_a(config: &Config) -> f64 {
    let (all, i_d) = (f64::from(config.drive.current_limit_a()), f64::from(config.drive.i_d()));
    (all * all - i_d * i_d).max(0.0).sqrt()
}

/// The nominal limit of the q-axis current, A peak: the current that the drive's limit leaves beside the magnetising
/// current. With the dissertation's flux it is at most the 3 A of the speed loop. A drive that has learned a lower
/// limit is still judged by the nominal one.
pub fn nominal_limit_a(config: &Config) -> f64 {
    match config.drive.sequence.flux {
        Flux::Low => torque_limit_a(config).min(config.amperes(MOST_A)),
        Flux::High => torque_limit_a(config),
    }
}

/// Scales a q-axis current of a run, A on the dissertation's motor, in proportion to the [nominal limit](nominal_limit_a), A peak.
pub fn share_of_limit(config: &Config, on_reference: f64) -> f64 {
    on_reference * (nominal_limit_a(config) / MOST_A)
}

/// Torque, Nm, of a q-axis current, A peak, at the right angle and the flux of the magnetising current: 3/2 P L_m^2/L_r
/// i_d i_q.
pub fn torque_nm(config: &Config, i_q: f64) -> f64 {
    i_q * f64::from(config.drive.motor.torque_per_ampere(config.drive.i_d()))
}

/// Returns the q-axis current that a drive which is off would accept if commanded this one, A peak.
///
/// # Errors
/// If the drive refuses it.
pub fn allowed_a(drive: &Drive, asked: f64) -> Result<f64, Error> {
    let mut drive = drive.clone();
    drive.command(&Command::Start(Mode::Torque)).map_err(Error::refused)?;
    match drive.command(&Command::Torque(asked as f32)).map_err(Error::refused)? {
        Accepted::Limited(taken) => Ok(taken.into()),
        Accepted::AsGiven => Ok(asked),
    }
}
