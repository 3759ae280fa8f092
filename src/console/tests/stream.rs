//! The stream beside the lines, the rate of the port, and the effect of a lost link.

use super::*;
use crate::board;
use crate::link::ring::Record;
use crate::link::trace::Sampled;
use drive_core::{Stage, Telemetry};

impl Talk {
    /// A record of this period for the stream, with this current.
    fn sample(&mut self, period: u32, i_q: f32) {
        let mut telemetry = Telemetry { turns: 0.5, ..Telemetry::default() };
        telemetry.current.q = i_q;
        telemetry.rotor_freq = 10.0 * PERIOD_S;
        let sampled = Sampled { state: Stage::Running as u8, ..Sampled::default() };
        let record = Record { period, telemetry, sampled, ..Record::default() };
        self.drive.streamed.1.push_back(record);
    }

    fn pass(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_ms += 1;
            self.poll();
        }
    }
}

#[test]
fn frames_have_the_signals_asked_for_in_their_units_and_count_what_is_lost() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("stream i_q_a speed_rpm turns 100"), "ok: every 60 periods");
    assert_eq!(talk.drive.streamed.0, 60);
    for period in [60, 120, 300] {
        talk.sample(period, 1.5);
    }
    let status = talk.ask("status");
    assert!(status.starts_with("off"), "{status}");
    let frames = &talk.port.frames;
    assert_eq!(
        frames.iter().map(|f| (f.sequence, f.period)).collect::<Vec<_>>(),
        [(0, 60), (1, 120), (4, 300)]
    );
    // 10 Hz electrical at two pole pairs are 300 rpm; to f32's rounding.
    assert_eq!(frames[0].values[0], 1.5);
    assert!((frames[0].values[1] - 300.0).abs() < 1e-3, "{:?}", frames[0]);
    assert_eq!(frames[0].values[2], 0.5);
    assert_eq!(talk.ask("stream off"), "ok: off, 3 frames, 2 dropped");
    assert_eq!(talk.drive.streamed.0, 0);
    assert_eq!(talk.ask("stream"), "ok: off, 3 frames, 2 dropped");
}

#[test]
fn a_stream_is_refused_whole() {
    let mut talk = Talk::new();
    for (line, why) in [
        ("stream i_q_a 9999", "the frames a second = 9999: not a whole number from 1 to 6000"),
        ("stream i_q_a 2000", "the stream needs 30000 bytes/s; 115200 baud has room for 9216"),
        ("stream 100", "a signal is missing"),
        ("stream i_q_a", "ok"),
        ("stream iq_a", "no such signal: iq_a; did you mean"),
        ("stream i_q_a alive 0", "the seconds without a line = 0: not one of: 0.1 to 10"),
        ("stream i_q_a alive", "the seconds is missing"),
        ("baud 9600", "the bits per second = 9600: not a whole number from 115200 to 2000000"),
        ("baud", "the bits per second is missing"),
    ] {
        let answer = talk.ask(line);
        assert!(answer.contains(why), "{line}: {answer}");
    }
    let nine = "phi_deg i_q_a i_q_a i_q_a i_q_a i_q_a i_q_a i_q_a i_q_a";
    assert!(talk.ask(&format!("stream {nine}")).contains("more than 8 signals"));
}

#[test]
fn text_goes_first_and_a_list_last() {
    let mut talk = Talk::new();
    talk.ask("stream i_q_a 100");
    talk.port.room = 60;
    (0..6).for_each(|n| talk.sample(60 * n, 1.0));
    talk.port.sent.extend(b"help\n");
    talk.poll();
    // Frames of 15 bytes fill the space; the list waits.
    assert_eq!(talk.port.frames.len(), 4);
    assert_eq!(talk.port.received, "");
    talk.port.room = 45;
    talk.poll();
    assert_eq!(talk.port.frames.len(), 6);
    assert_eq!(talk.port.received, "", "a line of the list does not fit yet");
    talk.port.room = 200;
    talk.poll();
    assert!(talk.port.received.starts_with("help "), "{}", talk.port.received);
}

#[test]
fn the_rate_changes_behind_the_answer_and_falls_back_without_a_valid_line() {
    let mut talk = Talk::new();
    talk.port.sending = true;
    assert_eq!(talk.ask("baud 2000000"), "ok");
    talk.pass(5);
    assert_eq!(talk.port.baud, 0, "the answer is still on its way");
    talk.port.sending = false;
    talk.pass(1);
    assert_eq!(talk.port.baud, 2_000_000);
    assert_eq!(talk.ask("stream i_q_a 2000"), "ok: every 3 periods");
    for _ in 0..5 {
        talk.pass(board::SERIAL_FALL_BACK_MS - 100);
        assert!(talk.ask("status").starts_with("off"));
    }
    talk.pass(board::SERIAL_FALL_BACK_MS - 10);
    assert_eq!(talk.port.baud, 2_000_000);
    // Bytes that form no line do not count.
    talk.port.sent.extend(b"\x00\xff\n");
    talk.pass(20);
    assert_eq!(talk.port.baud, board::SERIAL_BAUD);
    assert!(talk.port.received.contains("* link: 115200 baud\r\n"), "{}", talk.port.received);
    assert_eq!(talk.drive.streamed.0, 0, "the stream has ended");
}

#[test]
fn a_link_that_is_lost_stops_the_drive_if_the_stream_asks_for_it() {
    let mut talk = Talk::new();
    talk.ask("stream i_q_a 100 alive 0.4");
    talk.ask("start");
    for _ in 0..10 {
        talk.pass(390);
        // An empty line is a sign of life.
        assert!(talk.say("\n").is_empty());
    }
    assert!(!talk.drive.commands.contains(&Command::Stop(Stop::Coast)));
    talk.pass(399);
    assert!(!talk.drive.commands.contains(&Command::Stop(Stop::Coast)));
    talk.pass(3);
    assert_eq!(talk.drive.commands.last(), Some(&Command::Stop(Stop::Coast)));
    assert!(
        talk.port.received.contains("* stopped: no command for 0.4 s"),
        "{}",
        talk.port.received
    );
    assert_eq!(talk.drive.streamed.0, 0);
}

/// A design takes seconds, during which nothing is read: lines received meanwhile count as signs of life at its end.
#[test]
fn a_design_that_takes_seconds_ends_neither_the_stream_nor_the_rate() {
    let mut talk = Talk::new();
    talk.ask("baud 2000000");
    talk.ask("stream i_q_a 2000 alive 0.4");
    assert_eq!(talk.ask("set motor.r_s 5.5"), "ok: staged");
    talk.port.sent.extend(b"apply\n\n\n");
    // One pass takes the line and designs at its end.
    talk.poll();
    talk.now_ms += 3000;
    let answer = talk.say("");
    assert_eq!(answer.last().map(String::as_str), Some("ok"));
    assert_eq!((talk.drive.streamed.0, talk.port.baud), (3, 2_000_000));
    // The commissioning designs outside the console.
    talk.port.sent.extend(b"\n\n");
    talk.now_ms += 3000;
    talk.poll();
    assert_eq!((talk.drive.streamed.0, talk.port.baud), (3, 2_000_000));
    talk.pass(401);
    assert_eq!(talk.drive.streamed.0, 0, "the watch goes on");
}

#[test]
fn the_signals_and_the_layout_are_described_as_json() {
    let lines = Talk::new().say("describe stream\n");
    assert_eq!(lines[0], r#"{"signal":"phi_deg","number":0,"unit":"deg"}"#);
    assert_eq!(lines.len(), crate::link::trace::SIGNALS.len() + 2);
    let layout = &lines[lines.len() - 2];
    for part in
        [r#""frame":["u16 sequence","u32 period","f32 per signal","u16 crc"]"#, r#""most":8"#]
    {
        assert!(layout.contains(part), "{layout}");
    }
}
