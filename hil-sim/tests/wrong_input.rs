//! Fifty wrong inputs of the command line: each message names the subject, the value and the allowed values; nothing is
//! written.

use crate::cli_common::{files, folder, hil_sim, text};

/// Files of the tests: name and text.
const FILES: [(&str, &str); 17] = [
    ("type.toml", "[motor]\nr_s = \"five\"\n"),
    ("range.toml", "[inverter]\n\ndc_link_v = 5000\n"),
    ("key.toml", "[motor]\nr_s = 5\nrs_ = 5\n"),
    ("word.toml", "[load]\nmode = \"free-wheeling\"\n"),
    ("broken.toml", "[motor\n"),
    ("twice.toml", "seconds = 1\nseconds = 2\n"),
    ("array.toml", "[motor]\nr_s = [1, 2]\n"),
    ("motor.toml", "title = \"x\"\n"),
    ("number.json", "7\n"),
    ("unit.csv", "time_s,torque\n0,1\n1,1\n"),
    ("both.csv", "time_s,torque_current_a,speed_rpm\n0,1,1\n1,1,1\n"),
    ("back.csv", "time_s,speed_rpm\n0,1\n2,1\n1,1\n"),
    ("text.csv", "time_s,speed_rpm\n0,1\n1,fast\n"),
    ("short.csv", "time_s,speed_rpm\n0,1\n1\n"),
    ("loads.csv", "time_s,speed_rpm,load_nm,load_rpm\n0,1,1,1\n1,1,1,1\n"),
    ("late.csv", "time_s,position_turns\n0.5,1\n1,1\n"),
    ("none.csv", "time_s,load_nm\n0,1\n1,1\n"),
];

/// Arguments, separated by spaces, and parts of the message.
#[rustfmt::skip] // a case a line
const CASES: [(&str, &[&str]); 58] = [
    // Commands and names.
    ("rum torque-steps", &["rum", "run"]),
    ("run", &["<NAME>", "cargo sim run"]),
    ("run torque-step", &["`torque-step`", "did you mean `torque-steps`?", "`list`"]),
    ("run xyzzy", &["`xyzzy`", "`list` and `list --lab` show all"]),
    ("run torque-steps extra", &["extra"]),
    ("run torque-steps --sed 1", &["--sed", "--seed"]),
    ("keys motr", &["`motr`", "did you mean `motor`?"]),
    ("keys motor --json", &["--json"]),
    ("motors motulator", &["`motulator`", "did you mean `motulator-2kw2`?", "`motors`"]),
    ("motors missing.toml", &["missing.toml", "No such file"]),
    ("completion cmd", &["cmd", "bash", "fish", "zsh"]),
    ("list torque", &["torque"]),
    // Seeds and times.
    ("run torque-steps --seed -1", &["-1", "--seed"]),
    ("run torque-steps --seed 1.5", &["1.5", "--seed"]),
    ("run torque-steps --seconds 0", &["seconds = 0", "0.001 to 3600 s"]),
    ("run torque-steps --seconds long", &["long", "--seconds"]),
    ("run torque-steps --seconds inf", &["seconds = inf", "not a finite number", "0.001 to 3600 s"]),
    ("run pi-design --seconds 2", &["pi-design does not use `seconds`", "it uses: motor.*"]),
    // Keys and values.
    ("run torque-steps --set motor.r_s", &["`motor.r_s`", "KEY=VALUE"]),
    ("run torque-steps --set", &["--set", "KEY=VALUE"]),
    ("run torque-steps --set =5", &["there is no key ``", "`keys` shows all"]),
    ("run torque-steps --set motor.r_x=5", &["`motor.r_x`", "did you mean `motor.r_r`?"]),
    ("run torque-steps --set motor.r_s=0", &["motor.r_s = 0", "0.0001 to 1000 ohm"]),
    ("run torque-steps --set motor.r_s=", &["motor.r_s = ", "not a number", "0.0001 to 1000 ohm"]),
    ("run torque-steps --set motor.r_s=5,4", &["motor.r_s = 5,4", "not a number"]),
    ("run torque-steps --set motor.r_s=nan", &["motor.r_s = NaN", "not a finite number"]),
    ("run torque-steps --set motor.pole_pairs=1.5", &["motor.pole_pairs = 1.5", "not a whole number", "1 to 6"]),
    ("run torque-steps --set load.mode=sideways", &["load.mode = sideways", "locked, free, speed"]),
    ("run torque-steps --set inverter.switched=maybe", &["inverter.switched = maybe", "yes, no"]),
    ("run torque-steps --set injection.demodulator=x", &["injection.demodulator = x", "synchronous"]),
    ("run torque-steps --set limits.trip_a=lots", &["limits.trip_a = lots", "number"]),
    ("run torque-steps --set measurement.lsb_a=2", &["measurement.lsb_a = 2", "0.0559089175 A"]),
    ("run monte-carlo --set runs=0", &["runs = 0", "1 to 1000000"]),
    ("run speed-profile --set runs=5", &["speed-profile does not use `runs`", "it uses: ", "load.torque_nm"]),
    ("run anti-windup --set motor.r_s=5", &["anti-windup does not use `motor.r_s`", "no key"]),
    ("run torque-steps --set spread.motor=0.1", &["torque-steps does not use `spread.motor`", "prepare.learn"]),
    ("run torque-steps --set speed.limit_rpm=9", &["`speed.limit_rpm`", "except speed.limit_rpm"]),
    ("report --set track_rotor=yes", &["report does not use `track_rotor`"]),
    // Files.
    ("run torque-steps --config missing.toml", &["missing.toml", "No such file"]),
    ("run torque-steps --config broken.toml", &["broken.toml", "line 1"]),
    ("run torque-steps --config twice.toml", &["twice.toml", "line 2", "duplicate"]),
    ("run torque-steps --config type.toml", &["type.toml, line 2: motor.r_s = five", "0.0001 to 1000 ohm"]),
    ("run torque-steps --config range.toml", &["range.toml, line 3: inverter.dc_link_v = 5000", "10 to 1000 V"]),
    ("run torque-steps --config key.toml", &["key.toml, line 3: there is no key `motor.rs_`"]),
    ("run torque-steps --config word.toml", &["word.toml, line 2: load.mode = free-wheeling", "locked, free, speed"]),
    ("run torque-steps --config array.toml", &["array.toml, line 2: motor.r_s = [1, 2]", "not a number"]),
    ("run torque-steps --motor motor.toml", &["motor.toml", "nameplate.power_w", "motor.l_m", "inverter.dc_link_v"]),
    ("run torque-steps --motor number.json", &["number.json: schema = null; allowed: 1"]),
    // Profiles and traces.
    ("run profile", &["profile needs --input FILE"]),
    ("run torque-steps --input unit.csv", &["--input unit.csv", "allowed with: profile"]),
    ("run profile --input unit.csv", &["unit.csv, line 1: unknown column `torque`", "allowed: time_s, torque_current_a"]),
    ("run profile --input back.csv", &["back.csv, line 4: time_s = 1 after 2"]),
    ("run profile --input text.csv", &["text.csv, line 3: speed_rpm = `fast`", "finite number"]),
    ("identify-trace --input text.csv --column n=x", &["--column n=x", "allowed: time_s, speed_rpm"]),
    ("identify-trace --input text.csv --delay 11", &["11", "--delay", "-1 to 10 rows"]),
    ("identify-trace --input text.csv --drop -2", &["-2", "--drop", "0 to 100 V"]),
    ("identify-trace --input text.csv --from soon", &["soon", "--from"]),
    ("identify-trace --input text.csv --voltages pwm", &["pwm", "--voltages", "commanded, sampled, mean"]),
];

/// Further profiles, each with its message.
const PROFILES: [(&str, &str); 5] = [
    (
        "both.csv",
        "both.csv: one of the columns torque_current_a, speed_rpm, position_turns must be there, and only one",
    ),
    (
        "none.csv",
        "none.csv: one of the columns torque_current_a, speed_rpm, position_turns must be there, and only one",
    ),
    ("short.csv", "short.csv, line 3: 1 cells; the header has 2"),
    ("loads.csv", "loads.csv: load_nm and load_rpm exclude each other"),
    ("late.csv", "late.csv, line 2: time_s = 0.5; the first row is at 0"),
];

#[test]
fn each_message_names_the_thing_the_value_and_what_is_allowed() {
    let folder = folder("wrong-input");
    for (name, contents) in FILES {
        std::fs::write(folder.join(name), contents).unwrap();
    }
    let profiles =
        PROFILES.map(|(file, message)| (format!("run profile --input {file}"), vec![message]));
    let cases = CASES.iter().map(|(line, parts)| ((*line).to_owned(), parts.to_vec()));
    for (line, parts) in cases.chain(profiles) {
        let arguments: Vec<&str> = line.split(' ').collect();
        let output = hil_sim(&folder, &arguments);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{line}: {message}");
        for part in parts {
            assert!(message.contains(part), "{line}: `{part}` is not in: {message}");
        }
        assert!(output.stdout.is_empty(), "{line} prints a result");
        assert!(!message.contains("hil-sim "), "{line}: the user typed cargo sim: {message}");
        assert_eq!(files(&folder).len(), FILES.len(), "{line} leaves files: {:?}", files(&folder));
    }
}

/// A file from another person can contain control characters, which a terminal would execute, and lines without end.
#[test]
fn quoted_input_is_escaped_and_cut() {
    let folder = folder("quoted-input");
    let long = "[31m ".repeat(40_000);
    let (raw, escaped) =
        (format!("\u{1b}]0;x\u{7}\u{9b}{long}"), format!("\\u001b]0;x\\u0007\\u009b{long}"));
    for (name, contents) in [
        ("syntax.toml", format!("{raw} = 1\n")),
        ("key.toml", format!("\"{escaped}\" = 1\n")),
        ("value.toml", format!("[motor]\nr_s = \"{escaped}\"\n")),
        ("motor.toml", format!("[[source]]\n\"{escaped}\" = 1\n")),
        ("part.toml", format!("[[part]]\nseconds = \"{escaped}\"\n")),
        ("column.toml", format!("[[part]]\n\"{escaped}\" = 1\n")),
        ("header.csv", format!("time_s,{raw}\n0,1\n")),
        ("cell.csv", format!("time_s,speed_rpm\n0,1\n1,{raw}\n")),
        ("schema.json", format!("{{\"schema\": \"{escaped}\"}}\n")),
        ("syntax.json", format!("{{\"schema\": 1, {raw}\n")),
    ] {
        std::fs::write(folder.join(name), contents).unwrap();
    }
    let argument: String = raw.chars().take(50_000).collect();
    let set = format!("motor.r_s={argument}");
    let cases: [&[&str]; 15] = [
        &["run", "torque-steps", "--config", "syntax.toml"],
        &["run", "torque-steps", "--config", "key.toml"],
        &["run", "torque-steps", "--config", "value.toml"],
        &["run", "torque-steps", "--motor", "syntax.toml"],
        &["run", "torque-steps", "--motor", "motor.toml"],
        &["run", "syntax.toml"],
        &["run", "part.toml"],
        &["run", "column.toml"],
        &["run", "profile", "--input", "header.csv"],
        &["run", "profile", "--input", "cell.csv"],
        &["run", "torque-steps", "--motor", "schema.json"],
        &["run", "torque-steps", "--motor", "syntax.json"],
        &["run", "torque-steps", "--set", &set],
        &["run", "torque-steps", "--seed", &argument],
        &["run", &argument],
    ];
    for arguments in cases {
        let (output, case) =
            (hil_sim(&folder, arguments), arguments[..arguments.len() - 1].join(" "));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{case}: {message}");
        assert!(!message.contains(|c: char| c.is_control() && c != '\n'), "{case}: {message:?}");
        let quoted = |line: &str| 5 * line.matches("[31m ").count();
        assert!(message.lines().all(|l| quoted(l) <= 120 && l.len() < 500), "{case}: {message}");
    }
}

/// A likely mistake is a table in milliseconds; a device file has no end.
#[test]
fn endless_times_and_files_are_refused_by_name() {
    let folder = folder("endless");
    for (name, last) in [("ms.csv", "10000"), ("huge.csv", "1e300")] {
        let rows = format!("time_s,speed_rpm\n0,1\n{last},1\n");
        std::fs::write(folder.join(name), rows).unwrap();
    }
    let part = "[[part]]\nseconds = 2000\nspeed_rpm = 1\n";
    std::fs::write(folder.join("long.toml"), part.repeat(2)).unwrap();
    std::fs::create_dir(folder.join("runs")).unwrap();
    for name in ["zero.toml", "zero.json", "runs/zero.jsonl"] {
        std::os::unix::fs::symlink("/dev/zero", folder.join(name)).unwrap();
    }
    for (line, parts) in [
        ("run profile --input ms.csv", ["ms.csv, line 3: ", "10000 s", "0.001 to 3600 s"]),
        ("run profile --input huge.csv", ["huge.csv, line 3: ", "milliseconds", "3600 s"]),
        ("run long.toml", ["long.toml: ", "4000 s", "0.001 to 3600 s"]),
        ("run profile --input /dev/zero", ["/dev/zero", "longer than 64 MiB", "right file"]),
        ("identify-trace --input /dev/zero", ["/dev/zero", "longer than 64 MiB", "right file"]),
        ("run torque-steps --config /dev/zero", ["/dev/zero", "longer than 16 MiB", "right file"]),
        ("run torque-steps --motor zero.toml", ["zero.toml", "longer than 16 MiB", "right file"]),
        ("run torque-steps --motor zero.json", ["zero.json", "longer than 16 MiB", "right file"]),
        ("run zero.toml", ["zero.toml", "longer than 16 MiB", "right file"]),
        ("passport --from /dev/zero", ["/dev/zero", "longer than 16 MiB", "right file"]),
        ("run battery --resume runs/", ["runs/zero.jsonl", "longer than 256 MiB", "right file"]),
    ] {
        let output = hil_sim(&folder, &line.split(' ').collect::<Vec<_>>());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{line}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{line}: {message}");
    }
}
