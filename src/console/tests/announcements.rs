use std::rc::Rc;

use drive_core::AngleSource;
use hil_sim::rig::Rig;

use super::*;
use crate::desk::news::News;

/// Bytes per second of the wire.
const BYTES_PER_S: f64 = 11_520.0;
/// Longest time from a fault to its announcement, s.
const LATEST_S: f64 = 0.2;

/// A drive with its motor in this state.
pub(super) fn in_state(state: State) -> Rig {
    let mut config = hil_sim::Config::default();
    config.drive.angle_source =
        if state == State::Verifying { AngleSource::Injection } else { AngleSource::Encoder };
    config.drive.injection.beside_encoder = true;
    let mut rig = Rig::from_config(&config, 1).unwrap();
    let mode = match state {
        State::Speed => Mode::Speed,
        State::Position => Mode::Position,
        State::VoltsPerHertz => Mode::VoltsPerHertz,
        State::Learning => Mode::Learning,
        _ => Mode::Torque,
    };
    if state == State::CheckingWiring {
        rig.command(&Command::CheckWiring).unwrap();
    }
    rig.drive.command(&Command::Start(mode)).unwrap();
    if matches!(state, State::Stopping | State::Off) {
        while rig.drive.state() != State::Torque {
            rig.step();
        }
        rig.drive.command(&Command::Torque(2.0)).unwrap();
        rig.wait(0.1);
        rig.drive.command(&Command::Stop(Stop::Coast)).unwrap();
    }
    for _ in 0..60_000 {
        if rig.drive.state() == state {
            return rig;
        }
        rig.step();
    }
    panic!("never {state}, but {}", rig.drive.state());
}

/// Polls the console as the wire allows, ten times a millisecond, until a line begins with this text; returns the time and the line.
fn until_line(talk: &mut Talk, begins: &str) -> (f64, String) {
    const POLL_S: f64 = 1e-4;
    let mut room = 0.0;
    for poll in 0..20_000 {
        talk.now_ms += u32::from(poll % 10 == 9);
        room += BYTES_PER_S * POLL_S;
        // The space that the transmit queue of 512 bytes has freed by sending.
        talk.port.room = (talk.port.room + room as usize).min(511);
        room -= room.floor();
        talk.poll();
        if let Some(line) = talk.port.received.lines().find(|line| line.starts_with(begins)) {
            // The queue is sent after it.
            let sent = (511 - talk.port.room) as f64 / BYTES_PER_S;
            return (f64::from(poll) * POLL_S + sent, line.to_owned());
        }
    }
    panic!("no line {begins}: {}", talk.port.received);
}

pub(super) const STATES: [State; 11] = [
    State::Calibrating,
    State::Precharge,
    State::CheckingWiring,
    State::Magnetising,
    State::Verifying,
    State::Torque,
    State::Speed,
    State::Position,
    State::VoltsPerHertz,
    State::Learning,
    State::Stopping,
];

/// In every state, while nothing is being printed, and while a list or a trace is.
#[test]
fn a_fault_in_any_state_is_told_in_words_within_a_fifth_of_a_second() {
    for state in STATES {
        let rig = Rc::new(in_state(state));
        for printing in
            ["", "get\n", "describe\n", "trace 1000\n", "trace 5 on fault\n", "rubbish\n", "tor"]
        {
            let mut talk = Talk::new();
            talk.drive.drive = rig.drive.clone();
            talk.say("");
            // The wire is busy: the queue is full, and a line waits.
            talk.port.room = 511;
            talk.port.sent.extend(printing.bytes());
            for _ in 0..40 {
                talk.poll();
            }
            talk.port.received.clear();
            talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
            assert_eq!(talk.drive.drive.state(), State::Fault(Fault::Break));
            let (seconds, line) = until_line(&mut talk, "* fault 20: ");
            assert!(seconds < LATEST_S, "{state}, {printing:?}: {seconds} s");
            assert_eq!(
                line,
                "* fault 20: the power stage pulled the break input; likely: the power stage reports a fault of its \
                 own; type 'clear'"
            );
        }
    }
}

/// The interrupted output goes on after the announcement.
#[test]
fn an_announcement_comes_between_the_lines_of_a_list() {
    let mut talk = Talk::new();
    talk.ask("start");
    talk.port.sent.extend(b"get\n");
    for _ in 0..10 {
        talk.poll();
    }
    talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    let lines = talk.say("");
    assert_eq!(lines.len(), keys::COUNT + 2);
    let fault = lines.iter().position(|line| line.starts_with("* fault ")).unwrap();
    assert!((1..20).contains(&fault) && lines.last().unwrap() == "ok");
    // It is announced once.
    talk.now_ms += 60_000;
    assert!(talk.say("").is_empty());
}

#[test]
fn every_fault_fits_a_line() {
    for fault in Fault::ALL {
        let mut console = Console::default();
        console.tell(News::Fault(*fault), &Desk::new(FirmwareSettings::of_the_board()));
        let text = console.out.as_str();
        let fits = text.len() < line::OUTPUT - line::LONGEST;
        assert!(fits && text.ends_with("type 'clear'\r\n"), "{text}");
    }
}

#[test]
fn a_learning_tells_its_progress_and_its_end() {
    let mut talk = Talk::new();
    let mut rig = in_state(State::Learning);
    talk.drive.drive = rig.drive.clone();
    let first = talk.say("");
    let seconds = first[0].strip_prefix("* learning: point 1 of 56, ").unwrap();
    let expected: f64 = seconds.strip_suffix(" s left").unwrap().parse().unwrap();
    let began = rig.time();
    let (mut told, mut lines) = (0, Vec::new());
    // One step is 80 ms.
    while rig.drive.state() == State::Learning {
        rig.wait(0.08);
        talk.drive.drive = rig.drive.clone();
        talk.drive.found = rig.drive.learned().copied();
        talk.now_ms += 80;
        lines = talk.say("");
        told = if lines.is_empty() { told + 80 } else { 0 };
        assert!(told < 10_000, "silent for {told} ms");
    }
    // The flux rotates a little slower at the beginning of every point.
    let took = rig.time() - began;
    assert!((took / expected - 1.0).abs() < 0.05, "{took} s, {expected} s were expected");
    lines.extend(talk.say(""));
    lines.sort();
    assert!(lines[0].starts_with("* learned: slope -0.0"), "{lines:?}");
    assert!(lines[1].starts_with("* learned: trackable from -0.88 to 0.88 Nm"), "{lines:?}");
    assert_eq!(lines[2..], ["* off: the learning has ended"]);
}
