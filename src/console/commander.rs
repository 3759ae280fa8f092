//! Who commands, console or bus, and what its silence does.

use drive_core::{Command, Stop};

use super::Console;
use super::grammar::Request;
use super::handle::DriveHandle;
use crate::settings::bus::Commander;

/// Silence of the bus that commands after which the drive stops, s, unless `command.timeout_s` says otherwise.
const BUS_SILENT_S: f32 = 1.0;

impl Console {
    /// Who commands: by the staged settings, which a start puts in force.
    pub(super) fn commander(&self) -> Commander {
        self.settings.latest().bus.commander
    }

    /// Silence of the one that commands after which the drive stops, s; 0: never. A line of the bus that breaks is not
    /// seen by anybody, so the bus always has a limit.
    pub(super) fn command_timeout_s(&self) -> f32 {
        let set = self.settings.in_force().command.timeout_s;
        if set == 0.0 && self.commander() == Commander::Bus { BUS_SILENT_S } else { set }
    }

    /// Notes a valid line or frame: silence of the one that commands stops the drive.
    pub(super) fn heard(&mut self, from: Commander, now_ms: u32) {
        if self.commander() == from {
            self.heard_ms = Some(now_ms);
        }
        if from == Commander::Console {
            self.line_ms = Some(now_ms);
        }
    }

    /// Whether a line is refused because the bus commands. Stop, clear, and all that needs the drive off are not.
    pub(super) fn is_for_the_bus(&self, request: &Request) -> bool {
        self.commander() == Commander::Bus
            && matches!(
                request,
                Request::Start(_)
                    | Request::Learn { .. }
                    | Request::Commission(..)
                    | Request::Relock
                    | Request::Torque(_)
                    | Request::Speed(_)
                    | Request::Jog(_)
                    | Request::Position(_)
                    | Request::Home(_)
            )
    }

    /// Stops the drive when no valid line came for too long.
    pub(super) fn watch_silence(&mut self, drive: &mut impl DriveHandle, now_ms: u32) {
        if !self.out.as_str().is_empty() {
            return;
        }
        let (set, alive) = (self.command_timeout_s(), self.wire.alive_s());
        let since =
            |at: &mut Option<u32>| now_ms.wrapping_sub(*at.get_or_insert(now_ms)) as f32 * 1e-3;
        let (silence, link) = (since(&mut self.heard_ms), since(&mut self.line_ms));
        let lost = alive > 0.0 && link > alive;
        if lost {
            self.stop_stream(drive);
        }
        let limit = if lost && self.commander() == Commander::Console {
            alive
        } else if set > 0.0 && silence > set {
            set
        } else {
            return;
        };
        if !drive.is_off() {
            self.heard_ms = Some(now_ms);
            self.announcer.stopping();
            match drive.command(Command::Stop(Stop::Coast)) {
                Ok(_) => self.out.news(format_args!("stopped: no command for {limit} s")),
                Err(why) => self.out.news(format_args!("error: not stopped: {why}")),
            }
        }
    }
}
