//! Procedure: no motor starts, or continues to turn, without a request. Console, bus, strip, command arbiter, drive and motor work
//! together here, one pass of the main loop per millisecond.

#[path = "../src/console/tests/doubles.rs"]
#[allow(dead_code)]
mod doubles;

use std::mem::swap;

use doubles::{FakeBus, FakeDrive, FakePort, FakeTerminals};
use drive_core::{Drive, Hardware, Sample, State};
use hil_sim::rig::Rig;
use induction_drive::front::Front;
use induction_drive::modbus::{self, slave};
use induction_drive::settings::FirmwareSettings;
use induction_drive::settings::keys;
use induction_drive::terminals::Contacts;

use crate::common::config;

/// Registers: command, frequency, reset, control word of CiA 402.
const COMMAND: u16 = 0x2000;
const FREQUENCY: u16 = 0x2001;
const RESET: u16 = 0x2002;
const CONTROL: u16 = 0x6040;
/// Command words.
const STOP: u16 = 1;
const RUN: u16 = 18;

/// The whole firmware around a simulated motor.
struct Stand {
    front: Front,
    drive: FakeDrive,
    port: FakePort,
    bus: FakeBus,
    terminals: FakeTerminals,
    rig: Rig,
    now_ms: u32,
    /// Hardware events that the drive sees in each period.
    hardware: Hardware,
}

impl Stand {
    /// A firmware with the encoder, with these changes of the configuration, and these settings of the firmware.
    fn new(changes: &[&str], settings: &str) -> Self {
        let usual = ["angle_source=encoder", "sequence.magnetise_s=0.3"];
        let config = config(&[&usual[..], changes].concat());
        let mut own = FirmwareSettings::of_the_board();
        own.drive = config.drive;
        own.command.wiring_checked = true;
        for pair in settings.split(';').filter(|pair| !pair.is_empty()) {
            let (name, value) = pair.split_once('=').unwrap();
            let key = keys::find(name).unwrap_or_else(|| panic!("{name}"));
            key.set(&mut own, key.parse(value).unwrap());
        }
        own.confirm_board();
        own.check().unwrap();
        let mut rig = Rig::from_config(&config, 1).unwrap();
        rig.drive = Drive::new(own.build().unwrap());
        let mut stand = Self {
            front: Front::new(own),
            drive: FakeDrive::new(Drive::new(own.build().unwrap())),
            port: FakePort { room: usize::MAX, ..FakePort::default() },
            bus: FakeBus::default(),
            terminals: FakeTerminals { closed: Contacts::ENABLE, ..FakeTerminals::default() },
            rig,
            now_ms: 0,
            hardware: Hardware::empty(),
        };
        stand.wait(150);
        stand
    }

    /// Lets milliseconds pass.
    fn wait(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_ms += 1;
            swap(&mut self.drive.drive, &mut self.rig.drive);
            let Self { front, port, bus, terminals, drive, now_ms, .. } = self;
            front.pass(port, Some(bus), terminals, drive, *now_ms);
            swap(&mut self.drive.drive, &mut self.rig.drive);
            for _ in 0..6 {
                if self.hardware.is_empty() {
                    self.rig.step();
                } else {
                    self.rig.step_with(&Sample { hardware: self.hardware, ..self.sample() });
                }
            }
        }
    }

    /// A sample without current.
    fn sample(&self) -> Sample {
        Sample {
            current_a: 2022,
            current_b: 2015,
            dc_link: 2827,
            heat_sink: 1309,
            ..Sample::default()
        }
    }

    fn say(&mut self, line: &str) {
        self.port.sent.extend(line.bytes().chain([b'\n']));
    }

    /// Puts a frame on the line; the checksum is added.
    fn send(&mut self, body: &[u8]) {
        let sum = modbus_core::rtu::crc16(body).to_be_bytes();
        let frame = [body, &sum].concat();
        self.bus.asked.push_back(modbus::Frame::from_slice(&frame).unwrap());
    }

    fn write(&mut self, at: u16, word: u16) {
        let ([a, b], [c, d]) = (at.to_be_bytes(), word.to_be_bytes());
        self.send(&[1, 6, a, b, c, d]);
        self.wait(2);
    }

    /// The word of a register.
    fn read(&mut self, at: u16) -> u16 {
        let [a, b] = at.to_be_bytes();
        self.bus.answers.clear();
        self.send(&[1, 3, a, b, 0, 1]);
        self.wait(1);
        let answer = self.bus.answers.pop_front().expect("an answer");
        u16::from_be_bytes([answer[3], answer[4]])
    }

    /// The milliseconds until the outputs are off; `None` if they are still on after this time.
    fn off_within(&mut self, ms: u32) -> Option<u32> {
        (0..=ms).find(|_| {
            let off = self.rig.drive.is_off();
            if !off {
                self.wait(1);
            }
            off
        })
    }

    fn state(&self) -> State {
        self.rig.drive.state()
    }

    /// Starts, and waits for the full torque.
    fn run(&mut self) {
        match self.front.desk.commander() as usize {
            0 => {
                self.say("start torque");
                self.say("torque 1000");
            }
            1 => {
                self.write(FREQUENCY, 2000);
                self.write(COMMAND, RUN);
            }
            _ => self.terminals.closed = Contacts(Contacts::ENABLE.0 | Contacts::START.0),
        }
        self.wait(800);
        assert!(self.state().regulates(), "{:?}: {}", self.state(), self.port.received);
        let i_q = self.rig.drive.telemetry().current.q;
        assert!(i_q > 2.5, "{i_q} A");
    }
}

/// A way to stop, and the commander.
const WAYS: [(&str, &str); 8] = [
    ("console", "stop"),
    ("console", "ENABLE"),
    ("console", "silence"),
    ("bus", "stop"),
    ("bus", "console"),
    ("bus", "silence"),
    ("bus", "ENABLE"),
    ("strip", "ENABLE"),
];

/// The limit in the manual, ms.
const OFF_MS: u32 = 200;

/// Each setting of the stop path at both ends of its range, with a locked shaft and a turning one: a coasting stop is off within 200 ms
/// from full torque, from any source. With the default slope of the current it takes the torque to zero first.
#[test]
fn a_coasting_stop_is_off_within_200_ms_whatever_is_set() {
    let settings = [
        "",
        "sequence.stop_a_per_s=0.1",
        "sequence.stop_a_per_s=100000",
        "speed.ramp_rpm_per_s=1",
        "speed.ramp_rpm_per_s=100000",
        "speed.quick_rpm_per_s=300000",
        "speed.s_ramp_s=10",
        "stop.coasts_s=0",
        "stop.coasts_s=3600",
    ];
    let shafts = [vec!["load.mode=locked"], vec!["load.mode=speed", "load.speed_rpm=100"]];
    for (setting, shaft, (from, way)) in settings
        .into_iter()
        .flat_map(|setting| shafts.iter().map(move |shaft| (setting, shaft)))
        .flat_map(|(setting, shaft)| WAYS.map(|way| (setting, shaft, way)))
    {
        let silence = if way == "silence" { "command.timeout_s=0.4" } else { "" };
        let start = "strip.enable=yes;strip.start=switch;strip.preset_1_rpm=1200;strip.presets=yes";
        let all = format!("bus.commands={from};bus.stop=coast;{start};{silence};{setting}");
        let mut stand = Stand::new(shaft, &all);
        stand.terminals.closed = Contacts(Contacts::ENABLE.0 | 1 << 5);
        stand.wait(200);
        if from == "strip" {
            stand.terminals.closed.0 |= Contacts::START.0;
        }
        // Until the torque is reached, the commander is not silent.
        for n in 0..10 {
            match (from, n) {
                ("console", 0) => stand.say("start torque\ntorque 1000"),
                ("console", _) => stand.say("status"),
                ("bus", 0) => {
                    stand.write(FREQUENCY, 4000);
                    stand.write(COMMAND, RUN);
                }
                ("bus", _) => stand.write(FREQUENCY, 4000),
                _ => {}
            }
            stand.wait(100);
        }
        let what = format!("{from}, {way}, {setting}, {shaft:?}");
        let i_q = stand.rig.drive.telemetry().current.q;
        // A slow ramp needs no torque if the shaft is at its speed.
        let full = i_q > 2.0 || (from != "console" && setting.starts_with("speed."));
        assert!(stand.state().regulates() && full, "{what}: {:?}, {i_q} A", stand.state());
        let patience = match way {
            "stop" if from == "console" => {
                stand.say("stop");
                OFF_MS
            }
            "console" => {
                stand.say("stop");
                OFF_MS
            }
            "stop" => {
                stand.write(COMMAND, STOP);
                OFF_MS
            }
            "ENABLE" => {
                stand.terminals.closed = Contacts(stand.terminals.closed.0 & !Contacts::ENABLE.0);
                OFF_MS
            }
            _ => 400 + OFF_MS,
        };
        let took = stand.off_within(patience);
        assert!(took.is_some(), "{what}: on after {patience} ms");
    }
}

/// `stop now`, disable voltage of CiA 402, the base block and ENABLE set to `now` switch off in the same pass, from full torque.
#[test]
fn a_stop_at_once_is_off_in_the_same_pass() {
    for way in ["console", "disable voltage", "base block", "ENABLE"] {
        let enable = "strip.enable=now;bus.commands=bus";
        let mut stand = Stand::new(&["load.mode=locked"], enable);
        stand.run();
        match way {
            "console" => stand.say("stop now"),
            "disable voltage" => stand.write(CONTROL, 0),
            "base block" => stand.write(RESET, 4),
            _ => {
                stand.terminals.closed = Contacts(0);
                // Two readings distinguish an open wire from a disturbance.
                stand.wait(1);
            }
        }
        stand.wait(1);
        assert_eq!(stand.state(), State::Off, "{way}");
    }
}

/// Stops by ramp take the time of their ramp.
#[test]
fn a_stop_by_ramp_keeps_its_ramp() {
    let mut stand = Stand::new(&["load.mode=free"], "speed.ramp_rpm_per_s=300");
    stand.say("start speed");
    stand.say("speed 300");
    stand.wait(2500);
    stand.say("stop ramp");
    stand.wait(500);
    assert_eq!(stand.state(), State::Braking);
    assert!(stand.off_within(1500).is_some());
}

/// A frame every 400 ms after a run command, with a time-out of 1 s. Only a valid frame for this drive that writes command, frequency or
/// control word keeps the drive running; with `bus.alive any` each valid request to its address does.
#[test]
fn only_a_valid_command_is_a_sign_of_life() {
    let write = |at: u16, word: u16| {
        let ([a, b], [c, d]) = (at.to_be_bytes(), word.to_be_bytes());
        vec![1, 6, a, b, c, d]
    };
    let broadcast = |at| [vec![0], write(at, 5)[1..].to_vec()].concat();
    let frames = [
        ("nothing", vec![], false, false),
        ("a read", vec![1, 3, 0x21, 3, 0, 1], false, true),
        ("a read of another slave", vec![2, 3, 0x21, 3, 0, 1], false, false),
        ("a write to an illegal register", write(0x1fff, 5), false, false),
        ("an illegal command word", write(COMMAND, 3), false, false),
        ("a broadcast to a register of another maker", broadcast(0x0c00), false, false),
        ("a broadcast of the frequency", broadcast(FREQUENCY), false, false),
        ("a write of no registers", vec![1, 16, 0x20, 0, 0, 0, 0], false, false),
        ("two bytes", vec![1, 6], false, false),
        ("a setting", write(0x4fff, 3), false, true),
        ("the frequency", write(FREQUENCY, 900), true, true),
        ("the run command", write(COMMAND, RUN), true, true),
        ("the control word", write(CONTROL, 15), true, true),
    ];
    for (alive, (what, frame, by_writes, by_any)) in
        ["writes", "any"].into_iter().flat_map(|alive| frames.clone().map(|frame| (alive, frame)))
    {
        let mut stand =
            Stand::new(&["load.mode=free"], &format!("bus.commands=bus;bus.alive={alive}"));
        stand.write(FREQUENCY, 500);
        stand.write(COMMAND, RUN);
        for _ in 0..8 {
            stand.wait(400);
            if !frame.is_empty() {
                stand.send(&frame);
                stand.wait(2);
            }
        }
        let lives = if alive == "any" { by_any } else { by_writes };
        assert_eq!(!stand.rig.drive.is_off(), lives, "{alive}: {what}: {:?}", stand.state());
    }
}

/// A stop that comes while the controllers are designed cancels the start, from each source.
#[test]
fn a_stop_during_a_design_cancels_the_start() {
    for (from, way) in [("bus", "bus"), ("bus", "late"), ("bus", "ENABLE"), ("console", "bus")] {
        let mut stand = Stand::new(&[], &format!("bus.commands={from};strip.enable=yes"));
        // The setting requires a design.
        if from == "bus" {
            let at = (0x4000 + 2 * keys::find("motor.inertia").unwrap().id()).to_be_bytes();
            let value = 0.02_f32.to_be_bytes();
            stand.send(&[&[1, 16], &at[..], &[0, 2, 4], &value].concat());
            stand.wait(2);
            stand.send(&[1, 6, 0x20, 0, 0, RUN as u8]);
        } else {
            stand.say("set motor.inertia 0.02");
            stand.say("start speed");
        }
        stand.wait(1);
        assert!(stand.front.desk.is_busy() || from == "console", "{from}, {way}");
        let stop = [1, 6, 0x20, 0, 0, STOP as u8];
        match way {
            // The stop is handled as in the interrupt of the port.
            "bus" => {
                let sum = modbus_core::rtu::crc16(&stop).to_be_bytes();
                let (answer, stop) =
                    slave::busy(&[&stop[..], &sum].concat(), 1, modbus::bus::is_stop);
                assert!(answer.is_some_and(|answer| answer[1] == 6), "acknowledged");
                stand.bus.stop = stop;
            }
            // The stop came before the port was told that the slave is busy.
            "late" => stand.send(&stop),
            _ => stand.terminals.closed = Contacts(0),
        }
        for _ in 0..300 {
            stand.wait(1);
            assert!(stand.rig.drive.is_off(), "{from}, {way}: {:?}", stand.state());
        }
        assert!(!stand.front.desk.is_busy());
    }
}

/// A master writes reset and run in turn, with the reset bit set or as an edge, while the power stage trips: at most three faults in 10
/// s.
#[test]
fn a_short_circuit_is_not_started_into_without_end() {
    for words in [[0x0086, 0x008f], [0x0006, 0x008f], [0x0086, 0x000f]] {
        let mut stand = Stand::new(&[], "bus.commands=bus");
        stand.hardware = Hardware::BREAK;
        let (mut faults, mut was) = (0, false);
        for n in 0..2000 {
            stand.write(CONTROL, words[n % 2]);
            stand.wait(3);
            let is = matches!(stand.state(), State::Fault(_));
            faults += u32::from(is && !was);
            was = is;
        }
        // 10 s have passed.
        assert!(stand.now_ms >= 10_000 && (1..=3).contains(&faults), "{words:?}: {faults}");
    }
}

/// With a brake, the output opens it only after the drive has produced torque against it, closes it at the stop, and holds the shaft for
/// the time that the brake needs. A fault and `stop now` do not wait.
#[test]
fn a_brake_opens_behind_the_torque_and_closes_before_it_ends() {
    let own = "strip.brake=yes;strip.brake_s=0.3";
    let mut stand = Stand::new(&["load.mode=locked"], own);
    stand.say("start torque");
    stand.say("torque 1");
    let (mut proof, mut ms) = (0.0_f64, 0);
    while !stand.state().regulates() {
        assert!(!stand.terminals.outputs[2] && ms < 3000, "{:?}", stand.state());
        stand.wait(1);
        proof = proof.max(stand.rig.plant.torque());
        ms += 1;
    }
    // A quarter of the largest torque, 1 Nm with the low flux.
    assert!((0.2..0.35).contains(&proof), "{proof} Nm");
    stand.wait(200);
    assert!(stand.terminals.outputs[2]);
    stand.say("stop");
    stand.wait(5);
    assert!(!stand.terminals.outputs[2] && stand.state() == State::Stopping);
    let took = 5 + stand.off_within(600).expect("it ends");
    assert!((300..=500).contains(&took), "{took} ms");
    for end in ["stop now", "break"] {
        let mut stand = Stand::new(&["load.mode=locked"], own);
        stand.say("start torque");
        stand.wait(1500);
        assert!(stand.terminals.outputs[2]);
        if end == "break" {
            stand.hardware = Hardware::BREAK;
        } else {
            stand.say(end);
        }
        stand.wait(3);
        assert!(stand.rig.drive.is_off() && !stand.terminals.outputs[2], "{end}");
    }
}

/// A stop by ramp holds the shaft at rest until the brake has closed, against a load that would turn it.
#[test]
fn a_load_does_not_fall_before_the_brake_has_closed() {
    let free = ["load.mode=free", "load.torque_nm=0.4"];
    let mut stand = Stand::new(&free, "strip.brake=yes;strip.brake_s=0.3");
    stand.say("start speed");
    stand.wait(1500);
    stand.say("speed 200");
    stand.wait(2000);
    stand.say("stop ramp");
    let mut closed = None;
    let mut ms = 0;
    while !stand.rig.drive.is_off() {
        stand.wait(1);
        ms += 1;
        if !stand.terminals.outputs[2] && closed.is_none() {
            closed = Some(ms);
        }
        assert!(ms < 3000);
    }
    let rest = stand.rig.plant.mechanical_speed() * 60.0 / std::f64::consts::TAU;
    assert!(rest.abs() < 15.0, "{rest} rpm");
    assert!(ms - closed.expect("it closes") >= 300, "{closed:?} of {ms}");
}

/// After a coasting stop and after a fault the registers show no torque and no current, and the last measured speed, marked as assumed,
/// until `stop.coasts_s` has passed. After a stop by ramp the shaft is at rest, and nothing is assumed. Console and stream show the same
/// values.
#[test]
fn a_drive_that_is_off_shows_no_torque_and_the_last_speed() {
    for end in ["coast", "fault", "ramp"] {
        let injection = ["load.mode=free", "angle_source=injection"];
        let own = "bus.commands=bus;bus.stop=coast;bus.alive=any;stop.coasts_s=3;injection.allow_unlearned=yes";
        let mut stand = Stand::new(&injection, own);
        assert_ne!(stand.read(0x2101) & 0x8000, 0, "after a reset nobody knows");
        stand.write(FREQUENCY, 1000);
        stand.write(COMMAND, RUN);
        for _ in 0..35 {
            stand.wait(100);
            stand.read(0x2101);
        }
        assert_eq!((stand.state(), stand.read(0x2101) & 0x8003), (State::Speed, 3), "{end}");
        let turning = stand.read(0x2107);
        assert!((290..=310).contains(&turning), "{turning} rpm");
        match end {
            "coast" => stand.write(COMMAND, STOP),
            "fault" => {
                stand.hardware = Hardware::BREAK;
                stand.wait(2);
                stand.hardware = Hardware::empty();
            }
            _ => stand.write(CONTROL, 6),
        }
        for _ in 0..20 {
            stand.wait(100);
            if stand.rig.drive.is_off() {
                break;
            }
        }
        assert!(stand.rig.drive.is_off(), "{end}");
        stand.wait(200);
        let torque_and_current = [0x210b, 0x2104, 0x2106].map(|at| stand.read(at));
        assert_eq!(torque_and_current, [0; 3], "{end}");
        let shown = |stand: &mut Stand| {
            let (rpm, hz) = (stand.read(0x2107), stand.read(0x2103));
            let [delta, cia] = [stand.read(0x2101) >> 15 & 1, stand.read(0x6041) >> 14 & 1];
            assert_eq!(delta, cia);
            (rpm, hz, delta == 1)
        };
        stand.port.received.clear();
        stand.say("status");
        stand.wait(5);
        let status = stand.port.received.clone();
        let after = shown(&mut stand);
        if end == "ramp" {
            assert_eq!(after, (0, 0, false));
            assert!(status.contains("speed 0.0 rpm, "), "{status}");
        } else {
            assert!(
                after.0.abs_diff(turning) < 5 && after.1.abs_diff(1000) < 30 && after.2,
                "{after:?}"
            );
            assert!(status.contains(" rpm assumed: ") && !status.contains("i_q"), "{status}");
            stand.wait(2500);
            assert!(shown(&mut stand).2);
            stand.wait(600);
            assert_eq!(shown(&mut stand), (0, 0, false), "{end}");
        }
    }
}
