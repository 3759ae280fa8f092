//! The bus beside the console.

use drive_core::{Command, Hardware, Measured, Mode, State, Stop};
use proptest::prelude::*;

use super::super::Frame;
use super::super::settings::{Baud, Format};
use crate::console::tests::{FakeBus, Talk};
use crate::settings::{FirmwareSettings, keys};

/// A console with a bus; the bus commands if `lines` say so.
pub(crate) struct Both {
    pub talk: Talk,
}

impl Both {
    fn new(lines: &str) -> Self {
        let mut talk = Talk::new();
        talk.bus = Some(FakeBus::default());
        talk.say(lines);
        talk.drive.commands.clear();
        Self { talk }
    }

    pub fn by_bus() -> Self {
        Self::new("set bus.commands bus\napply\n")
    }

    fn serve(&mut self) {
        let Talk { front, drive, bus, now_ms, .. } = &mut self.talk;
        front.bus.serve(bus.as_mut().unwrap(), &mut front.desk, drive, *now_ms);
    }

    /// The port of the bus.
    fn port(&mut self) -> &mut FakeBus {
        self.talk.bus.as_mut().unwrap()
    }

    /// The answer to a request: without address and checksum.
    pub fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let body = [&[1], pdu].concat();
        let sum = modbus_core::rtu::crc16(&body).to_be_bytes();
        self.port().asked.push_back(Frame::from_slice(&[&body[..], &sum].concat()).unwrap());
        self.serve();
        let answer = self.port().answers.pop_front().expect("an answer");
        answer[1..answer.len() - 2].to_vec()
    }

    /// Writes a register; returns the exception, or 0.
    pub fn write(&mut self, at: u16, word: u16) -> u8 {
        let pdu = [&[6], &at.to_be_bytes()[..], &word.to_be_bytes()].concat();
        let answer = self.ask(&pdu);
        if answer == pdu { 0 } else { answer[1] }
    }

    pub fn read(&mut self, at: u16) -> u16 {
        let [high, low] = at.to_be_bytes();
        let answer = self.ask(&[3, high, low, 0, 1]);
        assert_eq!(answer[..2], [3, 2]);
        u16::from_be_bytes([answer[2], answer[3]])
    }

    /// Stages a setting, by its name.
    pub fn set(&mut self, name: &str, value: f32) -> u8 {
        let at = (0x4000 + 2 * keys::find(name).unwrap().id()).to_be_bytes();
        let answer = self.ask(&[&[16], &at[..], &[0, 2, 4], &value.to_be_bytes()].concat());
        if answer[0] == 16 { 0 } else { answer[1] }
    }
}

#[test]
fn the_console_commands_by_default_and_the_bus_may_read_and_stop() {
    let mut both = Both::new("");
    for (at, word) in
        [(0x2000, 18), (0x2000, 34), (0x2001, 500), (0x2002, 2), (0x4fff, 1), (0x2000, 16)]
    {
        assert_eq!(both.write(at, word), 4, "{at:#x} {word}");
    }
    assert_eq!(both.set("motor.r_s", 5.5), 4);
    assert!(both.talk.drive.commands.is_empty());
    // A repeated refusal is told once.
    let said = both.talk.say("");
    let words = "* bus: refused: the console commands: `set bus.commands bus` lets the bus";
    assert_eq!(said.iter().filter(|line| *line == words).count(), 1, "{said:?}");
    // Switch on disabled, and not remote.
    assert_eq!((both.read(0x6041) & 0x26f, both.read(0x5009)), (0x40, 0));
    // LinuxCNC writes the release all the time: it does not stop the console's run, but a stop does.
    both.talk.say("start speed\n");
    assert_eq!((both.write(0x2000, 0), both.write(0x2000, 1)), (0, 0));
    assert_eq!(both.talk.drive.commands, [Command::Start(Mode::Speed), Command::Stop(Stop::Coast)]);
}

#[test]
fn the_bus_commands_with_frequencies() {
    let mut both = Both::by_bus();
    for line in ["start", "torque 1", "speed 1", "position 1", "relock", "learn", "commission"] {
        assert!(both.talk.ask(line).starts_with("error: the bus commands"), "{line}");
    }
    assert_eq!(both.read(0x6041) & 0x26f, 0x221, "ready to switch on, remote");
    assert_eq!(both.port().line, Some((Baud::B19200, Format::Even)));
    // The frequency first, as grblHAL does; then a run, which is repeated.
    assert_eq!((both.write(0x2001, 250), both.write(0x2000, 18)), (0, 0));
    both.serve();
    assert_eq!((both.write(0x2000, 18), both.read(0x2000)), (0, 18));
    assert_eq!(both.write(0x2001, 500), 0);
    assert_eq!((both.write(0x2000, 34), both.read(0x2000)), (0, 34));
    // Only the direction changes; both directions reverse it.
    assert_eq!((both.write(0x2000, 16), both.write(0x2000, 0x32)), (0, 0));
    assert_eq!(both.write(0x2000, 1), 0);
    let speed = Command::Speed;
    // 60 / 2 pole pairs.
    let given = [speed(75.0), speed(150.0), speed(-150.0), speed(150.0), speed(-150.0)];
    let commands = &both.talk.drive.commands;
    assert_eq!(commands[0], Command::Start(Mode::Speed));
    assert_eq!(commands[1..6], given);
    assert_eq!(commands[6..], [Command::Stop(Stop::Coast)]);
    // Refused: a jog, bits without a meaning, an external fault.
    for (at, word) in [(0x2000, 3), (0x2000, 0x80), (0x2002, 1)] {
        assert_eq!(both.write(at, word), 3, "{at:#x} {word}");
    }
    // A read-only register, and an address without a register.
    assert_eq!((both.write(0x2103, 0), both.write(0x3000, 0)), (2, 2));
}

#[test]
fn a_stop_from_elsewhere_holds_until_the_bus_writes_a_stop() {
    let mut both = Both::by_bus();
    both.write(0x2000, 18);
    both.serve();
    assert_eq!(both.talk.ask("stop"), "ok");
    both.serve();
    assert_eq!((both.write(0x2000, 18), both.read(0x2000)), (4, 1));
    assert!(both.talk.say("").concat().contains("stopped for another reason: write a stop first"));
    assert_eq!((both.write(0x2000, 0), both.write(0x2000, 18)), (0, 0));
    assert_eq!(both.talk.drive.drive.state(), State::Calibrating);
}

/// The control word of CiA 402: run, then each way to stop.
#[test]
fn the_control_word_runs_and_stops_in_three_ways() {
    let mut both = Both::by_bus();
    both.write(0x2001, 250);
    for (word, stop) in [(0x0d, Stop::Now), (0x0b, Stop::Quick), (7, Stop::Ramp), (6, Stop::Ramp)] {
        both.talk.drive.commands.clear();
        assert_eq!((both.write(0x6040, 15), both.read(0x6040)), (0, 15));
        assert_eq!((both.write(0x6040, word), both.read(0x6040)), (0, 6));
        let speed = Command::Speed(75.0);
        let wanted = [Command::Start(Mode::Speed), speed, Command::Stop(stop)];
        assert_eq!(both.talk.drive.commands, wanted);
    }
    both.talk.drive.commands.clear();
    assert_eq!(both.write(0x6040, 0x80), 0);
    assert_eq!(both.talk.drive.commands, [Command::Stop(Stop::Now)]);
    // Any side may stop the console's drive, but only the console clears and runs it.
    let mut both = Both::new("");
    assert_eq!(
        (both.write(0x6040, 15), both.write(0x6040, 0x86), both.write(0x6040, 2)),
        (4, 4, 0)
    );
    assert_eq!(both.talk.drive.commands, [Command::Stop(Stop::Quick)]);
}

#[test]
fn silence_of_the_one_that_commands_stops_the_drive() {
    let mut both = Both::new("set bus.commands bus command.timeout_s 1\napply\n");
    both.write(0x2000, 18);
    // Lines at the console do not keep the bus alive.
    for _ in 0..15 {
        both.talk.now_ms += 100;
        both.talk.ask("status");
        both.serve();
    }
    assert_eq!(both.talk.drive.commands.last(), Some(&Command::Stop(Stop::Coast)));
}

#[test]
fn settings_by_the_bus_go_the_way_of_the_console() {
    let mut both = Both::by_bus();
    assert_eq!((both.set("motor.r_s", 5.3), both.read(0x4fff)), (0, 1));
    assert_eq!(
        both.talk.ask("get motor.r_s"),
        "motor.r_s = 5.3 ohm (0.0001 to 1000); staged, in force: 5.4; stator resistance of a phase"
    );
    // Refused values: out of range, not a number, not a whole number, no such word, a setting of the board. None of them is staged.
    for (name, value) in [
        ("motor.r_s", 1e9),
        ("motor.r_s", f32::NAN),
        ("motor.pole_pairs", 1.5),
        ("angle_source", 2.0),
        ("bus.address", 0.0),
        ("board.confirmed", 0.0),
    ] {
        assert_eq!(both.set(name, value), 3, "{name} {value}");
    }
    assert_eq!(both.read(0x4fff), 1);
    // Half a setting.
    assert_eq!(
        (both.write(0x4000, 0), both.ask(&[16, 0x40, 1, 0, 2, 4, 0, 0, 0, 0])),
        (3, vec![0x90, 3])
    );
    // A start puts the settings in force. It is accepted at once and carried out after the answer, and the console prints nothing.
    both.talk.say("");
    assert_eq!((both.write(0x2001, 300), both.write(0x2000, 18)), (0, 0));
    assert!(both.talk.drive.commands.is_empty());
    // Every request until then, but for a stop, is answered with exception 6.
    assert_eq!((both.write(0x2001, 200), both.ask(&[3, 0x21, 1, 0, 1])), (6, vec![0x83, 6]));
    // Requests received meanwhile are not answered: the master has given them up.
    let sum = modbus_core::rtu::crc16(&[1, 8, 0, 0, 1, 2]).to_be_bytes();
    both.port()
        .asked
        .push_back(Frame::from_slice(&[&[1, 8, 0, 0, 1, 2], &sum[..]].concat()).unwrap());
    let Talk { front, drive, .. } = &mut both.talk;
    front.desk.run_pending(drive, 0);
    both.serve();
    assert_eq!(both.talk.say(""), [""; 0]);
    assert!(both.port().asked.is_empty() && both.port().answers.is_empty());
    let started = &both.talk.drive.commands[1..];
    assert_eq!(started, [Command::Start(Mode::Speed), Command::Speed(90.0)]);
    // Refused while the drive runs. While it is off: dropped, set to `auto` again, and saved.
    assert_eq!((both.set("motor.r_s", 5.2), both.write(0x4fff, 1)), (4, 4));
    both.write(0x2000, 1);
    assert_eq!(
        (both.set("limits.current_a", 3.0), both.write(0x4fff, 3), both.read(0x4fff)),
        (0, 0, 0)
    );
    assert_eq!((both.set("limits.current_a", f32::NAN), both.write(0x4fff, 2)), (0, 0));
    both.serve();
    assert_eq!(both.talk.drive.saved.unwrap().drive.motor.r_s, 5.3);
    assert_eq!(both.write(0x4fff, 9), 3);
}

/// Every hardware setting is refused, even with its present value, in the range or not; the console tells the reason once.
#[test]
fn settings_of_the_hardware_are_not_for_the_bus() {
    let mut both = Both::by_bus();
    let settings = FirmwareSettings::of_the_board();
    let hardware: Vec<_> = keys::all().filter(|key| key.hardware()).collect();
    for name in ["inverter.dead_time_s", "scales.current_a.gain", "limits.dc_over_v"] {
        assert!(hardware.iter().any(|key| key.name() == name), "{name}");
    }
    for key in hardware {
        for value in [key.number(&settings).unwrap_or(0.0), f32::NAN] {
            assert_eq!(both.set(key.name(), value), 4, "{}", key.name());
        }
        let said = both.talk.say("");
        assert_eq!(
            said,
            [format!(
                "* bus: refused: {} belongs to the hardware: set it at the console",
                key.name()
            )]
        );
    }
    // Refused beside other settings, too.
    assert_eq!(both.read(0x4fff), 0);
}

/// A bus master can tighten a setting that protects, and loosen it again up to the value that the console has set, but not beyond: neither
/// by writing the setting nor by writing another one from which its rule takes the value. The console shows the change, `status` lists the
/// settings that are looser than by default, and the history notes each change.
#[test]
fn the_bus_never_loosens_what_protects() {
    let mut both = Both::new(
        "set strip.enable yes injection.allow_unlearned no\nset bus.commands bus\napply\n",
    );
    both.talk.drive.changed.clear();
    let loose = [
        ("strip.enable", 0.0),
        ("injection.monitor", 0.0),
        ("injection.check", 0.0),
        ("injection.allow_unlearned", 1.0),
        ("limits.unexplained_v", 1000.0),
        ("limits.speed_rpm", 9999.0),
        ("speed.limit_rpm", 1999.0),
        ("command.timeout_s", 3600.0),
        ("wiring_checked", 0.0),
        ("motor.sensor", 1.0),
        ("limits.motor_a", 10.0),
        ("limits.inverter_s", 1000.0),
        ("sequence.stop_a_per_s", 0.1),
        ("speed.ramp_rpm_per_s", 1.0),
        ("bus.alive", 1.0),
        ("stop.coasts_s", 1.0),
        ("limits.dc_under_v", 100.0),
        // Values that follow from other settings by their rules.
        ("nameplate.current_a", 5.0),
        ("motor.r_s", 50.0),
    ];
    for (name, value) in loose {
        assert_eq!(both.set(name, value), 4, "{name}");
        assert_eq!((both.read(0x500b), both.read(0x4fff)), (17, 0), "{name}");
    }
    let said = both.talk.say("").concat();
    assert!(said.contains("bus: refused: motor.r_s would loosen limits.unexplained_v"), "{said}");
    let tight = [
        ("strip.enable", 2.0, 1.0),
        ("command.timeout_s", 0.5, 1.0),
        ("limits.speed_rpm", 1900.0, 2000.0),
        ("sequence.stop_a_per_s", 100.0, 30.0),
    ];
    for (name, tighter, again) in tight {
        assert_eq!((both.set(name, tighter), both.set(name, again)), (0, 0), "{name}");
        assert_eq!((both.set(name, tighter), both.write(0x4fff, 1)), (0, 0), "{name}");
        both.talk.poll();
        both.talk.poll();
        assert_eq!(both.talk.drive.changed.last(), Some(&name));
        assert_eq!(both.set(name, again), 0, "{name}: as the console had it");
        assert_eq!(both.write(0x4fff, 3), 0);
    }
    // The console may loosen it, and then the bus may up to that value.
    let status = both.talk.ask("status");
    assert!(!status.contains("looser"), "{status}");
    both.talk.say("set limits.speed_rpm 2500\napply\n");
    let status = both.talk.ask("status");
    assert!(status.contains("; looser than by default: limits.speed_rpm 2500"), "{status}");
    assert_eq!(
        (both.set("limits.speed_rpm", 2500.0), both.set("limits.speed_rpm", 2501.0)),
        (0, 4)
    );
}

#[test]
fn faults_are_listed_and_cleared() {
    let mut both = Both::by_bus();
    both.talk.now_ms = 12_345;
    both.write(0x2000, 18);
    // The power stage pulls the break.
    let pulled = Measured { hardware: Hardware::BREAK, ..Measured::default() };
    both.talk.drive.drive.step(&pulled);
    let State::Fault(fault) = both.talk.drive.drive.state() else { panic!() };
    let code = u16::from(fault.code());
    assert_eq!((both.read(0x2100), both.read(0x603f)), (code, 0xff00 | code));
    assert_eq!((both.read(0x5100), both.read(0x5102), both.read(0x5103)), (code, 12, 0));
    assert_eq!(both.read(0x6041) & 0x4f, 8);
    assert_eq!(both.write(0x2000, 18), 4, "latched");
    assert_eq!((both.write(0x2002, 2), both.read(0x2100)), (0, 0));
    // Cleared, then stopped before the next run.
    assert_eq!((both.write(0x2000, 18), both.write(0x2000, 1), both.write(0x2000, 18)), (4, 0, 0));
    assert_eq!(both.read(0x5100), code);
}

proptest! {
    /// After any frames the slave still answers, and only the commander starts the drive.
    #[test]
    fn any_frames_leave_a_bus_that_answers(frames: Vec<(u8, Vec<u8>)>, by_bus: bool) {
        let mut both = if by_bus { Both::by_bus() } else { Both::new("") };
        for (function, rest) in frames {
            let body = [&[1, function % 20], &rest[..rest.len().min(250)]].concat();
            let sum = modbus_core::rtu::crc16(&body).to_be_bytes();
            both.port().asked.push_back(Frame::from_slice(&[&body[..], &sum].concat()).unwrap());
            both.serve();
        }
        both.port().answers.clear();
        prop_assert!(by_bus || both.talk.drive.drive.state() == State::Off);
        prop_assert_eq!(both.write(0x2000, 1), 0);
    }
}
