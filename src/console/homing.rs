//! The homing at the console.

use drive_core::homing::{Failure, Homing, Next, Plan, Seen};

use super::Console;
use super::handle::DriveHandle;

impl Console {
    /// Lets the drive look for a stop of the shaft.
    pub(super) fn home(&mut self, plan: Plan, drive: &mut impl DriveHandle) {
        let largest = self.settings.in_force().drive.current_limit_a();
        let homing = match Homing::new(plan, largest) {
            Ok(homing) => homing,
            Err(why) => return self.error(&why),
        };
        match drive.command(homing.begin()) {
            Ok(_) => {
                self.homing = Some(homing);
                self.ok();
            }
            Err(why) => self.error(&why),
        }
    }

    /// Goes on with the homing, if there is one; how it has ended.
    pub(super) fn go_on_homing(
        &mut self,
        drive: &mut impl DriveHandle,
    ) -> Option<Result<(), Failure>> {
        let (homing, status) = (self.homing.as_mut()?, drive.status()?);
        let seen = Seen {
            periods: status.periods,
            state: status.state,
            turns: status.telemetry.turns,
            i_q: status.telemetry.reference.q,
            room: status.room.i_q,
        };
        let outcome = match homing.poll(&seen) {
            Next::Wait => return None,
            Next::Command(command) => {
                // Refused when the drive has just stopped: the next report says so.
                let _ = drive.command(command);
                return None;
            }
            Next::Ended(outcome) => outcome,
        };
        self.homing = None;
        Some(outcome)
    }
}
