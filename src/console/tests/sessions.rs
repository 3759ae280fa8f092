//! Plays the sessions of `tests/sessions/`, whose page describes their lines, and compares every answer.

use std::fs;
use std::mem::take;

use drive_core::Coefficients;
use hil_sim::sessions;

use super::announcements::{STATES, in_state};
use super::*;
use crate::generated;
use crate::modbus::settings::{Baud, Format};
use crate::modbus::tests::beside_console::Both;
use crate::terminals::Contacts;

#[path = "../../../tests/sessions/played.rs"]
mod played;

/// A drive with its user, bus master and terminals, and the state that is shown when it changes.
struct Player {
    both: Both,
    /// The last answer of several lines, without the last of them.
    list: Vec<String>,
    outputs: [bool; 3],
    divider: u16,
    baud: u32,
    line: Option<(Baud, Format)>,
}

/// The settings of a drive with these deviations. Without any, the board is confirmed, the wiring checked, and the drive may start without
/// an encoder before it has learned.
pub(super) fn settings(changes: &str) -> FirmwareSettings {
    let mut settings = FirmwareSettings::of_the_board();
    let (mut is_confirmed, mut has_learned) = (true, false);
    settings.command.wiring_checked = true;
    settings.drive.injection.synchronous.allow_unlearned = true;
    for change in changes.split(", ").filter(|change| !change.is_empty()) {
        match change.split_once(' ') {
            None if change == "learned" => has_learned = true,
            None if change == "unconfirmed" => is_confirmed = false,
            Some(("board", name)) => {
                settings = FirmwareSettings::of(boards::find(name).expect("a board"));
            }
            Some((name, value)) => {
                let key = keys::find(name).expect(change);
                key.set(&mut settings, key.parse(value).expect(value));
            }
            None => panic!("no such drive: {change}"),
        }
    }
    if is_confirmed {
        settings.confirm_board();
    }
    if has_learned {
        settings.learn(&found(), false);
    }
    settings
}

/// The result of a self-commissioning with these values.
fn result(values: &str) -> Learned {
    let mut result = found();
    for (name, value) in values.split(", ").filter_map(|value| value.split_once(' ')) {
        let number = || value.parse().expect(value);
        match name {
            "gain" => result.gain_mismatch.value = number(),
            "misfit" => result.gain_mismatch.misfit = number(),
            "constant" => result.asymmetry.constant = number(),
            "sin" => result.asymmetry.sin = number(),
            "cos" => result.asymmetry.cos = number(),
            "spread" => result.spread = number(),
            "slope" => result.slope_at_rest = number(),
            "limit" => result.limit_a = number(),
            "refused" => {
                use Verdict::{LimitTooLow, OutOfRange, SlopeTooSmall, Uneven};
                result.slope = None;
                let mut all = [Uneven, SlopeTooSmall, LimitTooLow, OutOfRange].into_iter();
                let verdict = all.find(|verdict| format!("{verdict:?}") == value);
                result.verdict = verdict.expect(value);
            }
            _ => panic!("no value of a result: {name}"),
        }
    }
    result
}

impl Player {
    fn new(changes: &str) -> Self {
        let mut talk = Talk::with(settings(changes));
        talk.front.console.greet(&talk.drive);
        let (both, outputs) = (Both { talk }, [false; 3]);
        Self { both, list: Vec::new(), outputs, divider: 0, baud: 0, line: None }
    }

    /// Carries out a line of a session; returns the lines that the drive prints, and its actions.
    fn play(&mut self, line: &str) -> Vec<String> {
        let talk = &mut self.both.talk;
        let mut lines = Vec::new();
        if let Some(request) = line.strip_prefix("bus> ") {
            talk.bus.get_or_insert_default();
            lines.push(self.ask_bus(request));
        } else if let Some(text) = line.strip_prefix(">>") {
            talk.port.sent.extend(text.trim_start().bytes().chain([b'\n']));
        } else if let Some(text) = line.strip_prefix('>') {
            lines = talk.say(format!("{}\n", text.trim_start()));
            let list = lines.split_last().map_or(&[][..], |(_, list)| list);
            if list.iter().any(|line| !line.starts_with(line::UNASKED)) {
                self.list = list.to_vec();
            }
        } else {
            let inner = line.strip_prefix('[').and_then(|line| line.strip_suffix(']'));
            let (name, value) =
                inner.map(|inner| inner.split_once(": ").unwrap_or((inner, ""))).expect(line);
            self.direct(name, value);
            if name != "pause" {
                lines = self.both.talk.say("");
            }
        }
        self.actions(&mut lines);
        lines
    }

    /// A request of the bus master, and the answer.
    fn ask_bus(&mut self, request: &str) -> String {
        let words: Vec<&str> = request.split(' ').collect();
        let number = |text: &str| match text.strip_prefix("0x") {
            Some(hex) => u16::from_str_radix(hex, 16).expect(text),
            None => text.parse().expect(text),
        };
        let exception = match words[..] {
            ["read", at] => {
                let [high, low] = number(at).to_be_bytes();
                match self.both.ask(&[3, high, low, 0, 1])[..] {
                    [3, 2, high, low] => return format!("0x{high:02x}{low:02x}"),
                    ref answer => answer[1],
                }
            }
            ["write", at, word] => self.both.write(number(at), number(word)),
            ["set", name, value] => self.both.set(name, value.parse().expect(value)),
            _ => panic!("no request: {request}"),
        };
        if exception == 0 { "ok".to_owned() } else { format!("exception {exception}") }
    }

    /// Carries out a line in brackets: something happens around the drive, or time passes.
    fn direct(&mut self, name: &str, value: &str) {
        let Talk { drive, port, terminals, now_ms, design_ms, .. } = &mut self.both.talk;
        match name {
            "drive" => *self = Self { list: take(&mut self.list), ..Self::new(value) },
            "typed" => port.sent.extend(value.replace("\\n", "\n").bytes()),
            "paste" => {
                let lines = self.list.iter().filter(|line| line.contains(value));
                lines.for_each(|line| port.sent.extend(format!("{line}\n").bytes()));
            }
            "damage" => port.damaged = true,
            "sending" => port.sending = value == "yes",
            "design" => *design_ms = ms(value).expect(value),
            "pause" => *now_ms += ms(value).expect(value),
            "no control" => drive.running = false,
            "worn-out flash" => drive.worn_out = true,
            "no motor" => {
                let mut front_end = FrontEndState::default();
                let sample =
                    Sample { current_a: 1838, current_b: 1832, dc_link: 2827, ..drive.sample };
                while !matches!(drive.drive.state(), State::Fault(_)) {
                    step(&mut drive.drive, &mut front_end, &sample);
                }
            }
            "trigger" => drive.triggered = true,
            "break" => {
                drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
            }
            "motor" => {
                let mut states = STATES.into_iter().chain([State::Off]);
                let state = states.find(|state| state.to_string() == value);
                drive.drive = in_state(state.expect(value)).drive;
            }
            "learned" => {
                drive.drive.command(&Command::Stop(Stop::Coast)).unwrap();
                drive.found = Some(result(value));
            }
            "commissioning" => {
                if value == "samples lost" {
                    drive.session.refused(None);
                }
                for _ in 0..20 {
                    let Talk { drive, .. } = &mut self.both.talk;
                    drive.session.poll(&drive.drive.test_report(), |_| ());
                    self.both.talk.poll();
                }
            }
            "counts" => {
                let (name, count) = value.split_once(' ').expect(value);
                let count = (count != "none").then(|| count.parse().expect(value));
                match name {
                    "dc_link" => drive.sample.dc_link = count.expect(value),
                    "heat_sink" => drive.sample.heat_sink = count.expect(value),
                    "motor_sensor" => terminals.codes[2] = count,
                    _ => panic!("no measurement: {name}"),
                }
            }
            "reference" => {
                let ma: f32 = value.trim_end_matches(" mA").parse().expect(value);
                terminals.codes = [Some((ma / 20.0 * 3.0 / 3.3 * 4096.0).round() as u16); 3];
            }
            "closed" => {
                let bits = value.split_whitespace().map(|name| {
                    let named = |bit: &u8| Contacts(1 << bit).to_string().trim() == name;
                    1 << (0..7).find(named).expect(name)
                });
                terminals.closed = Contacts(bits.sum());
            }
            time => self.both.talk.wait(ms(time).unwrap_or_else(|| panic!("unknown: [{time}]"))),
        }
    }

    /// Adds the actions of the drive since the last line.
    fn actions(&mut self, lines: &mut Vec<String>) {
        let Talk { drive, port, terminals, front, bus, .. } = &mut self.both.talk;
        let mut show = |action: String| lines.push(format!("-> {action}"));
        for command in take(&mut drive.commands) {
            show(match command {
                Command::Configure(with) => configured(&with, front.desk.settings().in_force()),
                command => format!("{command:?}"),
            });
        }
        if let Some(saved) = drive.saved.take() {
            assert_eq!(&saved, front.desk.settings().in_force(), "saved are the settings in force");
            show(saved.learned.map_or("saved", |_| "saved with learned values").to_owned());
        }
        take(&mut drive.changed).iter().for_each(|key| show(format!("history: {key}")));
        if take(&mut drive.reboots) > 0 {
            show(if drive.in_loader { "ST's loader" } else { "reset" }.to_owned());
        }
        if self.divider != drive.streamed.0 {
            self.divider = drive.streamed.0;
            let every = format!("every {} periods", self.divider);
            show(format!("stream: {}", if self.divider == 0 { "off" } else { &every }));
        }
        if self.baud != port.baud {
            self.baud = port.baud;
            show(format!("serial port: {} baud", self.baud));
        }
        let line = bus.as_ref().and_then(|bus| bus.line);
        if let Some((baud, format)) = line.filter(|_| self.line != line) {
            self.line = line;
            show(format!("bus: {baud:?}, {format:?}"));
        }
        if self.outputs != terminals.outputs {
            self.outputs = terminals.outputs;
            let active = ["RUN", "FAULT", "BRAKE"].into_iter().zip(self.outputs);
            let names: String =
                active.filter(|(_, on)| *on).map(|(name, _)| format!(" {name}")).collect();
            show(format!("outputs:{}", if names.is_empty() { " none" } else { &names }));
        }
    }
}

/// Says whether the drive was configured with these settings in force, or without their learned values.
fn configured(with: &Coefficients, in_force: &FirmwareSettings) -> String {
    let of = |settings: &FirmwareSettings| settings.build().is_ok_and(|built| built == *with);
    match in_force.learned {
        _ if of(in_force) => "Configure".to_owned(),
        Some(_) if of(&FirmwareSettings { learned: None, ..*in_force }) => {
            "Configure without the learned values".to_owned()
        }
        _ => "Configure with other settings".to_owned(),
    }
}

/// A time in milliseconds, from `2 s` or `150 ms`.
fn ms(time: &str) -> Option<u32> {
    sessions::seconds(time).map(|seconds| (seconds * 1e3).round() as u32)
}

#[test]
fn sessions_are_as_written() {
    let mut all_wrong = String::new();
    for entry in fs::read_dir(generated::root().join("tests/sessions")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "txt") {
            continue;
        }
        // Shown if a line cannot be played.
        println!("{}", path.display());
        let mut player = Player::new("");
        let wrong = played::difference(&path, |line| Ok(player.play(line))).unwrap();
        all_wrong += &wrong.unwrap_or_default();
    }
    assert!(all_wrong.is_empty(), "{all_wrong}");
}
