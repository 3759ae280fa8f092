//! The frames of the stream beside the lines.

use super::*;
use crate::recording::ring::Record;
use crate::recording::trace::Sampled;
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
