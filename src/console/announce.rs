//! Announcements: changes of the drive's state that the console tells unasked.

use core::fmt;

use drive_core::learned::Learned;
use drive_core::{Fault, State};
use drive_settings::Settings;

use crate::link::Status;

/// Longest silence while the drive learns, ms.
const PROGRESS_MS: u32 = 5000;

/// Asymmetry that no gain mismatch explains from which on a second rotor position is advised.
const UNEXPLAINED: f32 = 0.002;

/// An announcement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// The drive is in a fault.
    Fault(Fault),
    /// The drive regulates, in this state.
    Running(State),
    /// The outputs are off, for this reason.
    Off(&'static str),
    /// It learns.
    Learning {
        /// The point that is being measured, from 1 on.
        point: usize,
        /// Number of points.
        points: usize,
        /// Expected time until the end, s.
        left_s: f32,
    },
}

/// Follows the state of the drive.
pub struct Announcer {
    /// The last state that was seen.
    state: Option<State>,
    /// The last one but for those of a stop.
    active: State,
    /// Whether the console has stopped the drive.
    stopped: bool,
    progress: Option<(usize, usize)>,
    told_ms: u32,
}

impl Announcer {
    /// One that has seen nothing yet.
    pub const fn new() -> Self {
        Self { state: None, active: State::Off, stopped: false, progress: None, told_ms: 0 }
    }

    /// Notes that the console stops the drive: off is no news then, unless it takes a while.
    pub fn stopping(&mut self) {
        self.stopped = true;
    }

    /// The news of a report, if there are any, of a drive with these settings. `now_ms` wraps.
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
            State::Torque | State::Speed | State::Position | State::VoltsPerHertz => {
                Some(News::Running(state))
            }
            State::Off => {
                let asked = core::mem::take(&mut self.stopped);
                match (before?, was) {
                    (State::Fault(_), _) => None,
                    // The commissioning says so itself.
                    (State::Exciting | State::CheckingWiring, State::Exciting) => None,
                    (State::Learning | State::Stopping, State::Learning) if !asked => {
                        Some(News::Off("the learning has ended"))
                    }
                    (state, _) if state.is_stopping() || state == State::VoltsPerHertz => {
                        Some(News::Off("stopped"))
                    }
                    // At once, and answered.
                    _ if asked => None,
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

impl fmt::Display for News {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(fault) => {
                let likely = fault.causes().first().copied().unwrap_or_default();
                write!(f, "fault {}: {fault}; likely: {likely}; type 'clear'", fault.code())
            }
            Self::Running(State::Speed) => f.write_str("running: speed"),
            Self::Running(State::Position) => f.write_str("running: position"),
            Self::Running(State::VoltsPerHertz) => f.write_str("running: vf"),
            Self::Running(_) => f.write_str("running: torque"),
            Self::Off(why) => write!(f, "off: {why}"),
            Self::Learning { point, points, left_s } => {
                write!(f, "learning: point {point} of {points}, {left_s:.0} s left")
            }
        }
    }
}

/// The announcement of a learning's result.
pub fn outcome(result: &Learned) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        if result.verdict.is_accepted() {
            write!(f, "learned: {result}; ")?;
            let tracks = result.slope.is_some();
            if tracks && result.positions == 1 && result.gain_mismatch.misfit > UNEXPLAINED {
                f.write_str(
                    "one rotor position: `learn again` at another tells slots from the stator; ",
                )?;
            }
            f.write_str("`save` keeps it")
        } else {
            write!(f, "refused: {result}")
        }
    })
}
