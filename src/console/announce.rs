//! The text of the events, in lines that come unrequested.

use core::fmt;

use drive_commission::Step;
use drive_core::State;
use drive_core::learned::Learned;
use drive_settings::value::Words as _;

use super::Console;
use super::handle::Firmware;
use super::reply;
use crate::ModuleState;
use crate::commissioning;
use crate::desk::Desk;
use crate::desk::news::News;

/// Asymmetry that no gain mismatch explains, above which a second rotor position is advised.
const UNEXPLAINED: f32 = 0.002;

/// Remark beside the start of a speed loop that is designed for an inertia by rule.
const ASSUMED: &str = "; inertia assumed: `commission inertia` measures it";

/// Remark beside a fault of a drive with a brake.
const HANGS: &str = "; the brake closes now and holds the load alone";

impl Console {
    /// Writes the next events, if there are any, on lines of their own.
    pub(super) fn announce(&mut self, desk: &mut Desk, drive: &mut impl Firmware, now_ms: u32) {
        let typed = desk.settings().in_force().command.echo && self.reader.begun();
        if typed {
            self.out.raw("\r\n");
        }
        let empty = self.out.as_str().len();
        if let Some((news, line)) = self.commissioned {
            self.tell_commissioning(news, line);
        } else if let Some(news) = desk.news(drive, now_ms) {
            self.tell(news, desk);
        } else if self.armed && !drive.tracing() {
            self.armed = false;
            self.out.news(format_args!("trace: recorded; `trace` prints it"));
        }
        if self.out.as_str().len() == empty {
            self.out.clear();
        } else if typed {
            self.out.raw(self.reader.text());
        }
    }

    /// Writes a line about the commissioning, and keeps the event for the next line.
    fn tell_commissioning(&mut self, news: commissioning::News, line: usize) {
        let (text, next) = told(&news, line);
        self.out.news(format_args!("commissioning: {text}"));
        self.commissioned = next.map(|line| (news, line));
    }

    /// Writes an event.
    pub(super) fn tell(&mut self, news: News, desk: &Desk) {
        let out = &mut self.out;
        match news {
            News::Fault(fault) => {
                let likely = fault.causes().first().copied().unwrap_or_default();
                let code = fault.code();
                let brake = ModuleState::brake_s(desk.settings().in_force()).map_or("", |_| HANGS);
                out.news(format_args!(
                    "fault {code}: {fault}; likely: {likely}; type 'clear'{brake}"
                ));
            }
            News::Running(state @ (State::Speed | State::Position)) => {
                let mode = if state == State::Speed { "speed" } else { "position" };
                let is_assumed = desk.settings().in_force().drive.inertia.is_none();
                let assumed = if is_assumed { ASSUMED } else { "" };
                out.news(format_args!("running: {mode}{assumed}"));
            }
            News::Running(State::VoltsPerHertz) => out.news(format_args!("running: vf")),
            News::Running(_) => out.news(format_args!("running: torque")),
            News::Off(why) => out.news(format_args!("off: {why}")),
            News::Learning { point, points, left_s } => {
                out.news(format_args!("learning: point {point} of {points}, {left_s:.0} s left"));
            }
            News::Learned => {
                let Some((_, result)) = desk.learned() else { return };
                out.news(format_args!("{}", outcome(result)));
                let drive = &desk.settings().in_force().drive;
                if let Some(tracked) = drive.tracked(result) {
                    let ripple = reply::ripple(drive, result);
                    out.news(format_args!("learned: {tracked}; {ripple}"));
                }
            }
            News::Commissioning(news) => self.tell_commissioning(news, 0),
            News::Homed(Ok(())) => out.news(format_args!("homing: position 0 is at the stop")),
            News::Homed(Err(why)) => out.news(format_args!("homing: {why}")),
            News::Stopped(Ok(s)) => out.news(format_args!("stopped: no command for {s} s")),
            News::Stopped(Err(why)) => out.news(format_args!("error: not stopped: {why}")),
            News::Refused(from) => {
                if let Some(why) = desk.refusal() {
                    out.news(format_args!("{}: refused: {why}", from.word()));
                }
            }
        }
    }
}

/// The announcement of a self-commissioning's result.
fn outcome(result: &Learned) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        if result.verdict.is_accepted() {
            write!(f, "learned: {result}; ")?;
            let tracks = result.slope.is_some();
            if tracks && result.positions == 1 && result.gain_mismatch.misfit > UNEXPLAINED {
                f.write_str(
                    "one rotor position: `learn again` at another separates slot effects from the stator; ",
                )?;
            }
            f.write_str("`save` keeps it")
        } else {
            write!(f, "refused: {result}")
        }
    })
}

/// Line number `line` about an event of the commissioning, and the number of the next line.
fn told(news: &commissioning::News, line: usize) -> (impl fmt::Display, Option<usize>) {
    let value = match news {
        commissioning::News::Report(report) => report.values.get(line).copied().flatten(),
        commissioning::News::Ended { .. } => None,
    };
    let text = fmt::from_fn(move |f| match (news, value) {
        (commissioning::News::Report(report), Some(value)) => {
            write!(f, "{}: {value}", report.step.word())
        }
        (commissioning::News::Report(report), None) => write!(f, "{report}"),
        (commissioning::News::Ended { sound: true, step }, _) => {
            f.write_str("ended; `accept` puts it in force and saves it")?;
            // With another motor the saliency has to be learned again.
            f.write_str(match step {
                Step::Inertia => "",
                _ => "; then lock the shaft and `learn`",
            })
        }
        (commissioning::News::Ended { sound: false, .. }, _) => {
            f.write_str("ended; the settings are as they were")
        }
    });
    (text, value.map(|_| line + 1))
}
