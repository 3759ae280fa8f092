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
    // The tag applies to one request, and unrequested lines have none.
    assert_eq!(talk.say("stop\n"), ["ok"]);
    assert_eq!(talk.say("@1 start speed\n"), ["@1 ok"]);
    talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    let told = talk.say("");
    assert!(told.len() == 1 && told[0].starts_with("* fault 20: "), "{told:?}");
}

#[test]
fn a_request_with_a_malformed_tag_is_not_carried_out() {
    let mut talk = Talk::new();
    for line in ["@ start speed", "@123456789 start speed", "@", "@123456789"] {
        let told = talk.ask(line);
        assert!(told.starts_with("error: a tag has 1 to 8 characters"), "{line}: {told}");
    }
    assert!(talk.drive.commands.is_empty());
    assert_eq!(talk.ask("@12345678 start speed"), "@12345678 ok");
    assert_eq!(talk.drive.commands.len(), 1);
    assert_eq!(talk.ask("@1"), "@1 error: a command is missing");
    assert!(talk.ask("@1 @2 stop").starts_with("@1 error: no such command: @2"));
    assert!(talk.ask("* stop").starts_with("error: no such command: *"));
}

/// A design takes place before the answer, and the field bus is served meanwhile.
#[test]
fn an_answer_that_takes_long_has_the_tag_of_its_request() {
    let mut talk = Talk::new();
    talk.say("set motor.r_s 5.5\n");
    assert_eq!(talk.say("@7 start speed\n@8 stop\n"), ["* designing...", "@7 ok", "@8 ok"]);
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
