//! Procedure: a command has the same effect after each of the ten samples of the injection period. Each sample has its own task
//! (`drive-core/src/drive/in_turn.rs`), and a command may come between any two.

use crate::common::config;
use drive_core::AngleSource;
use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Accepted, Command, Dq, Mode, Refused, State, Stop, TestSignal};
use hil_sim::rig::Rig;

/// Time after a command, s: a stop by ramp has ended.
const BEHIND_S: f64 = 0.7;
/// Share of a sample in the means of reference and current: 10 ms.
const SHARE_IN_MEAN: f64 = 1.0 / 60.0;
/// Largest error of the angle while the drive tracks the flux, electrical degrees.
const TRACKED_DEG: f64 = 25.0;

/// A drive that runs, its trip, A, and commands for it.
struct Bench {
    name: String,
    rig: Rig,
    trip_a: f64,
    commands: Vec<Command>,
}

/// Result of a command: the answer, the state after it, and the means of the last reference and current, A.
#[derive(Debug)]
struct Outcome {
    answer: Result<Accepted, Refused>,
    state: State,
    reference: f64,
    current: f64,
}

impl Bench {
    fn new(changes: &[&str], mode: Mode) -> Self {
        let mut config = config(changes);
        config.drive.track_rotor = config.drive.angle_source == AngleSource::Encoder;
        let mut rig = Rig::from_config(&config, 1).unwrap();
        if mode == Mode::Commissioning {
            rig.command(&Command::Test(TestSignal::Rest)).unwrap();
            (0..6000).for_each(|_| rig.step());
            assert_eq!(rig.drive.state(), State::Exciting);
        } else {
            rig.start(mode).unwrap();
        }
        match mode {
            Mode::Torque => drop(rig.command(&Command::Torque(0.2)).unwrap()),
            Mode::Speed | Mode::VoltsPerHertz => drop(rig.command(&Command::Speed(30.0)).unwrap()),
            Mode::Position | Mode::Learning | Mode::Commissioning => {}
        }
        rig.wait(0.5);
        let settings = &config.drive;
        let commands = vec![
            Command::Start(mode),
            Command::Relock,
            Command::CheckWiring,
            Command::Test(TestSignal::Rest),
            Command::Stop(Stop::Coast),
            Command::Stop(Stop::Ramp),
            Command::Stop(Stop::Quick),
            Command::Clear,
            Command::Torque(0.8),
            Command::Speed(45.0),
            Command::Jog(45.0),
            Command::Position(0.1),
            Command::Press(30.0, 0.8),
            Command::Home(0.0),
            Command::Magnetising(settings.i_d()),
            Command::TurnInjection(2.0),
            Command::TestVoltage(Dq::new(1.0, 1.0)),
            Command::RotorTimeConstant(settings.motor.tau_r()),
            Command::Configure(settings.build().unwrap()),
        ];
        Self {
            name: format!("{mode:?} {changes:?}"),
            rig,
            trip_a: settings.trip_a().into(),
            commands,
        }
    }

    /// Gives the command after `turn` samples, and observes the drive.
    fn outcome(&self, command: &Command, turn: usize) -> Outcome {
        let name = format!("{}: {command:.20?} at {turn}", self.name);
        let mut rig = self.rig.clone();
        (0..turn).for_each(|_| rig.step());
        let mut undisturbed = rig.clone();
        let before = rig.drive.state();
        let answer = rig.drive.command(command);
        if answer.is_err() {
            assert_eq!(rig.drive.state(), before, "{name}");
        }
        let (mut reference, mut current) = (0.0, 0.0);
        let (trip_a, regulates) = (self.trip_a, before.regulates());
        rig.run(BEHIND_S, |point| {
            assert!(point.current < trip_a, "{name}: {} A", point.current);
            if regulates {
                reference += SHARE_IN_MEAN * (point.iq_ref - reference);
                current += SHARE_IN_MEAN * (point.iq - current);
            }
        });
        let state = rig.drive.state();
        assert_eq!(state.fault(), None, "{name}");
        if answer.is_err() || *command == Command::Clear {
            // A refused command has changed nothing, to the last bit.
            undisturbed.wait(BEHIND_S);
            assert_eq!(rig.drive.telemetry(), undisturbed.drive.telemetry(), "{name}");
        }
        if state.regulates() {
            rig.run(0.01, |point| {
                assert!(point.angle_error_deg.abs() < TRACKED_DEG, "{name}: {point:?}")
            });
        }
        Outcome { answer, state, reference, current }
    }

    /// Gives every command after each sample of the injection period; returns how many of them are accepted.
    fn try_all(&self) -> usize {
        let mut taken = 0;
        for command in &self.commands {
            let first = self.outcome(command, 0);
            taken += usize::from(first.answer.is_ok());
            for turn in 1..CARRIER_SAMPLES {
                let other = self.outcome(command, turn);
                let name = format!("{}: {command:.20?} at {turn}: {first:?} {other:?}", self.name);
                assert_eq!((other.answer, other.state), (first.answer, first.state), "{name}");
                // About a third of an ampere of noise and ripple, and a ramp that began up to nine periods later.
                assert!((other.reference - first.reference).abs() < 0.35, "{name}");
                assert!((other.current - first.current).abs() < 0.35, "{name}");
            }
        }
        taken
    }
}

const FREE: &str = "load.mode=free";

#[test]
fn sensorless() {
    for mode in [Mode::Torque, Mode::Speed, Mode::Position] {
        let bench = Bench::new(&[FREE, "angle_source=injection"], mode);
        assert!(bench.try_all() >= 6);
    }
}

#[test]
fn with_the_encoder_and_the_rotor_tracked() {
    for mode in [Mode::Torque, Mode::Speed, Mode::Position] {
        let bench = Bench::new(&[FREE, "angle_source=encoder"], mode);
        assert!(bench.try_all() >= 8);
    }
}

#[test]
fn by_voltage_and_frequency_learning_and_commissioning() {
    assert_eq!(Bench::new(&[FREE], Mode::VoltsPerHertz).try_all(), 5);
    assert_eq!(Bench::new(&["load.mode=locked"], Mode::Learning).try_all(), 4);
    assert_eq!(Bench::new(&[FREE], Mode::Commissioning).try_all(), 5);
}

/// Settings are accepted only while the outputs are off, and as a whole: between two steps of the drive.
#[test]
fn settings_are_taken_while_off() {
    let config = config(&[FREE, "angle_source=encoder"]);
    for turn in 0..CARRIER_SAMPLES {
        let mut rig = Rig::from_config(&config, 1).unwrap();
        rig.wait(1.0);
        (0..turn).for_each(|_| rig.step());
        let settings = config.drive.build().unwrap();
        assert_eq!(rig.drive.command(&Command::Configure(settings)), Ok(Accepted::AsGiven));
        rig.start(Mode::Torque).unwrap();
    }
}
