//! The board without hardware answers as the firmware does, learns, holds torque at rest, and computes the same bits as the simulator.

use drive_core::{Command, Drive, Mode};
use drive_settings::SETTINGS;
use drive_web::board::{HostBoard, plant_settings, settings};
use drive_web::motors::Motor;
use drive_web::talk::Talk;
use motor_plant::Plant;
use serde_json::Value;
use sim_bench::Config;
use sim_bench::rig::Rig;

/// Longest wait for an answer or an announcement, ms.
const PATIENCE_MS: u32 = 200_000;

struct Session {
    talk: Talk,
    number: u32,
    said: Vec<Value>,
    frames: Vec<u8>,
}

impl Session {
    fn new(seed: u64) -> Self {
        let talk = Talk::new(HostBoard::new(&Motor::all().next().unwrap(), seed).unwrap());
        Self { talk, number: 0, said: Vec::new(), frames: Vec::new() }
    }

    fn pass(&mut self, ms: u32) {
        self.talk.advance(ms);
        let (texts, frames) = self.talk.take();
        let texts: Vec<Value> = serde_json::from_str(&texts).unwrap();
        self.said.extend(texts);
        self.frames.extend(frames);
    }

    /// Waits for a message for which `found` returns a value.
    fn until<T>(&mut self, what: &str, found: impl Fn(&Value) -> Option<T>) -> T {
        for _ in 0..PATIENCE_MS / 10 {
            let found = self.said.iter().enumerate().find_map(|(n, said)| Some((n, found(said)?)));
            if let Some((n, value)) = found {
                self.said.drain(..=n);
                return value;
            }
            self.pass(10);
        }
        panic!("{what}: {:#?}", self.said.iter().rev().take(20).collect::<Vec<_>>())
    }

    fn announced(&mut self, beginning: &str) {
        let beginning = format!("* {beginning}");
        self.until(&beginning, |said| said["line"].as_str()?.starts_with(&beginning).then_some(()));
    }

    fn ask(&mut self, line: &str) -> Vec<String> {
        self.number += 1;
        let number = self.number;
        self.talk.ask(number, line);
        self.until(line, |said| {
            let lines = said["lines"].as_array().filter(|_| said["id"] == number)?;
            Some(lines.iter().map(|line| line.as_str().unwrap().to_owned()).collect())
        })
    }

    fn learned(seed: u64) -> Self {
        let mut session = Self::new(seed);
        session.until("hello", |said| said["hello"]["signals"].as_array().map(|_| ()));
        let answer = session.ask("learn").pop().unwrap();
        assert!(answer.starts_with("ok"), "{answer}");
        session.announced("learned: ");
        session.announced("off");
        session
    }
}

/// The lines of `motors.txt` for a motor, from its own file.
fn lines_of(name: &str) -> String {
    let config = Config::of_motor(Some(name)).unwrap();
    let plant = sim_bench::config::plant_settings(&config);
    let (m, s, shaft) = (plant.machine, plant.saliency, plant.mechanics);
    let (inverter, sensors) = (plant.inverter, plant.measurement);
    let numbers = [
        m.rs,
        m.rr,
        m.lls,
        m.llr,
        m.lm,
        m.pole_pairs.into(),
        s.b1,
        s.hold_a,
        s.psi_n.unwrap(),
        shaft.inertia,
        shaft.friction,
        inverter.vdc,
        inverter.residual_v,
        sensors.range_a,
        sensors.noise_a,
        sensors.dc_link_v,
    ];
    let title = sim_bench::config::motors::Motor::find(name).unwrap().title;
    let mut lines = vec![format!("{name}: {title}"), numbers.map(|n| n.to_string()).join(" ")];
    let board = induction_drive::settings::FirmwareSettings::of_the_board().drive;
    let (mut wanted, default) = (config.drive, Config::default().drive);
    // The ADCs of the board have another reference.
    let ratio = board.scales.current_a.gain / default.scales.current_a.gain;
    for line in [&mut wanted.scales.current_a, &mut wanted.scales.current_b] {
        line.gain *= ratio;
    }
    let differing = SETTINGS.iter().filter(|entry| entry.get(&config.drive) != entry.get(&default));
    lines.extend(differing.map(|entry| format!("{} {}", entry.name, entry.get(&wanted))));
    lines.join("\n")
}

#[test]
fn the_file_of_the_motors_has_what_their_own_files_say() {
    let mut all: Vec<String> =
        sim_bench::config::motors::Motor::all().into_iter().map(|motor| motor.name).collect();
    // The inverter of this motor has a shorter dead time than the board allows.
    all.retain(|name| name != "spindle-2kw2");
    // The first is the motor of the drive's default settings.
    all.sort_by_key(|name| name != "dissertation");
    let text = all.iter().map(|name| lines_of(name)).collect::<Vec<_>>().join("\n\n");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/motors.txt");
    if std::env::var_os("WRITE_DOCS").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), text, "WRITE_DOCS=1 writes it");
    for motor in Motor::all() {
        let config = Config::of_motor(Some(motor.name)).unwrap();
        let plant = plant_settings(&motor, &settings(&motor));
        let mut theirs = sim_bench::config::plant_settings(&config);
        // The ADCs and the timer are those of the board.
        (theirs.inverter, theirs.measurement) = (plant.inverter, plant.measurement);
        theirs.dc_link = plant.dc_link;
        assert_eq!(plant, theirs, "{}", motor.name);
    }
}

#[test]
fn a_drive_of_another_size_learns_its_motor_and_holds_torque_at_rest() {
    assert!(Motor::named("kart").err().unwrap().contains("kart-5kw3, krause-3hp"));
    for (name, iq_a) in [("kart-5kw3", 160.0), ("modelica-18kw5", 28.0)] {
        let motor = Motor::named(name).unwrap();
        let mut board = HostBoard::new(&motor, 1).unwrap();
        board.learn().unwrap();
        board.write(b"start torque\n");
        (0..4000).for_each(|_| board.millisecond());
        board.write(format!("torque {iq_a}\n").as_bytes());
        (0..2000).for_each(|_| board.millisecond());
        let [drive, own, psi] = board.machine.flux();
        let apart_deg = ((drive - own + 1.5) % 1.0 - 0.5) * 360.0;
        let nm = board.machine.plant.torque_factor() * psi * iq_a;
        let torque = board.machine.plant.torque();
        assert!(
            apart_deg.abs() < 5.0 && (torque / nm - 1.0).abs() < 0.2,
            "{name}: {apart_deg} degrees, {torque} of {nm} Nm"
        );
    }
}

/// The plant equals the simulator's, which has the same drive: the same seed gives the same bits.
#[test]
fn the_same_seed_gives_the_bits_of_the_simulator() {
    let motor = Motor::all().next().unwrap();
    let settings = settings(&motor);
    let plant = plant_settings(&motor, &settings);
    let mut board = HostBoard::new(&motor, 7).unwrap();
    let drive = Drive::new(settings.build().unwrap());
    let mut rig = Rig::of(Plant::new(&plant, 7).unwrap(), drive);
    let start = Command::Start(Mode::Learning);
    rig.command(&start).unwrap();
    induction_drive::desk::handle::DriveHandle::command(&mut board.machine, start).unwrap();
    for _ in 0..60_000 {
        rig.step();
        board.machine.period();
    }
    assert!(rig.plant.current().norm() > 0.1);
    assert_eq!(rig.plant.current(), board.machine.plant.current());
    assert_eq!(rig.drive.telemetry(), board.machine.drive().telemetry());
}

#[test]
fn a_learned_drive_holds_torque_at_rest_and_reports_a_wrong_angle() {
    let mut session = Session::learned(1);
    let answer = session.ask("start torque").pop().unwrap();
    assert!(answer.starts_with("ok"), "{answer}");
    session.announced("running: torque");
    session.ask("torque 2");
    session.pass(1000);
    let [_, _, flux] = session.talk.board.machine.flux();
    let torque = session.talk.board.machine.plant.torque();
    assert!(flux > 0.1 && torque > 0.5, "{flux} Wb, {torque} Nm");
    let status = session.ask("status").pop().unwrap();
    assert!(status.starts_with("regulating torque"), "{status}");
    let shown = status.split("torque ").nth(2).or(status.split("torque ").nth(1)).unwrap();
    assert!(shown.contains("Nm"), "{status}");
    assert_eq!(session.ask("!turn 150"), ["ok"]);
    session.announced("fault ");
}

#[test]
fn the_contacts_of_the_terminal_strip_start_turn_and_stop_the_drive() {
    let mut session = Session::learned(1);
    session.ask("!load free 0");
    let strip = "strip.enable yes strip.start switch strip.reverse yes strip.presets yes";
    for line in [&format!("set bus.commands strip {strip} strip.preset_1_rpm 150"), "apply"] {
        let answer = session.ask(line).pop().unwrap();
        assert!(answer.starts_with("ok"), "{line}: {answer}");
    }
    for (contacts, rpm) in
        [("ENABLE START PRESET1", 150.0), ("enable reverse start preset1", -150.0)]
    {
        session.ask("!strip ENABLE");
        session.pass(200);
        assert_eq!(session.ask(&format!("!strip {contacts}")), ["ok"]);
        session.announced("running: speed");
        session.pass(3000);
        let speed =
            session.talk.board.machine.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
        assert!((speed - rpm).abs() < 5.0, "{speed}");
        // START opens: a stop by ramp.
        session.ask("!strip ENABLE");
        session.announced("off: stopped");
    }
    assert!(session.ask("!strip START2")[0].contains("START2: allowed is ENABLE, START, STOP"));
    // ENABLE must have been open for a tenth of a second.
    session.pass(200);
    session.ask("!strip ENABLE START PRESET1");
    session.announced("running: speed");
    // ENABLE opens: the torque goes at once.
    session.ask("!strip START PRESET1");
    session.announced("off: stopped");
}

/// A running drive, some time before its motor loses the saliency.
fn running(seed: u64, mode: &str, reference: f64, load: &str) -> Session {
    let mut session = Session::learned(seed);
    session.ask(if mode == "torque" { "!load locked" } else { "!load free 0" });
    session.ask(&format!("start {mode}"));
    session.announced(&format!("running: {mode}"));
    session.ask(&format!("{mode} {reference}"));
    session.pass(5000);
    session.ask(&format!("!load {load}"));
    session.pass(2000);
    session.ask("!saliency 0");
    session
}

/// Time until the outputs are off, ms, up to `longest`, and the largest error of the angle until then, degrees.
fn until_off(session: &mut Session, longest: u32) -> (Option<u32>, f64) {
    let mut largest = 0.0f64;
    for passed in 0..longest / 5 {
        if session.talk.board.machine.drive().is_off() {
            return (Some(5 * passed), largest);
        }
        let [own, motor, _] = session.talk.board.machine.flux();
        largest = largest.max(360.0 * ((own - motor + 1.5).rem_euclid(1.0) - 0.5).abs());
        session.pass(5);
    }
    (None, largest)
}

/// The page's guide states when the drive detects that the saliency is gone; these runs show it.
fn the_loss_of_the_saliency_is_told(seed: u64) {
    // Under torque it is detected at once, before the angle is wrong.
    for (mode, reference, load) in [("torque", 2.0, "locked"), ("speed", 150.0, "free 0.4")] {
        let (off, largest) = until_off(&mut running(seed, mode, reference, load), 1000);
        assert!(off.is_some_and(|ms| ms <= 50) && largest < 20.0, "{off:?}, {largest}");
    }
    // If the shaft is held at rest against a load, it slips away first.
    let (off, largest) = until_off(&mut running(seed, "speed", 0.0, "free 0.4"), 3000);
    assert!(off.is_some(), "{largest} degrees");
    // On an idle rotating shaft it is detected later, or not at all, while the angle stays right.
    let (off, largest) = until_off(&mut running(seed, "speed", 150.0, "free 0"), 10_000);
    assert!(largest < 10.0, "{off:?}, {largest}");
    // Without torque the drift of the frame (53 degrees in a minute) has no visible effect; with the first torque it is detected.
    let mut session = running(seed, "torque", 0.0, "locked");
    assert_eq!(until_off(&mut session, 5000).0, None);
    session.ask("torque 2");
    let (off, largest) = until_off(&mut session, 1000);
    assert!(off.is_some_and(|ms| ms <= 100) && largest < 60.0, "{off:?}, {largest}");
    // Above the speed range of the injection it is not detected; it is on the way down.
    let mut session = running(seed, "speed", 1200.0, "free 0.2");
    let (off, largest) = until_off(&mut session, 5000);
    assert!(off.is_none() && largest < 15.0, "{off:?}, {largest}");
    session.ask("speed 0");
    let (off, _) = until_off(&mut session, 10_000);
    assert!(off.is_some());
    session.announced("fault 26");
}

#[test]
fn the_loss_of_the_saliency_is_told_as_soon_as_it_matters() {
    the_loss_of_the_saliency_is_told(1);
}

#[test]
fn the_loss_of_the_saliency_is_told_with_another_seed() {
    the_loss_of_the_saliency_is_told(3);
}
