//! Events, which the command arbiter reports without a request.

use drive_core::homing::Failure;
use drive_core::{Fault, Stage, State};
use drive_settings::Settings;

use super::handle::CommandError;
use crate::commissioning;
use crate::link::Status;
use crate::settings::Commander;

/// Longest time between two progress reports of the self-commissioning, ms.
const PROGRESS_MS: u32 = 5000;

/// An event.
// Exists once at a time.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// The drive is in a fault.
    Fault(Fault),
    /// The drive regulates, in this state.
    Running(State),
    /// The outputs are off, for this reason.
    Off(&'static str),
    /// The saliency self-commissioning runs.
    Learning {
        /// The point that is being measured, from 1.
        point: usize,
        /// Number of points.
        points: usize,
        /// Expected time until the end, s.
        left_s: f32,
    },
    /// A self-commissioning has ended, with the result that [`Desk::learned`](super::Desk::learned) gives.
    Learned,
    /// The commissioning goes on, or has ended.
    Commissioning(commissioning::News),
    /// A homing has ended.
    Homed(Result<(), Failure>),
    /// The drive was stopped because the commander was silent for this time, s; or the reason why it was not stopped.
    Stopped(Result<f32, CommandError>),
    /// A request of bus or terminals was refused: [`Desk::refusal`](super::Desk::refusal).
    Refused(Commander),
}

/// Follows the state of the drive.
#[derive(Default)]
pub struct Announcer {
    /// The last state that was seen.
    state: Option<State>,
    /// The last state that was not part of a stop.
    active: State,
    /// The source of the stop; silence counts as the console. The source is not told that the drive is off, unless that takes a while.
    pub stopped: Option<Commander>,
    progress: Option<(usize, usize)>,
    told_ms: u32,
}

impl Announcer {
    /// The event of a report, if there is any, of a drive with these settings. `now_ms` wraps.
    pub fn next(&mut self, status: &Status, settings: &Settings, now_ms: u32) -> Option<News> {
        let state = status.state;
        let before = self.state.replace(state);
        if before == Some(state) {
            return self.learning(status, settings, now_ms);
        }
        let was = self.active;
        if !state.is_stopping() {
            self.active = state;
        }
        match state {
            State::Fault(fault) => Some(News::Fault(fault)),
            _ if state.regulates() || state == State::VoltsPerHertz => Some(News::Running(state)),
            State::Off => {
                let by = self.stopped.take();
                match (before?, was) {
                    (State::Fault(_), _) => None,
                    // The commissioning reports this itself.
                    (State::Exciting | State::CheckingWiring, State::Exciting) => None,
                    (State::Learning | State::Stopping, State::Learning) if by.is_none() => {
                        Some(News::Off("the learning has ended"))
                    }
                    // Reported also if no report came in between.
                    (state, _) if matches!(state.stage(), Stage::Running | Stage::Stopping) => {
                        Some(News::Off("stopped"))
                    }
                    // The stop acts at once and has been answered.
                    _ if by == Some(Commander::Console) => None,
                    _ if by.is_some() => Some(News::Off("stopped")),
                    _ => Some(News::Off("the start has ended")),
                }
            }
            State::Learning => {
                self.progress = None;
                self.learning(status, settings, now_ms)
            }
            _ => None,
        }
    }

    fn learning(&mut self, status: &Status, settings: &Settings, now_ms: u32) -> Option<News> {
        let (point, points) = status.learning?;
        let late = now_ms.wrapping_sub(self.told_ms) >= PROGRESS_MS;
        if self.progress == status.learning && !late {
            return None;
        }
        (self.progress, self.told_ms) = (status.learning, now_ms);
        Some(News::Learning { point, points, left_s: settings.learning().seconds_left(point) })
    }
}
