use drive_core::{Mode, Stop, homing};
use proptest::prelude::*;

use super::*;
use crate::desk::order::Order;
use crate::log::Level;
use crate::recording::trace::Plan;
use crate::recording::trace::{self, SignalChoice, Trigger};

#[test]
fn every_command_has_help_but_two_short_ones() {
    let told = |word: &&&str| HELP.iter().any(|(usage, _)| usage.split(' ').next() == Some(word));
    let untold: std::vec::Vec<_> = COMMANDS.iter().filter(|word| !told(word)).collect();
    assert_eq!(untold, [&"h", &"?"]);
}

fn assigned(values: &[(&str, Value)]) -> Request {
    Request::Set(values.iter().map(|(name, value)| (keys::find(name).unwrap(), *value)).collect())
}

fn traced(records: u16, divider: u16, names: &[&str], trigger: Trigger) -> Request {
    let mut choice = SignalChoice::none();
    assert!(names.iter().all(|name| choice.add(trace::find(name).unwrap())));
    let choice = if names.is_empty() { SignalChoice::usual() } else { choice };
    Request::Trace(Plan { records, divider, choice, trigger })
}

#[test]
fn commands_are_understood() {
    let speed = trace::find("speed_rpm").unwrap();
    let two = ["i_q_a", "turns"];
    let now = Trigger::Now;
    let table = [
        ("help", Request::List(ListKind::Help)),
        ("?", Request::List(ListKind::Help)),
        ("  status\t", Request::Status),
        ("start", Request::Order(Order::Start(Mode::Torque))),
        ("start position", Request::Order(Order::Start(Mode::Position))),
        ("start vf", Request::Order(Order::Start(Mode::VoltsPerHertz))),
        ("start learning", Request::Order(Order::Learn { again: false })),
        ("learn", Request::Order(Order::Learn { again: false })),
        ("learn again", Request::Order(Order::Learn { again: true })),
        ("stop", Request::Order(Order::Stop(Stop::Coast))),
        ("stop ramp", Request::Order(Order::Stop(Stop::Ramp))),
        ("stop quick", Request::Order(Order::Stop(Stop::Quick))),
        ("relock", Request::Order(Order::Relock)),
        ("torque -1.5", Request::Order(Order::Torque(-1.5))),
        ("start speed", Request::Order(Order::Start(Mode::Speed))),
        ("speed -150", Request::Order(Order::Speed(-150.0))),
        ("jog -60", Request::Order(Order::Jog(-60.0))),
        ("position 5e1", Request::Order(Order::Position(50.0))),
        (
            "home -30 0.5 4",
            Request::Order(Order::Home(homing::Plan { rpm: -30.0, i_q: 0.5, turns: 4.0 })),
        ),
        ("angle encoder", assigned(&[("angle_source", Value::Word("encoder"))])),
        ("set angle_source encoder", assigned(&[("angle_source", Value::Word("encoder"))])),
        ("get", Request::List(ListKind::Settings(""))),
        ("get motor", Request::List(ListKind::Settings("motor"))),
        ("get motor.r_s", Request::Get(keys::find("motor.r_s").unwrap())),
        ("describe limits.", Request::List(ListKind::Describe("limits."))),
        ("set motor.r_s 5.5", assigned(&[("motor.r_s", Value::Number(5.5))])),
        (
            "set limits.trip_a auto motor.pole_pairs 3",
            assigned(&[("limits.trip_a", Value::Auto), ("motor.pole_pairs", Value::Whole(3))]),
        ),
        ("trace 100", traced(100, 1, &[], now)),
        ("trace 1024 10", traced(1024, 10, &[], now)),
        ("trace 5 i_q_a turns", traced(5, 1, &two, now)),
        ("trace 5 2 i_q_a turns", traced(5, 2, &two, now)),
        ("trace 5 2 i_q_a turns on fault", traced(5, 2, &two, Trigger::Fault)),
        (
            "trace 5 on speed_rpm below -20",
            traced(5, 1, &[], Trigger::Level { signal: speed, level: -20.0, above: false }),
        ),
        ("trace", Request::ShowTrace),
        ("trace off", Request::EndTrace),
        ("learned", Request::Learned),
        ("learned 8 0000000a ffffffff", Request::Restore(8, [10, u32::MAX].into_iter().collect())),
        ("learned check 12345678", Request::Restored(0x1234_5678)),
        ("faults", Request::Faults(None)),
        ("faults 4", Request::Faults(Some(Fault::DcLinkOverVoltage))),
        ("log warn", Request::Log(Level::Warn)),
        ("log debug", Request::Log(Level::Debug)),
        ("echo on", Request::Order(Order::Echo(true))),
        ("reboot", Request::Order(Order::Reboot(false))),
        ("reboot now", Request::Order(Order::Reboot(true))),
        ("version", Request::Version),
    ];
    for (line, request) in table {
        assert_eq!(parse(line), Ok(request), "{line}");
    }
}

proptest! {
    #[test]
    fn any_text_is_understood_or_refused(line in ".*") {
        let _ = parse(&line);
    }

    #[test]
    fn words_that_look_like_commands_are_understood_or_refused(
        line in "(start|torque|speed|position|angle|get|set|trace|log|stop|learned|faults) ?[-+.0-9a-z_ ]{0,30}",
    ) {
        if let Ok(Request::Order(Order::Torque(x)) | Request::Order(Order::Speed(x)) | Request::Order(Order::Position(x))) = parse(&line) {
            prop_assert!(x.is_finite());
        }
    }

    #[test]
    fn numbers_survive_the_way_through_text(
        digits in -9_999_999..=9_999_999, power in -9_i32..=9,
    ) {
        let value = digits as f32 * 10_f32.powi(power);
        prop_assert_eq!(parse(&format!("torque {value}")).ok(), Some(Request::Order(Order::Torque(value))));
        prop_assert_eq!(parse(&format!("torque {value:e}")).ok(), Some(Request::Order(Order::Torque(value))));
    }
}
