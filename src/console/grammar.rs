//! What can be asked for: a line in, a [`Request`] or a reason why not out.

use core::{fmt, str};

use drive_core::Mode;
use drive_core::settings::AngleSource;

use crate::link::trace::{self, Choice};

use super::keys::{self, Key, NotTaken};

/// Most periods that a trace records.
pub const LONGEST_TRACE: u16 = 1024;

/// One understood line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// All commands.
    Help,
    /// What the drive is doing.
    Status,
    /// Start in a mode.
    Start(Mode),
    /// Torque to zero, then off.
    Stop,
    /// Magnetise again and verify that the flux is tracked.
    Relock,
    /// Current on the quadrature axis, A.
    Torque(f32),
    /// Speed, rpm.
    Speed(f32),
    /// Position, turns from where it started.
    Position(f32),
    /// Where the flux angle comes from.
    Angle(AngleSource),
    /// One setting, or all.
    Get(Option<&'static Key>),
    /// Change a setting.
    Set(&'static Key, keys::Value),
    /// What was learned on the motor.
    Learned,
    /// Keep the settings, and what was learned.
    Save,
    /// Back to the settings of the image.
    Defaults,
    /// The latched fault and the last reset.
    Faults,
    /// Forget the latched fault.
    Clear,
    /// Record this many periods, every `divider`-th.
    Trace {
        /// How many.
        records: u16,
        /// One of how many periods.
        divider: u16,
        /// Of these signals.
        choice: Choice,
    },
    /// How much is logged.
    Log(Level),
    /// Which firmware this is.
    Version,
}

/// How much goes to the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Nothing.
    Off,
    /// Faults.
    Error,
    /// Whatever needs attention.
    Warn,
    /// State changes and ten status lines a second as well.
    Info,
}

/// Names of the levels, in order.
pub const LEVELS: [(&str, Level); 4] =
    [("off", Level::Off), ("error", Level::Error), ("warn", Level::Warn), ("info", Level::Info)];

/// Why a line was not understood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misunderstood {
    /// No such command.
    Command,
    /// A word is missing: which.
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
    /// The value does not suit the setting.
    Value(NotTaken),
}

impl fmt::Display for Misunderstood {
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

/// Understands one line.
///
/// # Errors
/// Why not. A line is understood as a whole or not at all.
#[inline(never)]
pub fn parse(line: &str) -> Result<Request, Misunderstood> {
    let mut words = Words(line.split_ascii_whitespace());
    let mut word = |what| words.next().ok_or(Misunderstood::Missing(what));
    let request = match word("a command")? {
        "help" => Request::Help,
        "status" => Request::Status,
        "start" => Request::Start(match word("") {
            Err(_) | Ok("torque") => Mode::Torque,
            Ok("speed") => Mode::Speed,
            Ok("position") => Mode::Position,
            Ok("learning") => Mode::Learning,
            Ok(_) => return Err(Misunderstood::OneOf("torque speed position learning")),
        }),
        "stop" => Request::Stop,
        "relock" => Request::Relock,
        "torque" => Request::Torque(number(word("the current")?)?),
        "speed" => Request::Speed(number(word("the speed")?)?),
        "position" => Request::Position(number(word("the position")?)?),
        "angle" => Request::Angle(match word("encoder or injection")? {
            "encoder" => AngleSource::Encoder,
            "injection" => AngleSource::Injection,
            _ => return Err(Misunderstood::OneOf("encoder injection")),
        }),
        "get" => Request::Get(match word("") {
            Err(_) => None,
            Ok(name) => Some(keys::find(name).ok_or(Misunderstood::Key)?),
        }),
        "set" => {
            let key = keys::find(word("the setting")?).ok_or(Misunderstood::Key)?;
            let value = key.parse(word("the value")?).map_err(Misunderstood::Value)?;
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
                divider = whole(text, 1000)?;
                next = word("").ok();
            }
            let mut choice = if next.is_some() { Choice::NONE } else { Choice::USUAL };
            while let Some(name) = next {
                if !choice.add(name) {
                    return Err(Misunderstood::Signal);
                }
                next = word("").ok();
            }
            Request::Trace { records, divider, choice }
        }
        "log" => {
            let name = word("the level")?;
            let level = LEVELS.iter().find(|(known, _)| *known == name);
            Request::Log(level.ok_or(Misunderstood::OneOf("off error warn info"))?.1)
        }
        "version" => Request::Version,
        _ => return Err(Misunderstood::Command),
    };
    if words.next().is_some() { Err(Misunderstood::TooMuch) } else { Ok(request) }
}

/// The words of a line.
struct Words<'a>(str::SplitAsciiWhitespace<'a>);

impl<'a> Words<'a> {
    /// Not inlined: it is asked for at twenty places, never in a hurry.
    #[inline(never)]
    fn next(&mut self) -> Option<&'a str> {
        self.0.next()
    }
}

/// A number: digits with or without sign, point and power of ten (`-0.5`, `1e-3`).
///
/// At most 18 digits, not counting zeros in front, and a power of ten from -22 to 22 after the last
/// of them. Up to nine digits it is the nearest `f32`: what the console prints is read back as it was.
/// (The parser of the core library takes 10 KiB of tables for all the others.)
pub fn number(text: &str) -> Result<f32, Misunderstood> {
    read_number(text).ok_or(Misunderstood::Number)
}

fn read_number(text: &str) -> Option<f32> {
    let (text, power) = match text.split_once(['e', 'E']) {
        Some((text, power)) => (text, power.parse::<i8>().ok()?),
        None => (text, 0),
    };
    let (text, negative) = match text.strip_prefix('-') {
        Some(text) => (text, true),
        None => (text.strip_prefix('+').unwrap_or(text), false),
    };
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut digits: u64 = 0;
    for digit in whole.bytes().chain(fraction.bytes()) {
        if !digit.is_ascii_digit() || digits >= 10_u64.pow(17) {
            return None;
        }
        digits = 10 * digits + u64::from(digit - b'0');
    }
    let power = i32::from(power) - i32::try_from(fraction.len()).ok()?;
    // Exact up to 10^22; for digits below 2^53 there is one rounding here and one to f32.
    let mut scale = 1.0_f64;
    if power.unsigned_abs() > 22 {
        return None;
    }
    for _ in 0..power.unsigned_abs() {
        scale *= 10.0;
    }
    let value = if power < 0 { digits as f64 / scale } else { digits as f64 * scale } as f32;
    value.is_finite().then_some(if negative { -value } else { value })
}

fn whole(text: &str, max: u16) -> Result<u16, Misunderstood> {
    let value = text.parse().ok().filter(|value| (1..=max).contains(value));
    value.ok_or(Misunderstood::Whole { min: 1, max })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_line_of_the_help_but_the_last_is_a_command() {
        for line in &HELP[..HELP.len() - 1] {
            let command = line.split(' ').next().unwrap();
            assert_ne!(parse(command), Err(Misunderstood::Command), "{command}");
        }
    }

    #[test]
    fn commands_are_understood() {
        let key = keys::find("motor.r_s").unwrap();
        let mut two = Choice::NONE;
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
            ("angle encoder", Request::Angle(AngleSource::Encoder)),
            ("get", Request::Get(None)),
            ("get motor.r_s", Request::Get(Some(key))),
            ("set motor.r_s 5.5", Request::Set(key, keys::Value::Number(5.5))),
            ("trace 100", Request::Trace { records: 100, divider: 1, choice: Choice::USUAL }),
            ("trace 1024 10", Request::Trace { records: 1024, divider: 10, choice: Choice::USUAL }),
            ("trace 5 i_q turns", Request::Trace { records: 5, divider: 1, choice: two }),
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
        use Misunderstood::*;
        let trace = Whole { min: 1, max: LONGEST_TRACE };
        let table = [
            ("", Missing("a command")),
            ("Stop", Command),
            ("stopp", Command),
            ("stop now", TooMuch),
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

        #[test]
        fn numbers_are_those_of_the_core_library(text in "[-+]?[0-9]{0,5}[.]?[0-9]{0,4}(e-?[0-9])?") {
            if let Ok(value) = number(&text) {
                prop_assert_eq!(Ok(value), text.parse());
            } else {
                prop_assert!(text.parse::<f32>().is_err());
            }
        }
    }

    #[test]
    fn numbers_that_are_too_long_or_too_large_are_refused() {
        for text in
            ["", ".", "-", "e5", "1e", "1e23", "1e-23", "1e300", "1234567890123456789", "1e99999"]
        {
            assert_eq!(number(text), Err(Misunderstood::Number), "{text}");
        }
        assert_eq!(number("000000000000000000000000001.5"), Ok(1.5));
    }
}
