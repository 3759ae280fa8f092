//! The answer to a request.

use core::fmt;

use drive_core::State;

use super::grammar::{ListKind, Request};
use super::handle::Firmware;
use super::number::Significant;
use super::words::UNCONFIRMED;
use super::{Console, reply};
use crate::desk::order::{Order, Reply};
use crate::desk::{Answer, Desk, may_stage};
use crate::recording::trace::{Plan, SIGNALS, Trigger};
use crate::settings::Commander;

/// Significant digits of a limited set-point.
const DIGITS: usize = 4;

impl Console {
    #[inline(never)]
    pub(super) fn answer(&mut self, request: Request, desk: &mut Desk, drive: &mut impl Firmware) {
        match request {
            Request::Order(Order::Defaults) => {
                let answer = desk.order(Commander::Console, Order::Defaults, drive);
                self.reply_to_part(&answer, desk);
            }
            Request::Order(order) => self.reply(&desk.order(Commander::Console, order, drive)),
            Request::Set(values) => {
                let answer = desk.set(Commander::Console, &values, drive);
                self.reply_to_part(&answer, desk);
            }
            Request::List(kind) => self.begin(kind),
            Request::Status => self.status(desk, drive),
            Request::Get(key) => {
                let setting = reply::Setting::new(key, desk.settings());
                self.out.answer(format_args!("{setting}; {}", key.help()));
            }
            Request::Backup => match desk.nothing_staged() {
                Ok(()) => self.begin(ListKind::Backup),
                Err(why) => self.error(&why),
            },
            Request::Learned if desk.learned().is_some() => self.begin(ListKind::Learned),
            Request::Learned => {
                self.out.answer(format_args!("ok: nothing learned with these settings"));
            }
            Request::Restore(index, words) => match self.restore.take(index, &words) {
                Ok(()) => self.ok(),
                Err(why) => self.leave_out(&why, desk),
            },
            Request::Restored(check) => self.restored(check, desk, drive),
            Request::Faults(fault) => self.faults(fault, drive),
            Request::Trace(plan) => self.trace(plan, desk, drive),
            Request::ShowTrace if drive.tracing() => self.error(&TRACING),
            Request::ShowTrace if self.traced.is_none() => self.error(&"no trace was recorded"),
            Request::ShowTrace => self.begin(ListKind::Trace),
            Request::EndTrace => {
                drive.cancel_trace();
                (self.armed, self.traced) = (false, None);
                self.ok();
            }
            Request::Stream(plan) => self.stream(plan, drive),
            Request::StreamState => self.stream_state(),
            Request::EndStream => {
                self.stop_stream(drive);
                self.stream_state();
            }
            Request::Baud(baud) => {
                self.stop_stream(drive);
                self.wire.wanted = baud;
                self.ok();
            }
            Request::Log(level) => {
                drive.set_log_level(level);
                self.ok();
            }
            Request::Version => {
                let version = fmt::from_fn(|f| drive.version(f));
                self.out.answer(format_args!("{version}"));
            }
        }
    }

    /// Writes the answer of the command arbiter to a line that may be part of a backup.
    fn reply_to_part(&mut self, answer: &Answer, desk: &mut Desk) {
        if answer.is_err() {
            desk.leave_out();
        }
        self.reply(answer);
    }

    /// Writes the answer of the command arbiter.
    pub(super) fn reply(&mut self, answer: &Answer) {
        match answer {
            Ok(Reply::Designing) => self.out.news(format_args!("designing...")),
            Ok(reply) => self.out.answer(format_args!("ok{}", remark(*reply))),
            Err(why) => self.error(why),
        }
    }

    fn restored(&mut self, check: u32, desk: &mut Desk, drive: &impl Firmware) {
        let both = desk.settings().latest().drive.scales.both_zero_vectors;
        // The received words are kept for another try.
        if let Err(why) = may_stage(drive) {
            return self.leave_out(&why, desk);
        }
        match self.restore.finish(check, both) {
            Ok(learned) => self.reply(&desk.restore(learned, drive)),
            Err(why) => self.leave_out(&why, desk),
        }
    }

    fn faults(&mut self, fault: Option<drive_core::Fault>, drive: &impl Firmware) {
        if let Some(fault) = fault {
            self.out.line(format_args!("fault {}: {fault}", fault.code()));
            return self.begin(ListKind::Fault(fault));
        }
        let last_run = fmt::from_fn(|f| drive.last_run(f));
        match drive.status().map(|status| status.state) {
            Some(State::Fault(fault)) => {
                let code = fault.code();
                self.out.line(format_args!("latched: fault {code}, {fault}; last run: {last_run}"));
                self.begin(ListKind::Fault(fault));
            }
            _ => self.out.answer(format_args!("none latched; last run: {last_run}")),
        }
    }

    fn trace(&mut self, mut plan: Plan, desk: &Desk, drive: &mut impl Firmware) {
        if let Trigger::Level { signal, level, above } = &mut plan.trigger
            && let Some(signal) = SIGNALS.get(usize::from(*signal))
        {
            let drive_core::Line { gain, offset } = signal.line(&desk.settings().in_force().drive);
            if gain == 0.0 {
                return self.error(
                    &"no trigger on it: the board lacks its sensor, or its scale is curved",
                );
            }
            *level = (*level - offset) / gain;
            // With a negative gain a larger current has a smaller count.
            *above ^= gain < 0.0;
        }
        if !drive.begin_trace(&plan) {
            return self.error(&TRACING);
        }
        if plan.trigger == Trigger::Now {
            self.begin(ListKind::Trace);
        } else {
            self.armed = true;
            self.out.answer(format_args!("ok: recording until the trigger"));
        }
        self.traced = Some(plan);
    }
}

/// The text after the `ok` of a reply.
fn remark(reply: Reply) -> impl fmt::Display {
    fmt::from_fn(move |f| match reply {
        Reply::Done | Reply::Designing => Ok(()),
        Reply::Limited(value, unit) => {
            write!(f, ": limited to {} {unit}", Significant(value, DIGITS))
        }
        Reply::WiringFirst => f.write_str(": the wiring is checked first"),
        Reply::ShaftTurns => {
            f.write_str(": the shaft is going to turn, at most two turns to and fro")
        }
        Reply::Staged => f.write_str(": staged"),
        Reply::AsInForce => f.write_str(": as in force"),
        Reply::StagedForReset(key) => {
            write!(f, ": staged; {} takes effect at the next reset, if saved", key.name())
        }
        Reply::Unconfirmed => write!(f, ": staged; {UNCONFIRMED}"),
        Reply::RestoredDropped => {
            f.write_str(": staged; the restored values belong to other settings and are dropped")
        }
        Reply::NothingStaged => f.write_str(": nothing staged"),
        Reply::Dropped(count) => write!(f, ": {count} staged values dropped"),
        Reply::Applied(applied) => write!(f, "{applied}"),
        Reply::BootPin => f.write_str(": with the boot pin in use, see `board`"),
        Reply::Rebooting => f.write_str(": rebooting"),
        Reply::Loader => f.write_str(": ST's loader is next"),
    })
}

const TRACING: &str = "a trace is being recorded; `trace off` ends it";
