//! Tests of every command in every state, and of the commands that once did harm in a wrong state.

use core::mem::discriminant;
use std::collections::{BTreeMap, HashSet};

use super::*;
use crate::drive::test_signal::{Regulator, TestSignal};
use crate::protect::wiring_check::WiringSettings;

/// States of a start.
const STARTING: [State; 6] = [
    State::Calibrating,
    State::Precharge,
    State::CheckingWiring,
    State::FlyingStart,
    State::Magnetising,
    State::Verifying,
];

/// Columns of the table.
fn columns() -> Vec<(&'static str, Vec<Command>)> {
    use Command::*;
    let regulator = Regulator { k_c: 25.0, z_c: 0.97, direct: 0.0, filtered: false };
    let (amperes, carrier) = (0.5, AlphaBeta::ZERO);
    let current = TestSignal::Current { amperes, regulator, carrier, binary: false };
    let settings = motor_settings(AngleSource::Injection).build().unwrap();
    vec![
        ("start", [Mode::Torque, Mode::Speed, Mode::Position].map(Start).into()),
        ("start vf", vec![Start(Mode::VoltsPerHertz)]),
        ("learn", [Mode::Learning, Mode::Commissioning].map(Start).into()),
        ("check of the wiring, brake", vec![CheckWiring, Brake(0.2)]),
        ("commission", vec![Test(current), Test(pulses())]),
        (
            "stop",
            [super::Stop::Coast, super::Stop::Ramp, super::Stop::Quick, super::Stop::Now]
                .map(Stop)
                .into(),
        ),
        ("clear", vec![Clear]),
        ("settings", vec![Configure(settings)]),
        ("relock", vec![Relock]),
        ("torque", vec![Torque(0.2)]),
        ("speed", vec![Speed(30.0)]),
        ("jog", vec![Jog(30.0)]),
        ("position", vec![Position(0.02)]),
        ("home", vec![Press(30.0, 0.3), Home(0.0)]),
        (
            "flux, test voltage",
            vec![
                Magnetising(0.7),
                TurnInjection(1.0),
                TestVoltage(Dq::new(1.0, 1.0)),
                RotorTimeConstant(0.2),
            ],
        ),
    ]
}

fn pulses() -> TestSignal {
    TestSignal::Pulses(WiringSettings {
        sigma_ls: 0.0515,
        expected_a: 0.2,
        noise_a: 0.05,
        highest_v: 60.0,
    })
}

/// Returns a drive in this state that was started in this mode; none if no start of the mode passes through the state.
fn bench(state: State, mode: Mode) -> Option<Bench> {
    bench_of(&motor_settings(AngleSource::Injection), state, mode)
}

/// Returns a drive in this state with these settings.
fn bench_of(settings: &Settings, state: State, mode: Mode) -> Option<Bench> {
    let mut bench = Bench::new(settings);
    if mode == Mode::Learning {
        bench.motor.load = None;
    }
    if state == State::CheckingWiring {
        bench.drive.command(&Command::CheckWiring).unwrap();
    }
    let start = match (mode, state) {
        (Mode::Commissioning, State::CheckingWiring) => Command::Test(pulses()),
        (Mode::Commissioning, _) => Command::Test(TestSignal::Rest),
        _ => Command::Start(mode),
    };
    bench.drive.command(&start).unwrap();
    for _ in 0..36_000 {
        let now = bench.drive.state();
        if now == state {
            return Some(bench);
        }
        // The run has begun without passing through the state.
        if now == State::of_mode(mode) {
            return None;
        }
        bench.step();
    }
    panic!("{mode:?}: {}", bench.drive.state())
}

fn running(mode: Mode) -> Bench {
    bench(State::of_mode(mode), mode).unwrap()
}

/// Returns a drive that runs at 300 rpm.
fn turning(mode: Mode) -> Bench {
    let mut bench = running(mode);
    // The boost of V/f control takes a second.
    bench.run(1.5);
    bench.drive.command(&Command::Speed(300.0)).unwrap();
    bench.run(1.8);
    assert!((bench.motor.rpm() - 300.0).abs() < 30.0, "{}", bench.motor.rpm());
    bench
}

/// Returns the rows of the table, and the drives that must all agree with them.
fn rows() -> Vec<(&'static str, Vec<Bench>)> {
    let starting =
        |mode| -> Vec<Bench> { STARTING.iter().filter_map(|state| bench(*state, mode)).collect() };
    let then = |mut bench: Bench, stop: Stop| {
        bench.drive.command(&Command::Stop(stop)).unwrap();
        bench.step();
        bench
    };
    let mut fault = running(Mode::Torque);
    fault.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    let mut torque = running(Mode::Torque);
    torque.drive.command(&Command::Torque(1.0)).unwrap();
    torque.run(0.1);
    vec![
        ("off", vec![Bench::new(&motor_settings(AngleSource::Injection))]),
        ("in fault", vec![fault]),
        ("starting, for torque", starting(Mode::Torque)),
        ("starting, for speed", starting(Mode::Speed)),
        ("starting, for position", starting(Mode::Position)),
        ("starting, for vf", starting(Mode::VoltsPerHertz)),
        ("starting, to learn", starting(Mode::Learning)),
        ("starting, to commission; pulses", starting(Mode::Commissioning)),
        ("regulating torque", vec![running(Mode::Torque)]),
        ("regulating speed", vec![running(Mode::Speed)]),
        ("regulating position", vec![running(Mode::Position)]),
        ("turning by V/f control", vec![turning(Mode::VoltsPerHertz)]),
        ("learning", vec![running(Mode::Learning)]),
        ("exciting the motor at rest", vec![running(Mode::Commissioning)]),
        (
            "braking to rest, stopping",
            vec![then(turning(Mode::Speed), Stop::Ramp), then(torque, Stop::Coast)],
        ),
        ("braking to rest by frequency", vec![then(turning(Mode::VoltsPerHertz), Stop::Ramp)]),
    ]
}

/// Checks the table of docs/control-law.md, cell by cell. A refused command changes nothing, and is refused because of the
/// state or the fault. An accepted command leads to no fault.
#[test]
fn every_command_is_taken_or_refused_in_every_state() {
    let columns = columns();
    let heads: Vec<_> = columns.iter().map(|(name, _)| *name).collect();
    let mut table = format!("| state | {} |\n", heads.join(" | "));
    table += &format!("|---|{}\n", "---|".repeat(heads.len()));
    let mut seen = HashSet::new();
    for (name, benches) in rows() {
        table += &format!("| {name} |");
        for (column, commands) in &columns {
            let mut cell = None;
            for (bench, command) in benches
                .iter()
                .flat_map(|bench| commands.iter().map(move |command| (bench, command)))
            {
                let (state, mode) = (bench.drive.state(), bench.drive.mode());
                seen.insert((discriminant(&state), discriminant(&mode)));
                let mut after = bench.clone();
                let answer = after.drive.command(command);
                let refused = match answer {
                    Err(Refused::State(by)) => {
                        assert!(by == state || by == State::of_mode(mode), "{by}");
                        true
                    }
                    Err(Refused::Fault(by)) => {
                        assert_eq!(state, State::Fault(by));
                        true
                    }
                    _ => false,
                };
                if answer.is_err() {
                    let [before, after] = [bench, &after].map(|b| format!("{:?}", b.drive));
                    assert_eq!(before, after, "{command:?} while {state}");
                } else if !matches!(state, State::Fault(_)) {
                    after.run(0.2);
                    let now = after.drive.state();
                    assert!(!matches!(now, State::Fault(_)), "{command:?} while {state}: {now}");
                }
                let agreed = *cell.get_or_insert(refused);
                assert_eq!(refused, agreed, "{column} while {state}, {mode:?}: {answer:?}");
            }
            table += if cell == Some(true) { " - |" } else { " yes |" };
        }
        table.push('\n');
    }
    // Each of the 17 states and each of the 6 modes was tested.
    let states: HashSet<_> = seen.iter().map(|(state, _)| state).collect();
    let modes: HashSet<_> = seen.iter().map(|(_, mode)| mode).collect();
    assert_eq!((states.len(), modes.len()), (17, MODES.len()));
    crate::generated::check("control-law.md", "commands", &table);
}

/// Checks the other table: the state after a stop, a clear, a start and a relock, and after a fault.
#[test]
fn every_event_leads_to_the_state_of_the_table() {
    use super::Stop::{Coast, Now, Quick, Ramp};
    let events = [Coast, Ramp, Quick, Now].map(Command::Stop).into_iter();
    let events: Vec<_> = events.chain([Command::Clear, Command::Relock]).collect();
    let mut table = BTreeMap::new();
    for bench in rows().into_iter().flat_map(|(_, benches)| benches) {
        let state = bench.drive.state();
        let name = match state {
            State::Fault(_) => "in fault".into(),
            State::Braking => "braking to rest".into(),
            State::BrakingByFrequency => "braking to rest by frequency".into(),
            state => state.to_string(),
        };
        let mut cells: Vec<_> = events
            .iter()
            .map(|event| {
                let mut after = bench.clone();
                let _ = after.drive.command(event);
                let now = after.drive.state();
                if now == state { "stays".into() } else { now.to_string() }
            })
            .collect();
        // The hardware reports a fault.
        let mut after = bench.clone();
        let broken = Measured { hardware: Hardware::BREAK, ..Measured::default() };
        let output = after.drive.step(&broken);
        let now = after.drive.state();
        assert!(now == state || output.duties.is_none(), "{name}: {now}");
        cells.push(if now == state { "stays" } else { "in fault" }.into());
        assert_eq!(now == state, state.is_off(), "{name}: {now}");
        let row = cells.join(" | ");
        assert_eq!(*table.entry(name.clone()).or_insert_with(|| row.clone()), row, "{name}");
    }
    assert_eq!(table.len(), 17, "each state");
    let head =
        "| state | `stop` | `stop ramp` | `stop quick` | `stop now` | `clear` | `relock` | fault |";
    let rows = table.iter().map(|(name, row)| format!("| {name} | {row} |\n")).collect::<String>();
    crate::generated::check(
        "control-law.md",
        "events",
        &format!("{head}\n|---|---|---|---|---|---|---|---|\n{rows}"),
    );
}

/// The table says in which state a command is accepted, independent of its value. The commands of the last column need the encoder,
/// a tracked rotor time constant, or a flux without tables. With these, each command is accepted and executed in each state for
/// which the table says yes.
#[test]
fn commands_that_need_the_encoder_are_taken_where_the_table_says() {
    let mut settings = motor_settings(AngleSource::Encoder);
    settings.track_rotor = true;
    let (name, commands) = columns().pop().unwrap();
    assert_eq!((name, commands.len()), ("flux, test voltage", 4));
    for mode in [Mode::Torque, Mode::Speed, Mode::Position] {
        let states = STARTING.into_iter().chain([State::of_mode(mode)]);
        let benches: Vec<_> = states.filter_map(|state| bench_of(&settings, state, mode)).collect();
        // With the encoder no start includes a flying start or the verification of a lock.
        assert_eq!(benches.len(), 5, "{mode:?}");
        for (bench, command) in
            benches.iter().flat_map(|bench| commands.iter().map(move |command| (bench, command)))
        {
            let (mut after, state) = (bench.clone(), bench.drive.state());
            let answer = after.drive.command(command);
            assert!(answer.is_ok(), "{command:?} while {state}, {mode:?}: {answer:?}");
            after.run(0.2);
            let now = after.drive.state();
            assert!(!matches!(now, State::Fault(_)), "{command:?} while {state}, {mode:?}: {now}");
        }
    }
}

/// A fixed frame on a rotating shaft is a fault, and so are the pulses of the wiring check.
#[test]
fn a_relock_is_refused_while_the_shaft_turns_and_the_drive_runs_on() {
    for (mode, refused) in [
        (Mode::Speed, Refused::Turning),
        (Mode::VoltsPerHertz, Refused::State(State::VoltsPerHertz)),
    ] {
        let mut bench = turning(mode);
        assert_eq!(bench.drive.command(&Command::Relock), Err(refused));
        bench.run(1.5);
        assert_eq!(bench.drive.state(), State::of_mode(mode));
        assert!((bench.motor.rpm() - 300.0).abs() < 30.0, "{}", bench.motor.rpm());
    }
    // At rest the run continues: a second later the drive holds the shaft.
    let mut bench = running(Mode::Speed);
    assert_eq!(bench.drive.command(&Command::Relock), Ok(Accepted::AsGiven));
    assert!(bench.run_to(State::Speed), "{}", bench.drive.state());
    bench.run(1.0);
    assert!(bench.motor.rpm().abs() < 6.0, "{}", bench.motor.rpm());
    let mut learning = running(Mode::Learning);
    learning.run(1.0);
    let refused = Err(Refused::State(State::Learning));
    assert_eq!(learning.drive.command(&Command::Relock), refused);
}

/// In V/f control a quick stop is quicker than a stop by the ramp, also when it begins during such a stop, and the shaft is at
/// rest except for the slip when the outputs are switched off. No observer runs that would track a resistance.
#[test]
fn a_quick_stop_by_voltage_and_frequency_brakes_to_rest() {
    let from_300 = turning(Mode::VoltsPerHertz);
    let seconds = |stops: &[(f64, Stop)]| {
        let mut bench = from_300.clone();
        let mut periods = 0;
        for (until, stop) in stops {
            bench.drive.command(&Command::Stop(*stop)).unwrap();
            while bench.drive.state() != State::Off && f64::from(periods) < until * 6000.0 {
                bench.step();
                periods += 1;
                assert_eq!(bench.drive.stator_resistance(), None);
            }
        }
        assert_eq!(bench.drive.state(), State::Off);
        (f64::from(periods) / 6000.0, bench.motor.rpm())
    };
    let ramp = seconds(&[(9.0, Stop::Ramp)]);
    let quick = seconds(&[(9.0, Stop::Quick)]);
    let harder = seconds(&[(0.2, Stop::Ramp), (9.0, Stop::Quick)]);
    let no_softer = seconds(&[(0.1, Stop::Quick), (9.0, Stop::Ramp)]);
    // The ramp is 300 rpm/s; the quick stop from the rated speed in 2 s is 750 rpm/s.
    assert!((0.9..1.1).contains(&ramp.0), "{ramp:?}");
    assert!((0.3..0.55).contains(&quick.0), "{quick:?}");
    assert!((quick.0 + 0.05..ramp.0 - 0.3).contains(&harder.0), "{harder:?}");
    assert!((no_softer.0 - quick.0).abs() < 0.02, "{no_softer:?}");
    for (_, rpm) in [ramp, quick, harder, no_softer] {
        assert!(rpm.abs() < 40.0, "{rpm}");
    }
    let coast = seconds(&[(0.1, Stop::Coast)]);
    assert!(coast.0 == 0.0 && coast.1 > 270.0, "{coast:?}");
}

/// 300 rpm with two pole pairs are 10 Hz.
#[test]
fn a_frequency_above_the_limit_of_the_speed_trips_by_voltage_and_frequency() {
    for (hertz, state) in [(9.0, State::Fault(Fault::OverSpeed)), (11.0, State::VoltsPerHertz)] {
        let mut bench = turning(Mode::VoltsPerHertz);
        bench.drive.c.protection.rotor_freq = hertz / 6000.0;
        (0..20).for_each(|_| bench.step());
        assert_eq!(bench.drive.state(), state, "{hertz} Hz");
    }
}
