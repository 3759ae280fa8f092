//! The commissioning and the learning at the console.

use core::fmt;

use drive_commission::Step;
use drive_core::{Mode, Refused, State};
use drive_settings::value::Words as _;

use super::Console;
use super::answer::Task;
use super::design::configure;
use super::handle::DriveHandle;
use crate::commissioning::News;

impl Console {
    /// Lets the drive measure its motor.
    pub(super) fn commission(&mut self, first: Step, last: Step, drive: &mut impl DriveHandle) {
        match drive.status().map(|status| status.state) {
            None => self.error(&drive.no_control()),
            Some(State::Fault(fault)) => self.error(&Refused::Fault(fault)),
            Some(_) => {
                drive.session().begin(first, last);
                if last < Step::Inertia {
                    self.ok();
                } else {
                    self.out.answer(format_args!(
                        "ok: the shaft is going to turn, at most two turns to and fro"
                    ));
                }
            }
        }
    }

    /// Puts in force what the commissioning has found, and saves it.
    pub(super) fn accept(&mut self, drive: &mut impl DriveHandle) {
        if !self.may_stage(drive) {
            return;
        }
        match drive.session().found(&self.settings.latest().drive) {
            None => self.error(&"nothing new was found: `commission` first"),
            Some(found) => {
                self.settings.stage(found);
                self.design_for(Task::Save, drive);
            }
        }
    }

    /// Lets the drive learn: anew, or again on top of what it has learned.
    pub(super) fn learn(&mut self, again: bool, drive: &mut impl DriveHandle) {
        if again && self.settings.in_force().learned.is_none() {
            return self.error(&"nothing is learned with these settings: `learn` first");
        }
        match self.settings.begin_learning(again, |settings| configure(drive, settings)) {
            Ok(()) => self.start(Mode::Learning, drive),
            Err(why) => self.error(&why),
        }
    }
}

/// Line number `line` of what is told of a commissioning's news, and the number of the next line.
pub(super) fn told(news: &News, line: usize) -> (impl fmt::Display, Option<usize>) {
    let value = match news {
        News::Report(report) => report.values.get(line).copied().flatten(),
        News::Ended { .. } => None,
    };
    let text = fmt::from_fn(move |f| match (news, value) {
        (News::Report(report), Some(value)) => {
            write!(f, "{}: {value}", report.step.word())
        }
        (News::Report(report), None) => write!(f, "{report}"),
        (News::Ended { sound: true, step }, _) => {
            f.write_str("ended; `accept` puts it in force and saves it")?;
            // Another motor has to be learned.
            f.write_str(match step {
                Step::Inertia => "",
                _ => "; then lock the shaft and `learn`",
            })
        }
        (News::Ended { sound: false, .. }, _) => {
            f.write_str("ended; the settings are as they were")
        }
    });
    (text, value.map(|_| line + 1))
}
