mod doubles;

use drive_core::identify::online::NoEstimate;
use drive_core::io::PERIOD_S;
use drive_core::{Command, Drive, Fault, Hardware, Mode, Sample};
use proptest::prelude::*;

use super::*;
use crate::rotor_tracking::Report;
use doubles::{FakeDrive, FakePort, found};

struct Talk {
    console: Console,
    drive: FakeDrive,
    port: FakePort,
    now_ms: u32,
}

impl Talk {
    fn new() -> Self {
        let mut settings = FirmwareSettings::of_the_board();
        settings.command.wiring_checked = true;
        Self {
            console: Console::new(settings),
            drive: FakeDrive::new(Drive::new(settings.build().unwrap())),
            port: FakePort { room: usize::MAX, ..FakePort::default() },
            now_ms: 0,
        }
    }

    fn poll(&mut self) {
        self.console.poll(&mut self.port, &mut self.drive, self.now_ms);
    }

    /// Sends bytes and gives the replies.
    fn say(&mut self, bytes: impl AsRef<[u8]>) -> Vec<String> {
        self.port.sent.extend(bytes.as_ref());
        while !self.port.sent.is_empty() {
            self.poll();
        }
        self.poll();
        let text = std::mem::take(&mut self.port.received);
        text.split_terminator("\r\n").map(str::to_owned).collect()
    }

    /// Sends a line that has one reply.
    fn ask(&mut self, line: &str) -> String {
        let replies = self.say(format!("{line}\n"));
        assert_eq!(replies.len(), 1, "{replies:?}");
        replies.into_iter().next().unwrap()
    }
}

#[test]
fn says_at_the_start_who_it_is_and_what_ended_the_last_run() {
    let mut talk = Talk::new();
    talk.console.greet(&talk.drive);
    assert_eq!(talk.say(""), ["induction-drive version; last run: power-on"]);
}

#[test]
fn a_session() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok");
    assert_eq!(talk.ask("get motor.r_s"), "motor.r_s = 5.5 ohm (0.001 to 1000)");
    assert_eq!(
        talk.ask("get angle_source"),
        "angle_source = injection (one of: encoder injection)"
    );
    assert_eq!(talk.ask("angle encoder"), "ok");
    assert_eq!(talk.ask("get angle_source"), "angle_source = encoder (one of: encoder injection)");
    assert_eq!(talk.ask("torque 1"), "error: not possible while the drive is off");
    assert_eq!(talk.ask("start"), "ok");
    assert_eq!(talk.ask("start"), "error: not possible while the drive is calibrating");
    assert_eq!(talk.ask("torque 1"), "ok");
    assert!(talk.ask("torque 100").starts_with("ok: limited to 3.4"));
    assert!(talk.ask("set motor.r_s 5.4").starts_with("error: the drive must be off"));
    assert!(talk.ask("save").starts_with("error: the drive must be off"));
    talk.drive.sample = Sample { dc_link: 2827, heat_sink: 1200, ..Sample::default() };
    let status = talk.ask("status");
    assert!(status.starts_with("calibrating; i_d 0.00 A"), "{status}");
    assert!(status.contains("dc link 311 V, heat sink 22 degC;"), "{status}");
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
    assert_eq!(talk.ask("speed 1e4"), "ok: limited to 300");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("faults"), "none latched; last run: power-on");
    assert_eq!(talk.ask("defaults"), "ok");
    assert_eq!(talk.ask("get motor.r_s"), "motor.r_s = 5.4 ohm (0.001 to 1000)");
}

#[test]
fn the_first_start_after_the_defaults_checks_the_wiring_until_it_was_right_once() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("defaults"), "ok");
    assert_eq!(talk.ask("get wiring_checked"), "wiring_checked = no (one of: no yes)");
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    assert_eq!(talk.drive.commands[1..], [Command::CheckWiring, Command::Start(Mode::Torque)]);
    assert_eq!(talk.ask("stop"), "ok");
    // It was not got past: it is checked again.
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    // No current in it: a motor that is not there.
    let sample = Sample {
        current_a: 1838,
        current_b: 1832,
        dc_link: 2827,
        heat_sink: 1309,
        ..Sample::default()
    };
    while !matches!(talk.drive.drive.state(), State::Fault(_)) {
        talk.drive.drive.step(&sample);
    }
    assert_eq!(talk.drive.drive.state(), State::Fault(Fault::WiringNoCurrent));
    assert_eq!(talk.ask("get wiring_checked"), "wiring_checked = no (one of: no yes)");
    // Without the check, past it.
    assert_eq!(talk.ask("clear"), "ok");
    assert_eq!(talk.ask("set wiring_checked yes"), "ok");
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn a_motor_that_is_wired_as_it_should_be_is_checked_once() {
    let mut settings = FirmwareSettings::of_the_board();
    // The simulated converter is calibrated for its own reference.
    settings.drive.scales = drive_core::settings::Scales::default();
    let mut talk = Talk::new();
    talk.console = Console::new(settings);
    talk.drive.drive = Drive::new(settings.build().unwrap());
    let mut plant = hil_sim::plant::Plant::new(&Default::default(), 1).unwrap();
    assert_eq!(talk.ask("start"), "ok: the wiring is checked first");
    let mut pending = drive_core::Compare::OFF;
    while talk.drive.drive.state() != State::Magnetising {
        assert!(talk.drive.drive.state() != State::Off, "{}", talk.drive.drive.state());
        let compare = talk.drive.drive.step(&plant.sample());
        pending.enabled &= compare.enabled;
        plant.advance(&pending, f64::from(PERIOD_S));
        pending = compare;
    }
    assert_eq!(talk.ask("get wiring_checked"), "wiring_checked = yes (one of: no yes)");
    talk.ask("stop");
    talk.drive.drive = Drive::new(settings.build().unwrap());
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn settings_out_of_range_are_refused_with_the_range() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 0"), "error: motor.r_s = 0: allowed is 0.001 to 1000 ohm");
    assert_eq!(talk.ask("get motor.r_s"), "motor.r_s = 5.4 ohm (0.001 to 1000)");
    assert!(talk.drive.commands.is_empty());
}

#[test]
fn a_latched_fault_is_shown_and_cleared() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("start"), "ok");
    talk.drive.drive.step(&Sample { hardware: Hardware::BREAK, ..Sample::default() });
    let code = Fault::Break.code();
    assert!(talk.ask("faults").starts_with(&format!("latched: fault {code}, ")));
    assert!(talk.ask("start").starts_with(&format!("error: fault {code} is latched")));
    assert_eq!(talk.ask("clear"), "ok");
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn lists_end_with_ok_and_the_next_line_cuts_them_short() {
    let mut talk = Talk::new();
    let help = talk.say("help\n");
    assert_eq!((help.len(), help.last().unwrap().as_str()), (HELP.len() + 1, "ok"));
    let all = talk.say("get\n");
    assert_eq!(all.len(), keys::COUNT + 1);
    let trace = talk.say("trace 3\n");
    assert_eq!(trace[0], "record,phi_deg,i_d,i_q,i_q_ref,v_d,v_q,delta_i,turns");
    assert_eq!(trace[1], "0,0.0000,0.0000,0.0000,0.0000,0.0000,0.0000,0.0000,0.0000");
    assert_eq!(trace.len(), 5);
    let trace = talk.say("trace 1 5 i_q dc_link\n");
    assert_eq!(trace, ["record,i_q,dc_link", "0,0.0000,0.0000", "ok"]);
    // Nothing leaves, and meanwhile a line comes.
    talk.port.room = 0;
    talk.port.sent.extend(b"get\n");
    talk.poll();
    talk.poll();
    talk.port.sent.extend(b"stop\n");
    talk.port.room = 1000;
    talk.poll();
    let lines: Vec<&str> = talk.port.received.lines().collect();
    assert_eq!(lines, [lines[0], "ok"]);
}

#[test]
fn silence_stops_a_running_drive_once_and_only_if_asked_for() {
    let mut talk = Talk::new();
    talk.ask("start");
    talk.now_ms = 1_000_000;
    assert!(talk.say("").is_empty());
    talk.ask("stop");
    assert_eq!(talk.ask("set command.timeout_s 2"), "ok");
    talk.ask("start");
    talk.now_ms += 1900;
    assert!(talk.say("").is_empty());
    // What is not understood does not count.
    talk.ask("rubbish");
    talk.now_ms += 200;
    assert_eq!(talk.say(""), ["stopped: no command for 2 s"]);
    assert_eq!(talk.drive.drive.state(), State::Off);
    talk.now_ms += 5000;
    assert!(talk.say("").is_empty());
}

#[test]
fn half_lines_are_dropped_in_time() {
    let mut talk = Talk::new();
    assert!(talk.say("start").is_empty());
    talk.now_ms += LINE_MS + 1;
    assert_eq!(talk.say(""), ["error: the line was not finished"]);
    assert_eq!(talk.say("\n"), [""; 0]);
    assert!(talk.drive.commands.is_empty());
}

#[test]
fn a_line_has_its_own_time_whatever_came_before() {
    let mut talk = Talk::new();
    assert!(talk.say("rubbish").is_empty());
    // Late, but whole, and the next line begins in the same breath.
    talk.now_ms += LINE_MS + 1;
    talk.port.sent.extend(b"\nst");
    talk.poll();
    assert_eq!(talk.say("op\n"), ["error: no such command; `help` lists them", "ok"]);
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
fn without_a_control_interrupt_nothing_is_promised() {
    let mut talk = Talk::new();
    talk.drive.running = false;
    for line in ["start", "torque 1", "set motor.r_s 5.5", "status"] {
        assert_eq!(talk.ask(line), "error: the control does not run");
    }
    assert_eq!(talk.ask("get motor.r_s"), "motor.r_s = 5.4 ohm (0.001 to 1000)");
}

#[test]
fn status_tells_what_is_known_of_the_rotor_time_constant() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set track_rotor yes"), "ok");
    let of_the_rotor = |talk: &mut Talk| {
        let status = talk.ask("status");
        status.split_once("; tau_r ").map(|(_, rest)| rest.to_owned())
    };
    assert_eq!(of_the_rotor(&mut talk), None, "not while it is off");
    // One that regulates.
    let mut config = hil_sim::Config::default();
    config.drive.angle_source = drive_core::settings::AngleSource::Encoder;
    let mut rig = hil_sim::rig::Rig::from_config(&config, 1).unwrap();
    rig.start(Mode::Torque).unwrap();
    talk.drive.drive = rig.drive;
    assert_eq!(of_the_rotor(&mut talk).unwrap(), "not found: settling; used 186.1 ms");
    // The longest is not cut off.
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
        [Command::Start(Mode::Torque), Command::Torque(1.5), Command::Stop, Command::Clear]
    );
}

#[test]
fn what_is_learned_is_listed_saved_and_forgotten_with_its_settings() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("learned"), "ok: nothing learned with these settings");
    talk.drive.found = Some(found());
    let list = talk.say("learned\n");
    assert_eq!(
        list[..4],
        [
            "asymmetry 0.00100; gain mismatch 0.01000 (misfit 0.00020); \
             current saliency 0.03000 (misfit 0.02000); flux saliency -0.03500",
            "i_q,reference,carrier",
            "0.00,0.00000,1.00000",
            "0.25,0.01617,1.00233",
        ]
    );
    assert_eq!((list.len(), list.last().unwrap().as_str()), (2 + 14 + 1, "ok"));
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.drive.saved.unwrap().learned, Some(found()));
    // What it does not depend on leaves it, and the drive works with it.
    assert_eq!(talk.ask("set limits.dc_over_v 390"), "ok");
    let Some(Command::Configure(with)) = talk.drive.commands.last() else { panic!("no order") };
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.limits.dc_over_v = Some(390.0);
    assert_ne!(*with, settings.build().unwrap());
    settings.learn(&found());
    assert_eq!(*with, settings.build().unwrap());
    // What was refused leaves it too.
    assert!(talk.ask("set motor.r_r 0").starts_with("error"));
    assert!(talk.say("learned\n").len() > 10);
    let forgotten = "ok: what was learned belonged to other settings and is forgotten";
    assert_eq!(talk.ask("set motor.r_r 1.2"), forgotten);
    assert_eq!(talk.ask("learned"), "ok: nothing learned with these settings");
    talk.drive.found = Some(found());
    assert_eq!(talk.ask("defaults"), forgotten);
    assert_eq!(talk.ask("defaults"), "ok");
}

#[test]
fn what_is_not_believable_is_shown_and_not_used() {
    let mut talk = Talk::new();
    talk.drive.found = Some(Learned { accepted: false, asymmetry: 0.02, ..found() });
    let list = talk.say("learned\n");
    assert!(list[0].starts_with("not believable, not used: asymmetry 0.02000; "), "{list:?}");
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.drive.saved.unwrap().learned, None);
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
