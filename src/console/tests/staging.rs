use super::*;
use crate::settings::staging::UNCONFIRMED;

/// The value of a setting in force and the staged one, by its name.
fn shown(talk: &Talk, name: &str) -> (String, String) {
    let (key, settings) = (keys::find(name).unwrap(), talk.front.desk.settings());
    (key.get(settings.in_force()).to_string(), key.get(settings.latest()).to_string())
}

#[test]
fn settings_out_of_range_are_refused_with_the_range() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 0"), "error: motor.r_s = 0: allowed is 0.0001 to 1000 ohm");
    assert_eq!(talk.ask("get motor.r_s"), in_force("motor.r_s = 5.4 ohm (0.0001 to 1000)"));
    assert!(talk.drive.commands.is_empty() && !talk.front.desk.settings().is_staged());
}

#[test]
fn a_value_that_is_none_is_refused_with_what_is_allowed() {
    let mut talk = Talk::new();
    for (line, answer) in [
        ("set motor.r_s 5ohm", "motor.r_s = 5ohm: not a number; allowed is 0.0001 to 1000 ohm"),
        (
            "set motor.pole_pairs 2.5",
            "motor.pole_pairs = 2.5: not a whole number from 0 to 6; allowed is 1 to 6",
        ),
        ("set angle_source guess", "angle_source = guess: not one of: encoder injection"),
        (
            "set inverter.top 5000",
            "inverter.top belongs to the board and is no setting of the console",
        ),
    ] {
        assert_eq!(talk.ask(line), format!("error: {answer}"));
    }
    assert!(talk.drive.commands.is_empty() && !talk.front.desk.settings().is_staged());
}

#[test]
fn staged_values_are_marked_and_designed_for_once() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("apply"), "ok: nothing staged");
    assert_eq!(talk.ask("set motor.r_s 5.5 motor.r_r 1.2"), "ok: staged");
    assert_eq!(talk.ask("set motor.inertia 0.02"), "ok: staged");
    assert!(talk.drive.commands.is_empty(), "nothing is given to the drive");
    let get = "motor.r_s = 5.5 ohm (0.0001 to 1000); staged, in force: 5.4";
    assert_eq!(talk.ask("get motor.r_s"), in_force(get));
    assert_eq!(talk.say("get motor.r_s\n").len(), 1);
    assert!(talk.ask("status").ends_with("; 3 staged"));
    assert_eq!(talk.say("apply\n"), ["* designing...", "ok"]);
    assert!(matches!(talk.drive.commands[..], [Command::Configure(_)]));
    assert_eq!(shown(&talk, "motor.r_r"), ("1.2".into(), "1.2".into()));
    // Back to the value in force: nothing is staged any more.
    assert_eq!(talk.ask("set motor.r_s 5.6"), "ok: staged");
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: as in force");
    assert_eq!(talk.ask("apply"), "ok: nothing staged");
    // Settings of the firmware itself need no design.
    assert_eq!(talk.ask("set command.timeout_s 3"), "ok: staged");
    assert_eq!(talk.say("apply\n"), ["ok"]);
}

#[test]
fn a_line_is_staged_whole_or_not_at_all() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    let refused = talk.ask("set motor.r_s 6 motor.r_r 1.3 motor.r_s 7 limits.trip_a 9");
    assert!(refused.starts_with("error: limits.trip_a = 9: allowed is 0.05 to 4.47"), "{refused}");
    assert_eq!(shown(&talk, "motor.r_s"), ("5.4".into(), "5.5".into()));
    assert_eq!(shown(&talk, "motor.r_r").1, "1.1");
    assert_eq!(talk.ask("revert"), "ok: 1 staged values dropped");
    assert_eq!(shown(&talk, "motor.r_s").1, "5.4");
    assert_eq!(talk.ask("revert"), "ok: 0 staged values dropped");
}

/// A range that depends on another setting follows the staged values.
#[test]
fn ranges_are_those_beside_the_staged_values() {
    let mut talk = Talk::new();
    assert!(talk.ask("set limits.trip_a 20").starts_with("error: limits.trip_a = 20: allowed is"));
    let scales = "set scales.current_a.gain 0.05 scales.current_a.offset -100";
    // A setting of the hardware.
    assert_eq!(talk.ask(scales), format!("ok: staged; {UNCONFIRMED}"));
    assert_eq!(talk.ask(&scales.replace("_a.", "_b.")), "ok: staged");
    assert_eq!(talk.ask("set limits.trip_a 20 limits.current_a 15"), "ok: staged");
    // If a later value makes a staged one wrong, this is found when all values are put in force; the drive stays as it is.
    assert_eq!(talk.ask("set limits.trip_a 10"), "ok: staged");
    let refused =
        "error: limits.current_a = 15: allowed is 0.01 to 10 A; not in force, still staged";
    for line in ["apply", "save"] {
        assert_eq!(talk.say(format!("{line}\n")), ["* designing...", refused]);
    }
    assert!(talk.ask("start").starts_with("error: the board's polarities"));
    assert!(talk.drive.commands.is_empty() && talk.drive.saved.is_none());
    assert_eq!(talk.ask("set limits.current_a 8"), "ok: staged");
    assert!(talk.ask("apply").starts_with("ok: the limits hold in software"));
}

#[test]
fn a_refused_design_names_the_reason_and_changes_nothing() {
    let mut talk = Talk::new();
    assert_eq!(
        talk.ask("set current_plant identified current_plant.q.p 0 current_plant.d.k 1"),
        "ok: staged"
    );
    let before = talk.front.desk.settings().in_force().drive;
    let replies = talk.say("start\n");
    assert_eq!((replies.len(), replies[0].as_str()), (2, "* designing..."));
    assert!(
        replies[1].starts_with("error: ") && replies[1].ends_with("; not in force, still staged"),
        "{replies:?}"
    );
    assert!(talk.drive.commands.is_empty());
    assert_eq!(talk.front.desk.settings().in_force().drive, before);
    let count = talk.front.desk.settings().count();
    assert!(count >= 2);
    assert_eq!(talk.ask("revert"), format!("ok: {count} staged values dropped"));
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn start_and_save_put_staged_values_in_force_first() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    assert_eq!(talk.say("start speed\n"), ["* designing...", "ok"]);
    assert!(matches!(
        talk.drive.commands[..],
        [Command::Configure(_), Command::Start(Mode::Speed)]
    ));
    assert_eq!(talk.ask("defaults"), "error: the drive must be off: `stop` first");
    assert_eq!(talk.ask("apply"), "ok: nothing staged");
    talk.ask("stop");
    assert_eq!(
        talk.ask("set motor.r_s 5.6 inverter.dead_time_s 3e-6"),
        "ok: staged; inverter.dead_time_s takes effect at the next reset, if saved"
    );
    let said = talk.say("save\n");
    assert_eq!(
        said,
        [
            "* designing...",
            "* applied: dead time and switching frequency change at the next reset, if saved; the board has to be confirmed again before a start",
            "ok"
        ]
    );
    assert_eq!(talk.drive.saved.unwrap().drive.motor.r_s, 5.6);
    talk.ask("set inverter.dead_time_s 2.9e-6");
    let remark = "ok: dead time and switching frequency change at the next reset, if saved";
    assert_eq!(talk.say("apply\n"), ["* designing...", remark]);
}

/// A design takes seconds, and they do not count as silence of the user.
#[test]
fn a_start_after_a_design_is_not_stopped_for_silence() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set command.timeout_s 1 motor.r_s 5.5"), "ok: staged");
    talk.port.sent.extend(b"start\n");
    talk.poll();
    talk.now_ms += 2000;
    talk.poll();
    talk.now_ms += 500;
    assert_eq!(talk.say(""), ["* designing...", "ok"]);
    assert_eq!(talk.drive.drive.state(), State::Calibrating);
}

#[test]
fn a_backup_restores_settings_and_what_was_learned() {
    let mut talk = Talk::new();
    let allow = "set injection.allow_unlearned yes";
    assert_eq!(talk.say("backup\n"), ["board reference", "defaults", allow, "apply", "ok"]);
    for line in [
        "set scales.current_a.gain 0.001 scales.current_a.offset -2 limits.dc_over_v 371.3",
        "set scales.current_b.gain 0.001 scales.current_b.offset -2",
        "set injection.monitor no injection.amplitude_v 0 injection.demodulator rectified",
        "set command.timeout_s 7.25 limits.trip_a auto",
    ] {
        assert!(talk.ask(line).starts_with("ok: staged"));
    }
    let refused = "error: there are staged values: `apply` or `revert` first";
    assert_eq!(talk.ask("backup"), refused);
    assert!(talk.ask("apply").starts_with("ok"));
    talk.drive.found = Some(found());
    talk.say("");
    let backup = talk.say("backup\n");
    let (end, lines) = backup.split_last().unwrap();
    assert_eq!((end.as_str(), lines[0].as_str()), ("ok", "board reference"));
    assert_eq!(lines.iter().filter(|line| line.starts_with("set ")).count(), 10);
    assert!(lines.iter().all(|line| line.len() <= line::LONGEST));

    let mut other = Talk::new();
    assert_eq!(other.ask("set motor.r_s 9"), "ok: staged");
    let replies = other.say(lines.join("\r\n") + "\r\n");
    assert!(replies.iter().all(|reply| !reply.starts_with("error")), "{replies:#?}");
    let mut expected = *talk.front.desk.settings().in_force();
    // After a restore the wiring is checked.
    expected.command.wiring_checked = false;
    assert_eq!(*other.front.desk.settings().in_force(), expected);
    assert_eq!(other.front.desk.settings().in_force().learned, Some(found()));
    assert_eq!(other.say("backup\n"), backup);
}

#[test]
fn damaged_learned_values_are_refused() {
    let mut talk = Talk::new();
    talk.drive.found = Some(found());
    talk.say("");
    let backup = talk.say("backup\n");
    let words: Vec<&str> =
        backup.iter().filter(|line| line.starts_with("learned ")).map(String::as_str).collect();
    let mut other = Talk::new();
    assert_eq!(other.ask(words[words.len() - 1]), "error: learned: word 0 is missing");
    let mut say = |lines: &[String]| other.say(lines.join("\n") + "\n").pop().unwrap();
    let mut lines: Vec<String> = words.iter().map(|line| (*line).to_owned()).collect();
    let missing = say(&[&lines[..1], &lines[2..]].concat());
    assert_eq!(missing, "error: learned: word 8 is missing");
    let last = lines[0].pop().unwrap();
    lines[0].push(if last == '0' { '1' } else { '0' });
    assert!(say(&lines).starts_with("error: learned: the checksum of these words is "));
    assert_eq!(
        say(&["learned 60 00000000 00000000".to_owned()]),
        "error: learned: more than 61 words"
    );
    assert!(!other.front.desk.settings().is_staged());
    // A whole result, but then other settings.
    assert_eq!(other.say(words.join("\n") + "\n").pop().unwrap(), "ok: staged");
    let dropped = "ok: staged; the restored values belong to other settings and are dropped";
    assert_eq!(other.ask("set motor.r_s 5"), dropped);
    assert_eq!(other.ask("apply"), "ok");
    assert_eq!(other.front.desk.settings().in_force().learned, None);
}

/// A result that was learned with one zero vector is discarded when both are switched on, and its backup is then refused. The same holds
/// the other way round.
#[test]
fn learned_values_hold_for_one_zero_vector_or_for_both() {
    for (learned, other) in [("no", "yes"), ("yes", "no")] {
        let mut talk = Talk::new();
        let set = |word| format!("set scales.both_zero_vectors {word}\napply\n");
        talk.say(set(learned));
        talk.drive.found = Some(found());
        talk.say("");
        let backup = talk.say("backup\n");
        let words = backup.iter().filter(|line| line.starts_with("learned "));
        let words = words.cloned().collect::<Vec<_>>().join("\n") + "\n";
        let forgotten =
            "ok: values learned with another scales.both_zero_vectors are dropped: learn again";
        assert_eq!(talk.say(set(other)).last().unwrap(), forgotten);
        assert_eq!(talk.front.desk.settings().in_force().learned, None);
        let refused = format!(
            "error: learned: with scales.both_zero_vectors = {learned}; set it to this first, or learn again"
        );
        assert_eq!(talk.say(words.clone()).last().unwrap(), &refused);
        assert_eq!(talk.front.desk.settings().latest().learned, None);
        // With the setting that it was learned with, it is accepted.
        talk.say(set(learned));
        assert_eq!(talk.say(words).last().unwrap(), "ok: staged");
        assert_eq!(talk.ask("apply"), "ok");
        assert_eq!(talk.front.desk.settings().in_force().learned, Some(found()));
    }
}

/// Earlier firmware learned with other rules, and printed 37 words or more: the refusal names the rules, not the missing words.
#[test]
fn a_result_of_earlier_firmware_is_refused() {
    for count in [37, 38, crate::store::learned::WORDS] {
        let mut words = crate::store::learned::to_words(&found(), false);
        words[36] &= !(1 << 24);
        let mut text = String::new();
        for (line, words) in words[..count].chunks(8).enumerate() {
            let words: Vec<String> = words.iter().map(|word| format!("{word:08x}")).collect();
            text += &format!("learned {} {}\n", 8 * line, words.join(" "));
        }
        let mut talk = Talk::new();
        let refused = talk.say(format!("{text}learned check 00000000\n"));
        let other = "error: learned: by an earlier firmware, which measured the motor in another way; `commission`, then `learn`";
        assert_eq!(refused.last().unwrap(), other);
        // Without the line that holds the rules, words are missing.
        let short: String = text.lines().take(4).map(|line| format!("{line}\n")).collect();
        let refused = talk.say(format!("{short}learned check 00000000\n"));
        assert_eq!(refused.last().unwrap(), "error: learned: word 32 is missing");
        assert_eq!(talk.ask("apply"), "ok: nothing staged");
    }
}

#[test]
fn a_reboot_loses_nothing_silently_and_waits_for_its_answer() {
    let mut talk = Talk::new();
    let kept = "error: settings that were not saved would be lost: `save` first, or `reboot now`";
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    assert_eq!(talk.ask("reboot"), kept);
    assert_eq!(talk.ask("apply"), "ok");
    assert_eq!(talk.ask("reboot"), kept);
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.ask("start"), "ok");
    assert_eq!(talk.ask("reboot"), "error: the drive must be off: `stop` first");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("reboot"), "ok: rebooting");
    assert_eq!(talk.drive.reboots, 0);
    talk.now_ms += 101;
    talk.poll();
    assert_eq!(talk.drive.reboots, 1);
    let mut talk = Talk::new();
    assert_eq!(talk.ask("echo off"), "ok");
    assert_eq!(talk.ask("reboot now"), "ok: rebooting");
}

#[test]
fn an_update_waits_for_what_the_loader_needs() {
    let mut talk = Talk::new();
    // 0.11 V a count: 21 V, then 19 V.
    talk.drive.sample.dc_link = 191;
    let charged = "error: the dc link has 21 V, and ST's loader drives a gate: 20 V at most";
    assert_eq!(talk.ask("update gates-off"), charged);
    talk.drive.sample.dc_link = 173;
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    assert!(talk.ask("update gates-off").starts_with("error: settings that were not saved"));
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.ask("start"), "ok");
    assert_eq!(talk.ask("update gates-off"), "error: the drive must be off: `stop` first");
    assert_eq!(talk.ask("stop"), "ok");
    assert_eq!(talk.ask("update gates-off"), "ok: ST's loader is next");
    talk.now_ms += 101;
    talk.poll();
    assert!(talk.drive.in_loader && talk.drive.reboots == 1);
}
