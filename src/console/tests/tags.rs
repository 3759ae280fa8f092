//! Requests with a tag, and unrequested lines.

use super::*;

/// Requests whose answer is one line, and those with many.
const ONE: [&str; 9] = [
    "status",
    "version",
    "get motor.r_s",
    "faults",
    "apply",
    "stop",
    "torque 1",
    "torqe 1",
    "stream",
];
const MANY: [&str; 8] =
    ["help", "get", "get mot", "describe", "describe stream", "backup", "history", "faults 4"];

#[test]
fn the_last_line_of_an_answer_and_no_other_repeats_the_tag() {
    let mut talk = Talk::new();
    for (requests, many) in [(&ONE[..], false), (&MANY[..], true)] {
        for request in requests {
            let plain = talk.say(format!("{request}\n"));
            let tagged = talk.say(format!("@A-17 {request}\n"));
            assert_eq!(plain.len() > 1, many, "{plain:?}");
            let (last, before) = tagged.split_last().unwrap();
            let (last_plain, before_plain) = plain.split_last().unwrap();
            assert_eq!(*last, format!("@A-17 {last_plain}"));
            assert_eq!(before, before_plain);
        }
    }
}

#[test]
fn a_line_cuts_a_list_short_whose_tag_then_never_comes() {
    let mut talk = Talk::new();
    talk.port.sent.extend(b"@1 help\n");
    for _ in 0..3 {
        talk.poll();
    }
    let told = talk.say("@2 stop\n");
    assert!(told.len() > 2 && told.iter().all(|line| !line.starts_with("@1 ")), "{told:?}");
    assert_eq!(told.last().unwrap(), "@2 ok");
    // A damaged line does the same; nobody knows whose it is.
    talk.port.sent.extend(b"@3 help\n");
    for _ in 0..3 {
        talk.poll();
    }
    talk.port.damaged = true;
    let told = talk.say("@4 stop\n");
    assert_eq!(told.last().unwrap(), "error: characters were lost or damaged");
}
