//! Replies of many lines: one line at a time, and `ok` after the last.

use core::fmt;

use drive_core::io::PERIOD_S;
use drive_settings::Settings;
use drive_settings::entry::Change;
use drive_settings::value::Value;

use super::grammar::{HELP, HELP_END, ListKind};
use super::handle::Firmware;
use super::number::Significant;
use super::reply::{self, Description, Setting};
use super::restore;
use super::{Console, board};
use crate::desk::Desk;
use crate::history;
use crate::recording::stream;
use crate::recording::trace::Plan;
use crate::settings::FirmwareSettings;
use crate::settings::keys::{self, Key};

/// A reply of many lines.
#[derive(Clone, Copy)]
pub(super) struct List {
    pub kind: ListKind,
    /// Number of the next line, or of the next setting to look at.
    pub next: u16,
}

/// Significant digits of a trace.
const TRACE_DIGITS: usize = 6;
/// A setting that a backup leaves out, so that a restored drive checks its wiring.
const NOT_IN_BACKUP: &str = "wiring_checked";

impl Console {
    pub(super) fn begin(&mut self, kind: ListKind) {
        self.list = Some(List { kind, next: 0 });
    }

    /// Writes the next line of the list, or `ok` after the last; nothing if the list has to wait.
    pub(super) fn next_of_list(&mut self, desk: &Desk, drive: &impl Firmware) {
        let Some(List { kind, next }) = self.list else { return };
        let line = usize::from(next);
        let settings = desk.settings().in_force();
        let out = &mut self.out;
        let mut say = |text: &dyn fmt::Display, next| {
            out.line(format_args!("{text}"));
            next
        };
        let written = match kind {
            ListKind::Help => match HELP.get(line) {
                Some((usage, text)) => Some(say(&format_args!("{usage:<24}  {text}"), next + 1)),
                None => (line == HELP.len()).then(|| say(&HELP_END, next + 1)),
            },
            ListKind::Settings(prefix) => setting_from(line, prefix)
                .map(|(key, next)| say(&Setting::new(key, desk.settings()), next)),
            ListKind::Describe(prefix) => setting_from(line, prefix)
                .map(|(key, next)| say(&Description::new(key, desk.settings()), next)),
            ListKind::Backup => self.backup(line, settings),
            ListKind::Board => board::line(settings, line).map(|text| say(&text, next + 1)),
            ListKind::Fault(fault) => reply::fault(fault, line).map(|text| say(&text, next + 1)),
            ListKind::History => {
                history::line(drive.history(), line).map(|text| say(&text, next + 1))
            }
            ListKind::Learned => desk
                .learned()
                .and_then(|(in_use, result)| reply::learned(result, in_use, &settings.drive, next))
                .map(|text| say(&text, next + 1)),
            ListKind::Signals => stream::described(line).map(|text| say(&text, next + 1)),
            ListKind::Trace if drive.tracing() => return,
            ListKind::Trace => self.trace_line(next, &settings.drive, drive),
        };
        self.list = written.map(|next| List { kind, next });
        if written.is_none() {
            self.ok();
        }
    }

    /// Writes the header, then one line per record.
    fn trace_line(&mut self, next: u16, settings: &Settings, drive: &impl Firmware) -> Option<u16> {
        let Plan { choice, divider, .. } = self.traced.as_ref()?;
        let Some(i) = next.checked_sub(1) else {
            let names = fmt::from_fn(|f| {
                choice.signals().try_for_each(|signal| write!(f, ",{}", signal.name))
            });
            self.out.line(format_args!("t_s{names}"));
            return Some(1);
        };
        let (from_trigger, record) = drive.traced(i)?;
        let seconds = f32::from(from_trigger) * f32::from(*divider) * PERIOD_S;
        let values = fmt::from_fn(|f| {
            record.iter().zip(choice.signals()).try_for_each(|(value, signal)| {
                write!(f, ",{}", Significant(signal.shown(*value, settings), TRACE_DIGITS))
            })
        });
        self.out.line(format_args!("{seconds:.6}{values}"));
        Some(next + 1)
    }

    /// Writes the next line of a backup, from this place on. The order is: the board; `defaults`; the settings with words, since ranges
    /// depend on them; the numbers that differ from the image; the learned values; `apply`.
    fn backup(&mut self, place: usize, settings: &FirmwareSettings) -> Option<u16> {
        const FIRST: usize = 2;
        const NUMBERS: usize = FIRST + keys::COUNT;
        const LEARNED: usize = NUMBERS + keys::COUNT;
        const LAST: usize = 1000;
        let out = &mut self.out;
        if place < FIRST {
            match place {
                0 => out.line(format_args!("board {}", settings.board.name)),
                _ => out.line(format_args!("defaults")),
            }
            return Some(place as u16 + 1);
        }
        let image = FirmwareSettings::of_the_board();
        for (place, key) in (FIRST..).zip(keys::all().chain(keys::all())).skip(place - FIRST) {
            let value = key.get(settings);
            let in_turn = matches!(value, Value::Word(_)) == (place < NUMBERS);
            let kept = key.change() == Change::Board || key.name() == NOT_IN_BACKUP;
            if in_turn && !kept && value != key.get(&image) {
                out.line(format_args!("set {} {value}", key.name()));
                return Some(place as u16 + 1);
            }
        }
        let line = place.saturating_sub(LEARNED);
        let both = settings.drive.scales.both_zero_vectors;
        let learned = settings.learned.as_ref().and_then(|found| restore::line(found, both, line));
        match learned {
            Some(text) => {
                out.line(format_args!("{text}"));
                Some((LEARNED + line) as u16 + 1)
            }
            None if place < LAST => {
                out.line(format_args!("apply"));
                Some(LAST as u16)
            }
            None => None,
        }
    }
}

/// The first setting from a number on whose name begins with the prefix, and the number after it.
fn setting_from(number: usize, prefix: &str) -> Option<(Key, u16)> {
    let mut rest = (1..).zip(keys::all()).skip(number);
    rest.find(|(_, key)| key.name().starts_with(prefix)).map(|(after, key)| (key, after))
}
