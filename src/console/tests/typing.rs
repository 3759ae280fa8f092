use super::*;

#[test]
fn typed_characters_come_back_if_asked_for() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("echo on"), "ok");
    talk.port.sent.extend(b"Stq\x08op\r\n");
    while !talk.port.sent.is_empty() {
        talk.poll();
    }
    talk.poll();
    let said = std::mem::take(&mut talk.port.received);
    assert_eq!(said, "Stq\x08 \x08op\r\nok\r\n");
    // Byte by byte, as a person types, each at once.
    for byte in *b"sta" {
        talk.port.sent.push_back(byte);
        talk.poll();
        talk.poll();
        let said = std::mem::take(&mut talk.port.received);
        assert_eq!(said.as_bytes(), [byte]);
    }
    // An announcement comes on a line of its own, followed by the text typed so far.
    talk.drive.drive.command(&Command::Start(Mode::Torque)).unwrap();
    talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    talk.poll();
    talk.poll();
    let said = std::mem::take(&mut talk.port.received);
    assert!(
        said.starts_with("\r\n* fault 20: ") && said.ends_with("type 'clear'\r\nsta"),
        "{said:?}"
    );
    assert_eq!(talk.say("\x15echo off\n").last().unwrap(), "ok");
    assert_eq!(talk.ask("version"), "version");
}

#[test]
fn keys_of_a_terminal_and_short_names_are_understood() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("\x1b[A\tVersion"), "version");
    assert_eq!(talk.say("?\n"), talk.say("help\n"));
    assert_eq!(talk.say("h\n").len(), HELP.len() + 2);
}
