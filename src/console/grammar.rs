//! The grammar: a line in, a [`Request`] or a [`ParseError`] out.

use core::fmt;

use drive_core::Mode;
use drive_core::settings::value::{self, Value, ValueError};

use crate::board;
use crate::link::trace::{self, SignalChoice};
use crate::settings::keys::{self, Key};

/// Most records of a trace.
const LONGEST_TRACE: u16 = board::TRACE_RECORDS as u16;
/// Largest divider of a trace.
const LARGEST_DIVIDER: u16 = 1000;

/// A valid line.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// List all commands.
    Help,
    /// Show the state of the drive.
    Status,
    /// Start in a mode.
    Start(Mode),
    /// Torque to zero, then off.
    Stop,
    /// Magnetise again and check that the flux is tracked.
    Relock,
    /// Set the current on the quadrature axis, A.
    Torque(f32),
    /// Set the speed, mechanical rpm.
    Speed(f32),
    /// Set the position, mechanical turns from the start.
    Position(f32),
    /// Show one setting, or all.
    Get(Option<Key>),
    /// Change a setting.
    Set(Key, Value),
    /// List the result of the last learning.
    Learned,
    /// Save the settings, and what was learned.
    Save,
    /// Restore the settings of the image.
    Defaults,
    /// Show the latched fault and the last reset.
    Faults,
    /// Clear the latched fault.
    Clear,
    /// Record a trace.
    Trace {
        /// Number of records.
        records: u16,
        /// Periods from one record to the next.
        divider: u16,
        /// Recorded signals.
        choice: SignalChoice,
    },
    /// Set how much is logged.
    Log(Level),
    /// Show the version of the firmware.
    Version,
}

/// Level of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Nothing.
    Off,
    /// Faults.
    Error,
    /// Events that need attention as well.
    Warn,
    /// State changes and ten status lines a second as well.
    Info,
}

/// Names of the levels, in order.
pub const LEVELS: [(&str, Level); 4] =
    [("off", Level::Off), ("error", Level::Error), ("warn", Level::Warn), ("info", Level::Info)];

/// Reason why a line is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParseError {
    /// No such command.
    Command,
    /// This word is missing.
    Missing(&'static str),
    /// More words than the command takes.
    TooMuch,
    /// Not a finite number.
    Number,
    /// Not one of these words.
    OneOf(&'static str),
    /// Not a whole number in this range.
    Whole {
        /// Smallest.
        min: u16,
        /// Largest.
        max: u16,
    },
    /// No such signal, or too many.
    Signal,
    /// No such setting.
    Key,
    /// Not a value of the setting.
    Value(ValueError),
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command => f.write_str("no such command; `help` lists them"),
            Self::Missing(what) => write!(f, "{what} is missing"),
            Self::TooMuch => f.write_str("too many words"),
            Self::Number => f.write_str("not a number"),
            Self::OneOf(words) => write!(f, "not one of: {words}"),
            Self::Whole { min, max } => write!(f, "not a whole number from {min} to {max}"),
            Self::Signal => {
                write!(f, "unknown signal, or more than {}; there are:", trace::MOST)?;
                trace::SIGNALS.iter().try_for_each(|name| write!(f, " {name}"))
            }
            Self::Key => f.write_str("no such setting; `get` lists them"),
            Self::Value(why) => why.fmt(f),
        }
    }
}

/// One line per command, for `help`.
pub const HELP: [&str; 20] = [
    "help                      this list",
    "status                    what the drive is doing",
    "start [MODE]              calibrate, magnetise, then regulate torque, speed or position, or learn",
    "stop                      torque to zero, then off",
    "relock                    no torque, magnetise again, verify the lock, go on",
    "torque A                  current on the quadrature axis, A peak",
    "speed RPM                 speed, mechanical rpm",
    "position TURNS            position, mechanical turns from where it started",
    "angle encoder|injection   where the flux angle comes from",
    "get [KEY]                 one setting with its range, or all",
    "set KEY VALUE             change a setting; the drive must be off",
    "learned                   what was learned on the motor with these settings",
    "save                      keep the settings, and what was learned, over a reset",
    "defaults                  back to the settings of the image; the drive must be off",
    "faults                    the latched fault and what ended the last run",
    "clear                     forget the latched fault",
    "trace N [DIVIDER] [NAME]  record N periods, every DIVIDER-th, of the signals named; print as CSV",
    "log off|error|warn|info   how much goes to the log",
    "version                   which firmware this is",
    "one line in, one line out; set command.timeout_s stops the drive when no line comes",
];

/// Parses one line.
///
/// # Errors
/// The first invalid or missing word. A line is valid as a whole or not at all.
pub fn parse(line: &str) -> Result<Request, ParseError> {
    let mut words = line.split_ascii_whitespace();
    let mut word = |what| words.next().ok_or(ParseError::Missing(what));
    let request = match word("a command")? {
        "help" => Request::Help,
        "status" => Request::Status,
        "start" => Request::Start(match word("") {
            Err(_) | Ok("torque") => Mode::Torque,
            Ok("speed") => Mode::Speed,
            Ok("position") => Mode::Position,
            Ok("learning") => Mode::Learning,
            Ok(_) => return Err(ParseError::OneOf("torque speed position learning")),
        }),
        "stop" => Request::Stop,
        "relock" => Request::Relock,
        "torque" => Request::Torque(number(word("the current")?)?),
        "speed" => Request::Speed(number(word("the speed")?)?),
        "position" => Request::Position(number(word("the position")?)?),
        // An alias of `set angle_source`.
        "angle" => {
            let key = keys::find("angle_source").ok_or(ParseError::Key)?;
            let value = key.parse(word("encoder or injection")?);
            Request::Set(key, value.map_err(|_| ParseError::OneOf("encoder injection"))?)
        }
        "get" => Request::Get(match word("") {
            Err(_) => None,
            Ok(name) => Some(keys::find(name).ok_or(ParseError::Key)?),
        }),
        "set" => {
            let key = keys::find(word("the setting")?).ok_or(ParseError::Key)?;
            let value = key.parse(word("the value")?).map_err(ParseError::Value)?;
            Request::Set(key, value)
        }
        "learned" => Request::Learned,
        "save" => Request::Save,
        "defaults" => Request::Defaults,
        "faults" => Request::Faults,
        "clear" => Request::Clear,
        "trace" => {
            let records = whole(word("the number of records")?, LONGEST_TRACE)?;
            let mut next = word("").ok();
            let mut divider = 1;
            if let Some(text) = next
                && text.starts_with(|c: char| c.is_ascii_digit() || c == '-')
            {
                divider = whole(text, LARGEST_DIVIDER)?;
                next = word("").ok();
            }
            let mut choice =
                if next.is_some() { SignalChoice::none() } else { SignalChoice::usual() };
            while let Some(name) = next {
                if !choice.add(name) {
                    return Err(ParseError::Signal);
                }
                next = word("").ok();
            }
            Request::Trace { records, divider, choice }
        }
        "log" => {
            let name = word("the level")?;
            let level = LEVELS.iter().find(|(known, _)| *known == name);
            Request::Log(level.ok_or(ParseError::OneOf("off error warn info"))?.1)
        }
        "version" => Request::Version,
        _ => return Err(ParseError::Command),
    };
    if words.next().is_some() { Err(ParseError::TooMuch) } else { Ok(request) }
}

fn number(text: &str) -> Result<f32, ParseError> {
    value::number(text).ok_or(ParseError::Number)
}

fn whole(text: &str, max: u16) -> Result<u16, ParseError> {
    let value = text.parse().ok().filter(|value| (1..=max).contains(value));
    value.ok_or(ParseError::Whole { min: 1, max })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_line_of_the_help_but_the_last_is_a_command() {
        for line in &HELP[..HELP.len() - 1] {
            let command = line.split(' ').next().unwrap();
            assert_ne!(parse(command), Err(ParseError::Command), "{command}");
        }
    }

    #[test]
    fn commands_are_understood() {
        let key = keys::find("motor.r_s").unwrap();
        let source = keys::find("angle_source").unwrap();
        let mut two = SignalChoice::none();
        assert!(two.add("i_q") && two.add("turns"));
        let table = [
            ("help", Request::Help),
            ("  status\t", Request::Status),
            ("start", Request::Start(Mode::Torque)),
            ("start position", Request::Start(Mode::Position)),
            ("start learning", Request::Start(Mode::Learning)),
            ("stop", Request::Stop),
            ("relock", Request::Relock),
            ("torque -1.5", Request::Torque(-1.5)),
            ("start speed", Request::Start(Mode::Speed)),
            ("speed -150", Request::Speed(-150.0)),
            ("position 5e1", Request::Position(50.0)),
            ("angle encoder", Request::Set(source, Value::Word("encoder"))),
            ("set angle_source encoder", Request::Set(source, Value::Word("encoder"))),
            ("get", Request::Get(None)),
            ("get motor.r_s", Request::Get(Some(key))),
            ("set motor.r_s 5.5", Request::Set(key, Value::Number(5.5))),
            (
                "trace 100",
                Request::Trace { records: 100, divider: 1, choice: SignalChoice::usual() },
            ),
            (
                "trace 1024 10",
                Request::Trace { records: 1024, divider: 10, choice: SignalChoice::usual() },
            ),
            ("trace 5 i_q turns", Request::Trace { records: 5, divider: 1, choice: two.clone() }),
            ("trace 5 2 i_q turns", Request::Trace { records: 5, divider: 2, choice: two }),
            ("learned", Request::Learned),
            ("log warn", Request::Log(Level::Warn)),
            ("version", Request::Version),
        ];
        for (line, request) in table {
            assert_eq!(parse(line), Ok(request), "{line}");
        }
    }

    #[test]
    fn what_is_half_wrong_is_refused_whole() {
        use ParseError::*;
        let trace = Whole { min: 1, max: LONGEST_TRACE };
        let table = [
            ("", Missing("a command")),
            ("Stop", Command),
            ("stopp", Command),
            ("stop now", TooMuch),
            ("angle", Missing("encoder or injection")),
            ("angle guess", OneOf("encoder injection")),
            ("start backwards", OneOf("torque speed position learning")),
            ("torque", Missing("the current")),
            ("torque 1 2", TooMuch),
            ("torque 1,5", Number),
            ("torque 1A", Number),
            ("torque nan", Number),
            ("torque inf", Number),
            ("torque 1e99", Number),
            ("set motor.r_s", Missing("the value")),
            ("set motor.r_x 1", Key),
            ("trace 0", trace),
            ("trace 1025", trace),
            ("trace 5 0", Whole { min: 1, max: 1000 }),
            ("trace -5", trace),
            ("trace 5 i_x", Signal),
            ("trace 5 2 3", Signal),
            ("trace 5 i_d i_d i_d i_d i_d i_d i_d i_d i_d", Signal),
            ("log loud", OneOf("off error warn info")),
        ];
        for (line, why) in table {
            assert_eq!(parse(line), Err(why), "{line}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_understood_or_refused(line in ".*") {
            let _ = parse(&line);
        }

        #[test]
        fn words_that_look_like_commands_are_understood_or_refused(
            line in "(start|torque|speed|position|angle|get|set|trace|log|stop) ?[-+.0-9a-z_ ]{0,30}",
        ) {
            if let Ok(Request::Torque(x) | Request::Speed(x) | Request::Position(x)) = parse(&line) {
                prop_assert!(x.is_finite());
            }
        }

        #[test]
        fn numbers_survive_the_way_through_text(
            digits in -9_999_999..=9_999_999, power in -9_i32..=9,
        ) {
            let value = digits as f32 * 10_f32.powi(power);
            prop_assert_eq!(parse(&format!("torque {value}")), Ok(Request::Torque(value)));
            prop_assert_eq!(parse(&format!("torque {value:e}")), Ok(Request::Torque(value)));
        }
    }
}
