//! Requests by state and source: one table.

use drive_commission::Step;
use drive_core::homing::Plan;
use drive_core::{Drive, Fault, Hardware, Measured, Mode, Stop};
use drive_settings::value::Value;

use super::order::{Order, Refusal};
use super::*;
use crate::boards;
use crate::console::tests::FakeDrive;
use crate::link::Status;
use crate::settings::keys;

/// The situations of the columns below.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Situation {
    Off,
    Starting,
    Fault,
    NoControl,
    NotConfirmed,
    Staged,
}

const SITUATIONS: [Situation; 6] = [
    Situation::Off,
    Situation::Starting,
    Situation::Fault,
    Situation::NoControl,
    Situation::NotConfirmed,
    Situation::Staged,
];

/// A command arbiter and a drive in a situation; `commander` commands.
fn desk(situation: Situation, commander: Commander) -> (Desk, FakeDrive) {
    let mut settings = FirmwareSettings::of_the_board();
    settings.command.wiring_checked = true;
    settings.drive.angle_source = drive_core::AngleSource::Encoder;
    settings.command.commander = commander;
    if situation != Situation::NotConfirmed {
        settings.confirm_board();
    }
    let mut drive = FakeDrive::new(Drive::new(settings.build().unwrap()));
    let mut desk = Desk::new(settings);
    match situation {
        Situation::Off | Situation::NotConfirmed => {}
        Situation::Starting => drop(drive.command(Command::Start(Mode::Speed)).unwrap()),
        Situation::Fault => {
            drive.command(Command::Start(Mode::Speed)).unwrap();
            drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
        }
        Situation::NoControl => drive.running = false,
        Situation::Staged => {
            let values = [(keys::find("bus.address").unwrap(), Value::Whole(7))];
            desk.set(Commander::Console, &values.into_iter().collect(), &drive).unwrap();
        }
    }
    drive.commands.clear();
    (desk, drive)
}

/// Each request, with its result by situation (`Off`, `Starting`, `Fault`, `NoControl`, `NotConfirmed`, `Staged`): `+` accepted, `d`
/// refused by the drive, `o` must be off, `c` no control, `n` not confirmed, `s` values are staged, `-` nothing found or learned, `u`
/// unsaved.
fn orders() -> Vec<(Order, &'static str)> {
    let plan = Plan { rpm: 60.0, i_q: 0.5, turns: 2.0 };
    vec![
        (Order::Start(Mode::Torque), "+ddcn+"),
        (Order::Start(Mode::Speed), "+ddcn+"),
        (Order::Learn { again: false }, "dddcnd"),
        (Order::Learn { again: true }, "-d--n-"),
        (Order::Commission(Step::Nameplate, Step::LAST), "+odcn+"),
        (Order::Accept, "-o-c--"),
        (Order::Stop(Stop::Coast), "+++c++"),
        (Order::Stop(Stop::Ramp), "+++c++"),
        (Order::Relock, "dddcdd"),
        (Order::Torque(1.0), "dddcdd"),
        (Order::Speed(60.0), "d+dcdd"),
        (Order::Jog(60.0), "dddcdd"),
        (Order::Position(1.0), "dddcdd"),
        (Order::Home(plan), "dddcdd"),
        (Order::Clear, "+++c++"),
        (Order::Defaults, "+o+c++"),
        (Order::Apply, "++++++"),
        (Order::ApplyRest, "++++++"),
        (Order::Revert, "++++++"),
        (Order::Save, "+o++++"),
        (Order::Echo(true), "++++++"),
        (Order::Reboot(false), "+o+++u"),
        (Order::Reboot(true), "+o++++"),
        (Order::BoardIs(Some(boards::ALL[0])), "++++++"),
        (Order::Confirm, "+o+++s"),
    ]
}

fn letter(answer: &Answer) -> char {
    match answer {
        Ok(_) => '+',
        Err(Refusal::Command(CommandError::Refused(_))) => 'd',
        Err(Refusal::MustBeOff) => 'o',
        Err(Refusal::Command(_)) => 'c',
        Err(Refusal::NotConfirmed) => 'n',
        Err(Refusal::Staged) => 's',
        Err(Refusal::NothingFound | Refusal::NothingLearned) => '-',
        Err(Refusal::Unsaved) => 'u',
        Err(other) => panic!("{other:?}"),
    }
}

#[test]
fn each_order_in_each_situation() {
    let mut wrong = Vec::new();
    for (order, expected) in orders() {
        let found: String = SITUATIONS
            .iter()
            .map(|situation| {
                let (mut desk, mut drive) = desk(*situation, Commander::Console);
                let before = drive.commands.len();
                let answer = desk.order(Commander::Console, order.clone(), &mut drive);
                // A request that the arbiter itself refuses never reaches the drive.
                let refused = matches!(&answer, Err(why) if !matches!(why, Refusal::Command(_)));
                assert!(!refused || drive.commands.len() == before, "{order:?}, {situation:?}");
                letter(&answer)
            })
            .collect();
        if found != expected {
            wrong.push(format!("{order:?}: {found}, not {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A side that does not command is refused all requests of the commander, in each situation, and nothing happens.
#[test]
fn the_other_side_may_stop_and_nothing_else_that_moves() {
    for situation in SITUATIONS {
        for (order, _) in orders() {
            for (from, commander) in
                [(Commander::Bus, Commander::Console), (Commander::Console, Commander::Bus)]
            {
                let (mut desk, mut drive) = desk(situation, commander);
                let answer = desk.order(from, order.clone(), &mut drive);
                let authority = Err(Refusal::Authority(commander));
                assert_eq!(answer == authority, order.is_for_the_commander(from), "{order:?}");
                if answer == authority {
                    assert!(drive.commands.is_empty() && !desk.is_busy(), "{order:?}");
                    // The register holds the reason, and it is announced once.
                    if from == Commander::Bus {
                        assert_eq!(desk.refusal().map(Refusal::code), Some(1));
                        let told = |desk: &mut Desk, drive: &mut FakeDrive| {
                            (0..9)
                                .filter(|_| {
                                    desk.news(drive, 0) == Some(News::Refused(Commander::Bus))
                                })
                                .count()
                        };
                        let expected = usize::from(situation != Situation::NoControl);
                        assert_eq!(told(&mut desk, &mut drive), expected);
                        desk.order(from, order.clone(), &mut drive).unwrap_err();
                        assert_eq!(told(&mut desk, &mut drive), 0);
                    }
                }
            }
        }
    }
    assert!(!Order::Stop(Stop::Coast).is_for_the_commander(Commander::Bus));
}

/// The announcement of a drive that one report shows in a state and the next one off; one column for each source of the stop: none,
/// console, bus, strip.
#[test]
fn a_stop_between_two_reports_is_told_as_one() {
    let (start, learned, stop) = ("the start has ended", "the learning has ended", "stopped");
    let cases = [
        (State::Calibrating, [start, "", stop, stop]),
        (State::Magnetising, [start, "", stop, stop]),
        (State::Torque, [stop; 4]),
        (State::Speed, [stop; 4]),
        (State::Position, [stop; 4]),
        (State::VoltsPerHertz, [stop; 4]),
        (State::Braking, [stop; 4]),
        (State::Stopping, [stop; 4]),
        (State::Learning, [learned, stop, stop, stop]),
        (State::Exciting, [""; 4]),
        (State::Fault(Fault::Break), [""; 4]),
    ];
    let commanders = [Commander::Console, Commander::Bus, Commander::Terminals];
    let sources = [None].into_iter().chain(commanders.map(Some));
    for (state, expected) in cases {
        for (by, expected) in sources.clone().zip(expected) {
            let (mut desk, mut drive) = desk(Situation::Starting, Commander::Console);
            let settings = desk.settings.in_force().drive;
            let told = |desk: &mut Desk, state| {
                let status = Status { state, ..Status::default() };
                desk.announcer.next(&status, &settings, 0)
            };
            told(&mut desk, state);
            if let Some(from) = by {
                desk.order(from, Order::Stop(Stop::Coast), &mut drive).unwrap();
            }
            let news = told(&mut desk, State::Off);
            let text = (!expected.is_empty()).then_some(News::Off(expected));
            assert_eq!(news, text, "{state:?}, {by:?}");
            // A stop of a drive that is off is not taken for a stop of the next run.
            assert!(drive.is_off() || by.is_none());
            desk.order(Commander::Console, Order::Stop(Stop::Coast), &mut drive).unwrap();
            told(&mut desk, State::Magnetising);
            let next = told(&mut desk, State::Off);
            assert!(by.is_none() || next == Some(News::Off(start)), "{next:?}");
        }
    }
}
