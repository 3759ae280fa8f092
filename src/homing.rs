//! Homing: the command arbiter lets the drive look for a stop of the shaft.

use drive_core::homing::{Failure, Homing as Search, Next, Plan, Seen};

use crate::desk::handle::DriveHandle;
use crate::desk::order::Refusal;

/// A homing, and the result of the last one until it is announced.
#[derive(Default)]
pub struct Homing {
    search: Option<Search>,
    ended: Option<Result<(), Failure>>,
}

impl Homing {
    /// Starts the search. The drive limits the q-axis current to `limit_a`.
    ///
    /// # Errors
    /// A number of the plan is out of range, or the drive refuses.
    pub fn begin(
        &mut self,
        plan: Plan,
        limit_a: f32,
        drive: &mut impl DriveHandle,
    ) -> Result<(), Refusal> {
        let search = Search::new(plan, limit_a)?;
        drive.command(search.begin())?;
        self.search = Some(search);
        Ok(())
    }

    /// Ends the search, because another position is requested.
    pub fn cancel(&mut self) {
        self.search = None;
    }

    /// Continues the search.
    pub fn poll(&mut self, drive: &mut impl DriveHandle) {
        let (Some(search), Some(status)) = (&mut self.search, drive.status()) else { return };
        let seen = Seen {
            periods: status.periods,
            state: status.state,
            turns: status.telemetry.turns,
            i_q: status.telemetry.reference.q,
            room: status.torque_limits.i_q,
        };
        match search.poll(&seen) {
            Next::Wait => {}
            Next::Command(command) => {
                // The drive refuses it if it has just stopped: the next report says so.
                let _ = drive.command(command);
            }
            Next::Ended(outcome) => (self.search, self.ended) = (None, Some(outcome)),
        }
    }

    /// The result of a homing that has ended since the last call.
    pub fn news(&mut self) -> Option<Result<(), Failure>> {
        self.ended.take()
    }
}
