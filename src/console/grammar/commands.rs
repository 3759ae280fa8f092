//! The table of the commands: permanent number, word, lines of `help` with arguments and meaning, and request.

use drive_commission::Step;
use drive_core::{Mode, Stop, homing};

use super::backup::{hexadecimal, restore};
use super::request::{ListKind, Request};
use super::{
    ParseError, Words, assigned, assignments, fault, prefix, recording, setting, step, whole,
};
use crate::boards;
use crate::console::baud;
use crate::console::suggest::nearest;
use crate::desk::order::Order;
use crate::log::LEVELS;
use crate::settings::keys;

/// Rows of `NUMBER: WORD, [ARGUMENTS, MEANING], ... => REQUEST;`, in the order of `help`. A number is never used again.
macro_rules! commands {
    ($words:ident; $($number:literal: $word:literal $(, [$arguments:literal, $help:literal])* => $request:expr;)+) => {
        /// The words of all commands.
        pub const COMMANDS: &[&str] = &[$($word),+];
        /// The permanent numbers of the [`COMMANDS`].
        #[cfg(test)]
        pub const NUMBERS: &[u16] = &[$($number),+];
        /// The lines of `help`: a command with its arguments, and its meaning.
        pub const HELP: &[(&str, &str)] = &[$($((concat!($word, " ", $arguments), $help),)*)+];

        /// The request that begins with this word.
        pub(super) fn request<'a>(word: &'a str, $words: &mut Words<'a>) -> Result<Request, ParseError<'a>> {
            Ok(match word {
                $($word => $request.into(),)+
                word => return Err(ParseError::Unknown { what: "command", list: "help", word, near: nearest(word, COMMANDS.iter().copied()) }),
            })
        }
    };
}

/// The last line of `help`.
pub const HELP_END: &str = "one line in, one line out; faults and changes of state are announced; set command.timeout_s stops the drive when no line comes";

/// The words after `start` and after `stop`.
const MODES: [(&str, Order); 5] = [
    ("torque", Order::Start(Mode::Torque)),
    ("speed", Order::Start(Mode::Speed)),
    ("position", Order::Start(Mode::Position)),
    ("vf", Order::Start(Mode::VoltsPerHertz)),
    ("learning", Order::Learn { again: false }),
];
const STOPS: [(&str, Order); 3] = [
    ("ramp", Order::Stop(Stop::Ramp)),
    ("quick", Order::Stop(Stop::Quick)),
    ("now", Order::Stop(Stop::Now)),
];

commands! { words;
    1: "help", ["", "this list; also h and ?"] => Request::List(ListKind::Help);
    2: "status", ["", "what the drive is doing"] => Request::Status;
    3: "start", ["[MODE]", "calibrate, magnetise, then regulate torque, speed or position; vf: turn a motor that is not identified"] => words.optional_of(Order::Start(Mode::Torque), "the mode", "torque speed position vf learning", &MODES)?;
    4: "commission", ["[STEP [STEP]]", "measure the motor at rest, from its nameplate: all steps, one, or from one to another; plant: shaft locked; inertia: shaft free"] => match words.optional().map(step).transpose()? {
        None => Order::Commission(Step::Nameplate, Step::LAST),
        Some(first) => Order::Commission(first, words.optional().map_or(Ok(first), step)?),
    };
    5: "accept", ["", "apply what `commission` has found, and save"] => Order::Accept;
    6: "learn", ["[again]", "learn the motor, shaft locked; again: at another rotor position, added to what is learned"] => Order::Learn { again: words.flag("again")? };
    7: "stop", ["[ramp|quick|now]", "torque to zero, then off; ramp, quick: speed to zero first, by speed.ramp_rpm_per_s or speed.quick_rpm_per_s; now: off at once"] => words.optional_of(Order::Stop(Stop::Coast), "the way to stop", "ramp quick now", &STOPS)?;
    8: "relock", ["", "drop the torque, magnetise again, verify the lock, continue"] => Order::Relock;
    9: "torque", ["A", "q-axis current, A peak"] => Order::Torque(words.number("the current, A")?);
    10: "speed", ["RPM", "speed, mechanical rpm"] => Order::Speed(words.number("the speed, rpm")?);
    11: "jog", ["RPM", "turn at this speed while you repeat this command every 0.5 s, then to rest by the ramp"] => Order::Jog(words.number("the speed, rpm")?);
    12: "position", ["TURNS", "position, mechanical turns from where it started"] => Order::Position(words.number("the position, turns")?);
    13: "home", ["RPM A TURNS", "in position mode: turn towards a stop, slowly, with at most this current and this far; the stop becomes position 0"] => Order::Home(homing::Plan {
        rpm: words.number("the speed, rpm")?,
        i_q: words.number("the current, A")?,
        turns: words.number("the longest way, turns")?,
    });
    14: "angle", ["encoder|injection", "where the flux angle comes from; the same as set angle_source"]
        => Request::Set([assigned(setting("angle_source")?, words.next("encoder or injection")?)?].into_iter().collect());
    15: "get", ["[KEY|PREFIX]", "one setting with range and meaning, or all with this prefix"] => match words.optional().map(|name| (name, keys::find(name))) {
        None => Request::List(ListKind::Settings("")),
        Some((_, Some(key))) => Request::Get(key),
        Some((name, None)) => Request::List(ListKind::Settings(prefix(name)?)),
    };
    16: "describe", ["[PREFIX]", "the settings as JSON, one a line"] => match words.optional() {
        Some("stream") => Request::List(ListKind::Signals),
        word => Request::List(ListKind::Describe(word.map_or(Ok(""), prefix)?)),
    };
    17: "set", ["KEY VALUE ...", "stage values, several in a line; the drive must be off"] => Request::Set(assignments(words)?);
    18: "apply", ["[rest]", "put the staged values into force; start does so, too; rest: although lines of a backup were refused"]
        => if words.flag("rest")? { Order::ApplyRest } else { Order::Apply };
    19: "revert", ["", "drop the staged values"] => Order::Revert;
    20: "save", ["", "apply, then keep settings and learned values over a reset"] => Order::Save;
    21: "defaults", ["", "stage the settings of the image"] => Order::Defaults;
    22: "backup", ["", "print the lines that restore settings and learned values"] => Request::Backup;
    23: "learned", ["", "what was learned on the motor with these settings"] => match words.optional() {
        None => Request::Learned,
        Some("check") => Request::Restored(hexadecimal(words.next("the checksum")?)?),
        Some(index) => restore(index, words)?,
    };
    24: "faults", ["[NUMBER]", "the latched fault with causes and cure, and what ended the last run"] => Request::Faults(words.optional().map(fault).transpose()?);
    25: "history", ["", "hours with power and with current, starts, and the last faults"] => Request::List(ListKind::History);
    26: "clear", ["", "clear the latched fault"] => Order::Clear;
    27: "trace",
        ["N [DIVIDER] [NAME]", "record N times, in every DIVIDER-th period, the signals named; print as CSV"],
        ["N ... on fault", "record until a fault; then `trace` prints it"],
        ["N ... on NAME above|below X", "record around the moment when the signal passes X"],
        ["[off]", "print the last trace, or end the recording"]
        => match words.optional() {
            None => Request::ShowTrace,
            Some("off") => Request::EndTrace,
            Some(records) => Request::Trace(recording::plan(records, words)?),
        };
    28: "stream",
        ["NAME ... [RATE] [alive S]", "send frames of signals; alive: stop the drive after S seconds without a line"],
        ["[off]", "frames sent and dropped, or end it; `describe stream`: the layout"]
        => match words.optional() {
            None => Request::StreamState,
            Some("off") => Request::EndStream,
            Some(signal) => Request::Stream(recording::stream(signal, words)?),
        };
    29: "baud", ["N", "bits per second; back to 115200 after a second without a valid line"] => {
        let (what, min, max) = ("the bits per second", baud::USUAL, baud::HIGHEST);
        Request::Baud(whole(what, words.next(what)?, min, max)?)
    };
    30: "log", ["off|error|warn|info|debug", "how much goes to the log"] => Request::Log(words.one_of("the level", "off error warn info debug", &LEVELS)?);
    31: "echo", ["on|off", "whether typed characters are sent back"] => Order::Echo(words.one_of("on or off", "on off", &[("on", true), ("off", false)])?);
    32: "reboot", ["[now]", "reset the controller; `now` drops settings that were not saved"] => Order::Reboot(words.flag("now")?);
    // ST's loader holds PA9 high (AN2606).
    38: "update", ["gates-off", "reset into ST's loader, which writes another image; the supply of the gate drivers must be off: the loader switches a gate on"] => words.one_of(
        "`gates-off`: ST's loader switches a gate on, so the supply of the gate drivers must be off. That word",
        "gates-off",
        &[("gates-off", Order::Update)],
    )?;
    33: "board", ["[NAME]", "the board and what is assumed; NAME: the next lines are for that board only"] => match words.optional() {
        None => Request::List(ListKind::Board),
        Some(name) => Order::BoardIs(boards::find(name)).into(),
    };
    34: "confirm", ["board", "the bench steps of the board are done: allow to start, and save"] => words.one_of("what to confirm", "board", &[("board", Order::Confirm)])?;
    35: "version", ["", "which firmware this is"] => Request::Version;
    36: "h" => Request::List(ListKind::Help);
    37: "?" => Request::List(ListKind::Help);
}
