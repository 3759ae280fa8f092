use super::*;

/// Wrong lines, and the words that the answer has to contain: item, value, and the allowed or intended values.
const WRONG: [(&str, &[&str]); 67] = [
    ("stpo", &["stpo", "`stop`"]),
    ("torqe 1", &["torqe", "`torque`"]),
    ("quit", &["quit", "`help`"]),
    ("stop soon", &["soon"]),
    ("start backwards", &["mode", "backwards", "torque speed position vf learning"]),
    ("start speed 5", &["5"]),
    ("torque", &["current, A"]),
    ("torque one", &["current, A", "one"]),
    ("torque 1,5", &["1,5"]),
    ("torque 1A", &["1a"]),
    ("torque nan", &["nan"]),
    ("torque inf", &["inf"]),
    ("torque 1e99", &["1e99"]),
    ("torque 1", &["off"]),
    ("speed", &["speed, rpm"]),
    ("speed fast", &["speed, rpm", "fast"]),
    ("speed 1 2", &["2"]),
    ("position", &["position, turns"]),
    ("position home", &["position, turns", "home"]),
    ("angle", &["encoder or injection"]),
    ("angle guess", &["angle_source", "guess", "encoder injection"]),
    ("get wheel", &["wheel", "`get`"]),
    ("get motor.rs", &["motor.rs", "`motor.r_s`"]),
    ("get motor.r_s now", &["now"]),
    ("describe wheel", &["wheel"]),
    ("set", &["setting"]),
    ("set motor.r_s", &["value"]),
    ("set motor.r_x 1", &["motor.r_x", "`motor.r_s`"]),
    ("set motor.r_s x", &["motor.r_s", "x", "0.0001 to 1000 ohm"]),
    ("set motor.r_s 0", &["motor.r_s", "0", "0.0001 to 1000 ohm"]),
    ("set motor.r_s 1e9", &["motor.r_s", "1000000000", "0.0001 to 1000 ohm"]),
    ("set motor.r_s auto", &["motor.r_s", "auto", "0.0001 to 1000 ohm"]),
    ("set motor.pole_pairs 2.5", &["motor.pole_pairs", "2.5", "1 to 6"]),
    ("set motor.pole_pairs 0", &["motor.pole_pairs", "0", "1 to 6"]),
    ("set motor.pole_pairs -1", &["motor.pole_pairs", "-1", "1 to 6"]),
    ("set motor.pole_pairs 300", &["motor.pole_pairs", "300", "1 to 6"]),
    ("set inverter.top 5000", &["inverter.top", "board"]),
    ("set inverter.dead_time_s 1", &["inverter.dead_time_s", "1", "0.0000022 to 0.000006 s"]),
    ("set inverter.compensate maybe", &["inverter.compensate", "maybe", "no yes"]),
    (
        "set injection.demodulator best",
        &["injection.demodulator", "best", "literal", "synchronous"],
    ),
    ("set limits.trip_a 5", &["limits.trip_a", "5", "0.05 to 4.4727"]),
    ("set limits.current_a 4.4", &["limits.current_a", "4.4", "0.01 to 4.3"]),
    ("set limits.dc_under_v 500", &["limits.dc_under_v", "500", "5 to 256.9"]),
    ("set speed.limit_rpm 3000", &["speed.limit_rpm", "3000", "1 to 2000 rpm"]),
    ("set sequence.i_d 4", &["sequence.i_d", "4", "0.01 to 3.5 A"]),
    ("set command.timeout_s -1", &["command.timeout_s", "-1", "0 to 3600 s"]),
    ("set motor.r_s 5 motor.r_r", &["value"]),
    ("set motor.r_s 5 motor.r_r 0", &["motor.r_r", "0", "0.0001 to 1000 ohm"]),
    ("set wiring_checked 1", &["wiring_checked", "1", "no yes"]),
    ("learned 0 12", &["12", "eight hexadecimal digits"]),
    ("learned 99 00000000", &["index", "99", "0 to 60"]),
    ("learned check 00000000", &["word 0 is missing"]),
    ("faults 99", &["fault", "99", "1 to 58"]),
    ("faults 24", &["fault", "24", "`docs/faults.md` lists"]),
    ("trace 0", &["records", "0", "1 to 1024"]),
    ("trace 5 0", &["divider", "0", "1 to 1000"]),
    ("trace 5 i_x", &["i_x", "i_q_a"]),
    ("trace 5 on i_q_a near 1", &["near", "above below"]),
    ("log loud", &["level", "loud", "off error warn info debug"]),
    ("echo maybe", &["maybe", "on off"]),
    ("reboot later", &["later"]),
    ("update", &["`gates-off`", "switches a gate on", "is missing"]),
    ("update now", &["now", "gates-off"]),
    ("board mine", &["board", "mine", "reference nucleo-g474re-ihm08m1 nucleo-g474re-ihm023v3"]),
    ("confirm", &["what to confirm"]),
    ("confirm motor", &["motor", "board"]),
    ("set board.confirmed 1", &["board.confirmed", "belongs to the board"]),
];

#[test]
fn wrong_lines_name_thing_value_and_what_is_allowed_and_change_nothing() {
    let mut talk = Talk::new();
    let before = *talk.front.desk.settings().in_force();
    for (line, named) in WRONG {
        let answer = talk.ask(line);
        assert!(answer.starts_with("error: "), "{line}: {answer}");
        for part in named {
            assert!(answer.contains(part), "{line}: {part} is not in {answer}");
        }
        assert!(!talk.front.desk.settings().is_staged(), "{line}");
    }
    assert_eq!(*talk.front.desk.settings().in_force(), before);
    assert_eq!(talk.drive.drive.state(), State::Off);
    // The only valid command in the list, which a drive that is off refuses.
    assert_eq!(talk.drive.commands, [Command::Torque(1.0)]);
}
