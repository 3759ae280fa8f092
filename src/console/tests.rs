mod announcements;
mod commission;
mod documents;
mod doubles;
mod learning;
mod lists;
mod numbers;
mod passport;
mod staging;
mod stream;
mod tags;
mod torque;
mod typing;
mod wrong;

use super::grammar::HELP;
use super::*;
use crate::boards;
use crate::front::Front;
use crate::link::trace::Trigger;
use crate::rotor_tracking::Report;
use crate::settings::FirmwareSettings;
use crate::settings::keys;
/// Shared with the tests of command arbiter and store.
pub(crate) use doubles::{FakeBus, FakeDrive, found};
use doubles::{FakePort, FakeTerminals};
use drive_core::io::PERIOD_S;
use drive_core::learned::{Learned, Verdict};
use drive_core::{
    Command, Compare, Drive, Fault, FrontEndState, Hardware, Measured, Mode, Sample, State, Stop,
};
use proptest::prelude::*;
use rotor_id::online::NoEstimate;

/// A whole period of a drive with its front end.
fn step(drive: &mut Drive, front_end: &mut FrontEndState, sample: &Sample) -> Compare {
    drive.period(front_end, sample, &mut |_| {}).0
}

/// A console with a drive behind it. Shared with the tests of the modules.
pub(crate) struct Talk {
    pub front: Front,
    pub drive: FakeDrive,
    port: FakePort,
    pub terminals: FakeTerminals,
    /// The port of the bus, on a board that has one.
    pub bus: Option<FakeBus>,
    pub now_ms: u32,
}

impl Talk {
    pub fn new() -> Self {
        let mut settings = FirmwareSettings::of_the_board();
        settings.command.wiring_checked = true;
        settings.confirm_board();
        // Most of these tests start without an encoder.
        settings.drive.injection.synchronous.allow_unlearned = true;
        Self::with(settings)
    }

    fn with(settings: FirmwareSettings) -> Self {
        Self {
            front: Front::new(settings),
            drive: FakeDrive::new(Drive::new(settings.build().unwrap())),
            port: FakePort { room: usize::MAX, ..FakePort::default() },
            terminals: FakeTerminals::default(),
            bus: None,
            now_ms: 0,
        }
    }

    pub fn poll(&mut self) {
        let Self { front, port, terminals, bus, drive, now_ms } = self;
        front.pass(port, bus.as_mut(), terminals, drive, *now_ms);
    }

    /// Sends bytes and returns the replies, until the console has nothing more to say.
    pub fn say(&mut self, bytes: impl AsRef<[u8]>) -> Vec<String> {
        self.port.sent.extend(bytes.as_ref());
        // An event at the end of a pass is told in the next pass.
        let mut silent = 0;
        while !self.port.sent.is_empty() || silent < 2 {
            let said = self.port.received.len();
            self.poll();
            silent = if self.port.received.len() == said { silent + 1 } else { 0 };
        }
        let text = std::mem::take(&mut self.port.received);
        text.split_terminator("\r\n").map(str::to_owned).collect()
    }

    /// Sends a line that has one reply beside unrequested lines.
    pub fn ask(&mut self, line: &str) -> String {
        let mut replies = self.say(format!("{line}\n"));
        replies.retain(|reply| !reply.starts_with(line::UNASKED));
        assert_eq!(replies.len(), 1, "{replies:?}");
        replies.into_iter().next().unwrap()
    }
}

#[test]
fn says_at_the_start_who_it_is_and_what_ended_the_last_run() {
    let mut talk = Talk::new();
    talk.front.console.greet(&talk.drive);
    assert_eq!(talk.say(""), ["* induction-drive version; last run: power-on"]);
}

#[test]
fn a_session() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    assert_eq!(talk.ask("apply"), "ok");
    assert_eq!(talk.ask("get motor.r_s"), in_force("motor.r_s = 5.5 ohm (0.0001 to 1000)"));
    let source = "; source of the flux angle";
    let words = "(one of: encoder injection)";
    assert_eq!(talk.ask("get angle_source"), format!("angle_source = injection {words}{source}"));
    assert_eq!(talk.ask("angle encoder"), "ok: staged");
    assert_eq!(talk.ask("Apply"), "ok");
    assert_eq!(talk.ask("get angle_source"), format!("angle_source = encoder {words}{source}"));
    assert_eq!(talk.ask("torque 1"), "error: not possible while the drive is off");
    assert_eq!(talk.ask("start"), "ok");
    assert_eq!(talk.ask("start"), "error: not possible while the drive is calibrating");
    assert_eq!(talk.ask("torque 1"), "ok");
    assert_eq!(talk.ask("torque 100"), "ok: limited to 3.429 A");
    assert!(talk.ask("set motor.r_s 5.4").starts_with("error: the drive must be off"));
    assert!(talk.ask("save").starts_with("error: the drive must be off"));
    talk.drive.sample = Sample { dc_link: 2827, heat_sink: 1200, ..Sample::default() };
    let status = talk.ask("status");
    assert!(status.starts_with("calibrating; switched on; i_d 0.00 A"), "{status}");
    assert!(status.contains("dc link 311.0 V, heat sink 22 degC;"), "{status}");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.drive.saved.unwrap().drive.motor.r_s, 5.5);
    talk.drive.worn_out = true;
    assert_eq!(talk.ask("save"), "error: the flash was not erased, status 0x10");
    assert_eq!(talk.ask("start position"), "ok");
    assert_eq!(talk.ask("position 2.5"), "ok");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("start speed"), "ok");
    assert_eq!(talk.ask("speed -150"), "ok");
    assert_eq!(talk.ask("speed 1e4"), "ok: limited to 300.0 rpm");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("faults"), "none latched; last run: power-on");
    assert_eq!(talk.ask("defaults"), "ok: staged");
    assert_eq!(talk.ask("apply"), "ok");
    assert_eq!(talk.ask("get motor.r_s"), in_force("motor.r_s = 5.4 ohm (0.0001 to 1000)"));
}

fn in_force(setting: &str) -> String {
    format!("{setting}; stator resistance of a phase")
}

#[test]
fn the_first_start_after_the_defaults_checks_the_wiring_until_it_was_right_once() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("defaults"), "ok: staged");
    assert_eq!(talk.ask("set injection.allow_unlearned yes"), "ok: staged");
    assert_eq!(talk.ask("apply"), "ok");
    assert!(talk.ask("get wiring_checked").starts_with("wiring_checked = no (one of: no yes)"));
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    assert_eq!(talk.drive.commands, [Command::CheckWiring, Command::Start(Mode::Torque)]);
    assert_eq!(talk.ask("stop"), "ok");
    // The check was not passed, so the wiring is checked again.
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    // No current in the sample, as if no motor were connected.
    let sample = Sample {
        current_a: 1838,
        current_b: 1832,
        dc_link: 2827,
        heat_sink: 1309,
        ..Sample::default()
    };
    let mut front_end = FrontEndState::default();
    while !matches!(talk.drive.drive.state(), State::Fault(_)) {
        step(&mut talk.drive.drive, &mut front_end, &sample);
    }
    assert_eq!(talk.drive.drive.state(), State::Fault(Fault::WiringNoCurrent));
    assert!(talk.ask("get wiring_checked").starts_with("wiring_checked = no (one of: no yes)"));
    // Without the check, the start goes past it.
    assert_eq!(talk.ask("clear"), "ok");
    assert_eq!(talk.ask("set wiring_checked yes"), "ok: staged");
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn a_motor_that_is_wired_as_it_should_be_is_checked_once() {
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.injection.synchronous.allow_unlearned = true;
    // The simulated ADC is calibrated for its own reference.
    settings.drive.scales = drive_settings::Scales::default();
    settings.confirm_board();
    let mut talk = Talk::new();
    talk.front.desk = Desk::new(settings);
    talk.drive.drive = Drive::new(settings.build().unwrap());
    let mut plant = hil_sim::plant::Plant::new(&Default::default(), 1).unwrap();
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    let (mut pending, mut front_end) = (Compare::OFF, FrontEndState::default());
    while talk.drive.drive.state() != State::Magnetising {
        assert!(talk.drive.drive.state() != State::Off, "{}", talk.drive.drive.state());
        let compare = step(&mut talk.drive.drive, &mut front_end, &plant.sample());
        pending.enabled &= compare.enabled;
        plant.advance(&pending, f64::from(PERIOD_S));
        pending = compare;
    }
    assert!(talk.ask("get wiring_checked").starts_with("wiring_checked = yes (one of: no yes)"));
    talk.ask("stop");
    talk.drive.drive = Drive::new(settings.build().unwrap());
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn silence_stops_a_running_drive_once_and_only_if_asked_for() {
    let mut talk = Talk::new();
    talk.ask("start");
    talk.now_ms = 1_000_000;
    assert!(talk.say("").is_empty());
    talk.ask("stop");
    assert_eq!(talk.ask("set command.timeout_s 2"), "ok: staged");
    talk.ask("start");
    talk.now_ms += 1900;
    assert!(talk.say("").is_empty());
    // A line that is not understood does not count.
    talk.ask("rubbish");
    talk.now_ms += 200;
    assert_eq!(talk.say(""), ["* stopped: no command for 2 s"]);
    assert_eq!(talk.drive.drive.state(), State::Off);
    talk.now_ms += 5000;
    assert!(talk.say("").is_empty());
}

#[test]
fn half_lines_are_dropped_in_time() {
    let mut talk = Talk::new();
    assert!(talk.say("start").is_empty());
    talk.now_ms += LINE_MS + 1;
    assert_eq!(talk.say(""), ["* error: the line was not finished"]);
    assert_eq!(talk.say("\n"), [""; 0]);
    assert!(talk.drive.commands.is_empty());
}

#[test]
fn a_line_has_its_own_time_whatever_came_before() {
    let mut talk = Talk::new();
    assert!(talk.say("rubbish").is_empty());
    // The line is late but whole, and the next line begins at once.
    talk.now_ms += LINE_MS + 1;
    talk.port.sent.extend(b"\nst");
    talk.poll();
    assert_eq!(talk.say("op\n"), ["error: no such command: rubbish; `help` lists them", "ok"]);
}

#[test]
fn damage_on_the_wire_is_told_and_changes_nothing() {
    let mut talk = Talk::new();
    talk.say("sta");
    talk.port.damaged = true;
    assert_eq!(talk.say("rt\n"), ["error: characters were lost or damaged"]);
    assert!(talk.drive.commands.is_empty());
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn an_unconfirmed_board_does_not_start_until_it_is_confirmed_and_that_is_saved() {
    let mut talk = Talk::new();
    let mut settings = FirmwareSettings::of_the_board();
    settings.command.wiring_checked = true;
    talk.front.desk = Desk::new(settings);
    for mode in ["", " speed", " position", " learning"] {
        let answer = talk.ask(&format!("start{mode}"));
        assert!(answer.starts_with("error: ") && answer.contains("`confirm board`"), "{answer}");
    }
    assert!(talk.drive.commands.is_empty(), "{:?}", talk.drive.commands);
    let lines = talk.say("board\n");
    assert!(lines[0].starts_with("board reference: NUCLEO-G474RE"), "{lines:?}");
    assert_eq!(lines.len(), 4 + boards::SELECTED.assumptions().count());
    assert!(lines[lines.len() - 2].starts_with("not confirmed"), "{lines:?}");
    assert!(lines[lines.len() - 3].starts_with("boot pin: PB8 high at a reset"), "{lines:?}");
    assert_eq!(talk.ask("confirm board"), "ok: with the boot pin in use, see `board`");
    let saved = talk.drive.saved.unwrap();
    assert!(saved.board_is_confirmed());
    // The confirmation outlasts the defaults: it belongs to the hardware.
    assert_eq!(talk.ask("defaults"), "ok: staged");
    assert_eq!(talk.ask("apply"), "ok");
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    // The number is not valid for another board.
    assert!(!FirmwareSettings { board: boards::ALL[1], ..saved }.board_is_confirmed());
}

#[test]
fn lines_of_another_board_are_refused_as_a_whole() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("board reference"), "ok");
    let answer = talk.ask("board nucleo-g474re-ihm08m1");
    assert!(answer.starts_with("error: ") && answer.contains("this is reference"), "{answer}");
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    for line in ["apply", "save", "start"] {
        assert!(talk.ask(line).starts_with("error: these lines belong to the board nucleo"));
    }
    assert!(talk.drive.commands.is_empty() && talk.drive.saved.is_none());
    assert_eq!(talk.ask("revert"), "ok: 1 staged values dropped");
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    assert_eq!(talk.say("apply\n"), ["* designing...", "ok"]);
}

#[test]
fn without_a_control_interrupt_nothing_is_promised() {
    let mut talk = Talk::new();
    talk.drive.running = false;
    for line in ["start", "torque 1", "set motor.r_s 5.5", "status"] {
        assert_eq!(talk.ask(line), "error: the control does not run: a test");
    }
    assert_eq!(talk.ask("get motor.r_s"), in_force("motor.r_s = 5.4 ohm (0.0001 to 1000)"));
}

#[test]
fn status_tells_what_is_known_of_the_rotor_time_constant() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set track_rotor yes"), "ok: staged");
    assert_eq!(talk.ask("apply"), "ok");
    let of_the_rotor = |talk: &mut Talk| {
        let status = talk.ask("status");
        status.split_once("; tau_r ").map(|(_, rest)| rest.to_owned())
    };
    assert_eq!(of_the_rotor(&mut talk), None, "not while it is off");
    // A drive that regulates.
    let mut config = hil_sim::Config::default();
    config.drive.angle_source = drive_core::AngleSource::Encoder;
    let mut rig = hil_sim::rig::Rig::from_config(&config, 1).unwrap();
    rig.start(Mode::Torque).unwrap();
    talk.drive.drive = rig.drive;
    assert_eq!(of_the_rotor(&mut talk).unwrap(), "not found: settling; used 186.1 ms");
    // The longest line is not cut off.
    let tracking = talk.drive.tracking.as_ref().unwrap().report();
    for doubt in [NoEstimate::Transient, NoEstimate::PoorExcitation, NoEstimate::OutOfRange] {
        let report = Report { estimate: Err(doubt), ..tracking };
        assert!(report.to_string().len() < 75, "{report}");
    }
    assert_eq!(talk.ask("stop"), "ok");
}

#[test]
fn commands_reach_the_drive_as_they_were_given() {
    let mut talk = Talk::new();
    talk.say("start\ntorque 1.5\nstop\nclear\n");
    assert_eq!(
        talk.drive.commands,
        [
            Command::Start(Mode::Torque),
            Command::Torque(1.5),
            // Nothing is latched, so there is nothing to clear.
            Command::Stop(Stop::Coast),
        ]
    );
}

#[test]
fn what_is_not_believable_is_shown_and_not_used() {
    let mut talk = Talk::new();
    let (refused, spread) = (Learned { slope: None, ..found() }, 0.02);
    for (result, why) in [
        (
            Learned { verdict: Verdict::Uneven, spread, ..refused },
            "even part of the saliency offset spreads by 0.02000, over 0.005",
        ),
        (
            Learned { verdict: Verdict::SlopeTooSmall, slope_at_rest: -0.0123, ..refused },
            "slope -0.0123 /rad, which must be 0.02 at least",
        ),
        (
            Learned { verdict: Verdict::SlopeTooSmall, slope_at_rest: 0.0301, ..refused },
            "slope 0.0301 /rad, which must be 0.035 at least",
        ),
        (
            Learned {
                verdict: Verdict::LimitTooLow,
                slope_at_rest: -0.03,
                limit_a: 0.75,
                ..refused
            },
            "slope -0.0300 /rad is lost above 0.75 A of q-axis current, less than 1.00 A",
        ),
        (Learned { verdict: Verdict::OutOfRange, ..refused }, "a value is out of its range"),
    ] {
        talk.drive.found = Some(result);
        let list = talk.say("learned\n");
        assert_eq!(list[0], format!("* refused: {why}; nothing was changed"));
        assert!(
            list[1].starts_with(&format!("not used: {why}; nothing was changed; ")),
            "{list:?}"
        );
        assert_eq!(talk.ask("save"), "ok");
        assert_eq!(talk.drive.saved.unwrap().learned, None);
    }
}

proptest! {
    #[test]
    fn garbage_changes_nothing_and_gets_replies(bytes in proptest::collection::vec(128_u8.., 0..400)) {
        let mut talk = Talk::new();
        for reply in talk.say(&bytes) {
            prop_assert!(reply.starts_with("error: "));
        }
        prop_assert!(talk.drive.commands.is_empty());
        let replies = talk.say("\nstop\n");
        prop_assert_eq!(replies.last().unwrap(), "ok");
    }

    #[test]
    fn any_bytes_on_a_wire_with_any_room_leave_a_console_that_answers(
        bytes: Vec<u8>, room in 0_usize..200,
    ) {
        let mut talk = Talk::new();
        talk.port.room = room;
        talk.port.sent.extend(&bytes);
        for _ in 0..20 {
            talk.poll();
        }
        talk.port.room = usize::MAX;
        talk.say("\n");
        let replies = talk.say("stop\n");
        prop_assert_eq!(replies.last().unwrap(), "ok");
    }
}

/// The sensor is read ten times a second, from the settings in force; `status` and a refused start say what it reads.
#[test]
fn the_motor_sensor_is_read_and_shown() {
    let mut settings = FirmwareSettings::of_the_board();
    settings.command.wiring_checked = true;
    settings.confirm_board();
    settings.drive.angle_source = drive_core::AngleSource::Encoder;
    settings.drive.motor_sensor.sensor = drive_settings::SensorKind::Pt1000;
    let mut talk = Talk::with(settings);
    assert!(talk.ask("start").contains("fault 57 is present"));
    // 1385 ohm of 1385 + 4700.
    talk.terminals.codes[2] = Some(932);
    talk.now_ms = 100;
    let status = talk.ask("status");
    assert!(status.contains("; motor 100 degC by its sensor"), "{status}");
    for now_ms in 101..1100 {
        talk.now_ms = now_ms;
        talk.poll();
    }
    assert_eq!(talk.drive.commands.len(), 2 + 9);
    for (code, fault) in [(Some(4095), "fault 54"), (Some(0), "fault 55"), (None, "fault 57")] {
        talk.terminals.codes[2] = code;
        talk.now_ms += 100;
        talk.poll();
        let refused = talk.ask("start");
        assert!(refused.contains(&format!("{fault} is present")), "{refused}");
    }
}
