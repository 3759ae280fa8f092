//! The drive learns on its motor, with the shaft locked.

use drive_core::learning::Learned;
use drive_core::{Command, Mode, State};

use crate::config::{Config, LoadMode};
use crate::error::Error;
use crate::rig::Rig;

/// Longest that a drive may learn, s: 30 points of 31 s at most, and the start.
const LONGEST_S: u32 = 1000;

/// Has the drive of a bench learn; the shaft must be locked. It is off afterwards and works with what
/// it learned.
///
/// # Errors
/// When it refuses the command, or stops with a fault.
pub fn with(rig: &mut Rig) -> Result<Learned, Error> {
    rig.command(Command::Start(Mode::Learning))?;
    for _ in 0..LONGEST_S {
        rig.run(1.0, |_| {});
        match (rig.drive.state(), rig.drive.learned()) {
            (State::Off, Some(learned)) => return Ok(*learned),
            (State::Fault(fault), _) => {
                return Err(Error::Refused(format!("the drive does not learn: {fault}")));
            }
            _ => {}
        }
    }
    Err(Error::Refused(format!("the drive does not learn: it is {}", rig.drive.state())))
}

/// What the drive of the configuration learns.
///
/// # Errors
/// When the configuration is refused, or as [`with`].
pub fn on(config: &Config, seed: u64) -> Result<Learned, Error> {
    let mut config = config.clone();
    config.load.mode = LoadMode::Locked;
    with(&mut Rig::from_config(&config, seed)?)
}
