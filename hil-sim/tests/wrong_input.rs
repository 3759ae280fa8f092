//! Wrong inputs of the command line, in `wrong_input.txt`: each message names the subject, the value and the allowed
//! values; nothing is written.

use crate::cli_common::{files, folder, hil_sim, text};

/// Splits a line into arguments; those in single quotes may have spaces.
fn arguments(line: &str) -> Vec<&str> {
    let mut all = Vec::new();
    for (n, part) in line.split('\'').enumerate() {
        if n % 2 == 1 { all.push(part) } else { all.extend(part.split_whitespace()) }
    }
    all
}

#[test]
fn each_message_names_the_thing_the_value_and_what_is_allowed() {
    let folder = folder("wrong-input");
    // A device file has no end.
    for name in ["zero.toml", "zero.json", "zero.jsonl"] {
        std::os::unix::fs::symlink("/dev/zero", folder.join(name)).unwrap();
    }
    let lines = include_str!("wrong_input.txt").lines();
    for case in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (line, parts) = case.split_once(" => ").expect("ARGUMENTS => PARTS");
        let (line, file) = line.split_once(" < ").unwrap_or((line, ""));
        if let Some((name, text)) = file.split_once(": ") {
            std::fs::write(folder.join(name), text.replace(';', "\n") + "\n").unwrap();
        }
        let written = files(&folder);
        let output = hil_sim(&folder, &arguments(line));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{case}: {message}");
        for part in parts.split(" | ") {
            assert!(message.contains(part), "{case}: `{part}` is not in: {message}");
        }
        assert!(output.stdout.is_empty(), "{case} prints a result");
        assert!(!message.contains("hil-sim "), "{case}: the user typed cargo sim: {message}");
        assert_eq!(files(&folder), written, "{case} leaves files");
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
