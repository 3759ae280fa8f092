//! The stream of frames beside the lines, and the bits per second of the port.

use core::fmt;

use drive_core::io::PERIOD_S;
use drive_settings::Settings;
use drive_stream::{Frame, LONGEST, MOST_SIGNALS, wire_bytes};
use thiserror::Error;

use super::Console;
use super::grammar::Stream;
use super::handle::{Firmware, Port};
use crate::board;
use crate::desk::Desk;
use crate::desk::shaft::Shaft;
use crate::link::ring::Record;
use crate::link::trace::{self, SIGNALS};
use crate::settings::Commander;

const _: () = assert!(trace::MOST == MOST_SIGNALS);

/// The stream, and the rate of the port.
pub(super) struct Wire {
    stream: Option<Stream>,
    frame: [u8; LONGEST],
    /// Bytes of a frame that waits for space.
    waiting: usize,
    sent: u32,
    dropped: u32,
    /// Control period of the last frame, in dividers, and its sequence number; `None` before the first.
    last: Option<(u32, u16)>,
    /// Bits per second in force, and those requested.
    baud: u32,
    pub wanted: u32,
}

impl Default for Wire {
    fn default() -> Self {
        let baud = board::SERIAL_BAUD;
        let (frame, wanted) = ([0; LONGEST], baud);
        Self { stream: None, frame, waiting: 0, sent: 0, dropped: 0, last: None, baud, wanted }
    }
}

impl Wire {
    /// Time without a line after which the drive stops, s; 0: never.
    pub fn alive_s(&self) -> f32 {
        self.stream.as_ref().map_or(0.0, |stream| stream.alive_s)
    }

    /// Makes the frame of a record, and counts the frames before it that were dropped.
    fn make(&mut self, record: &Record, settings: &Settings, shaft: &Shaft) {
        let Some(stream) = &self.stream else { return };
        let all = trace::shown(&record.telemetry, &record.sampled, shaft.freq());
        let mut values = trace::Record::default();
        stream.choice.record(&mut values, &all);
        let values = values.iter().zip(stream.choice.signals());
        let values = values.map(|(value, signal)| signal.shown(*value, settings)).collect();
        // The record has waited for less than a divider.
        let (period, now) = (record.period, record.period / u32::from(stream.divider).max(1));
        let (last, before) = self.last.unwrap_or((now.wrapping_sub(1), u16::MAX));
        let due = now.wrapping_sub(last);
        let sequence = before.wrapping_add(due as u16);
        self.dropped = self.dropped.wrapping_add(due.saturating_sub(1));
        self.last = Some((now, sequence));
        self.waiting = Frame { sequence, period, values }.write(&mut self.frame);
    }
}

/// Reason why a stream is refused.
#[derive(Debug, Error)]
#[error("the stream needs {wanted} bytes/s; {baud} baud has room for {room}: `baud`, or fewer")]
struct TooMuch {
    wanted: u32,
    baud: u32,
    room: u32,
}

impl Console {
    /// Begins a stream.
    pub(super) fn stream(&mut self, stream: Stream, drive: &mut impl Firmware) {
        let (signals, baud) = (stream.choice.signals().count(), self.wire.wanted);
        let rate = board::PWM_HZ / u32::from(stream.divider).max(1);
        let wanted = rate * wire_bytes(signals) as u32;
        // Ten bits a byte.
        let room = baud / 10 * board::STREAM_SHARE / 100;
        if wanted > room {
            return self.error(&TooMuch { wanted, baud, room });
        }
        drive.stream(0);
        drive.stream(stream.divider);
        let (divider, baud, wanted) = (stream.divider, self.wire.baud, self.wire.wanted);
        self.wire = Wire { stream: Some(stream), baud, wanted, ..Wire::default() };
        self.out.answer(format_args!("ok: every {divider} periods"));
    }

    /// Reports the state of the stream.
    pub(super) fn stream_state(&mut self) {
        let Wire { sent, dropped, .. } = self.wire;
        let on = if self.wire.stream.is_some() { "on" } else { "off" };
        self.out.answer(format_args!("ok: {on}, {sent} frames, {dropped} dropped"));
    }

    /// Ends the stream.
    pub(super) fn stop_stream(&mut self, drive: &mut impl Firmware) {
        drive.stream(0);
        self.wire.stream = None;
    }

    /// Sends the frames for which there is space; returns whether none waits any more.
    pub(super) fn send_frames(
        &mut self,
        port: &mut impl Port,
        desk: &Desk,
        drive: &mut impl Firmware,
    ) -> bool {
        let settings = &desk.settings().in_force().drive;
        let wire = &mut self.wire;
        // At most as many frames as the ring holds, so that the main loop goes on.
        for _ in 0..=board::RECORDED_PERIODS {
            if wire.waiting == 0 {
                let Some(record) = drive.sampled() else { return true };
                wire.make(&record, settings, desk.shaft());
            }
            if !port.write(wire.frame.get(..wire.waiting).unwrap_or_default()) {
                return false;
            }
            wire.waiting = 0;
            wire.sent = wire.sent.wrapping_add(1);
        }
        false
    }

    /// Ends the stream when no line came for the time that it allows. If the console commands the drive, the drive is stopped.
    pub(super) fn watch_link(&mut self, desk: &mut Desk, drive: &mut impl Firmware, now_ms: u32) {
        let alive_s = self.wire.alive_s();
        let silence_ms = now_ms.wrapping_sub(*self.line_ms.get_or_insert(now_ms));
        if alive_s > 0.0 && silence_ms as f32 * 1e-3 > alive_s {
            self.stop_stream(drive);
            if desk.commander() == Commander::Console {
                desk.stop_after_silence(alive_s, drive, now_ms);
            }
        }
    }

    /// Changes the rate as requested, when the answer is sent; falls back without a valid line.
    pub(super) fn watch_rate(
        &mut self,
        port: &mut impl Port,
        drive: &mut impl Firmware,
        now_ms: u32,
    ) {
        let usual = board::SERIAL_BAUD;
        if self.wire.wanted != self.wire.baud {
            let wanted = self.wire.wanted;
            if self.flushed(port) && port.change_rate(wanted) {
                self.wire.baud = wanted;
                self.line_ms = Some(now_ms);
                if wanted == usual {
                    self.out.news(format_args!("link: {usual} baud"));
                }
            }
        } else if self.wire.baud != usual
            && self
                .line_ms
                .is_some_and(|heard| now_ms.wrapping_sub(heard) > board::SERIAL_FALL_BACK_MS)
        {
            self.stop_stream(drive);
            self.wire.wanted = usual;
        }
    }
}

/// A line of `describe stream`: the signals, then the layout.
pub(super) fn described(line: usize) -> Option<impl fmt::Display> {
    (line <= SIGNALS.len()).then(|| {
        fmt::from_fn(move |f| match SIGNALS.get(line) {
            Some(signal) => {
                let (name, id, unit) = (signal.name, signal.id, signal.unit());
                write!(f, "{{\"signal\":\"{name}\",\"number\":{id},\"unit\":\"{unit}\"}}")
            }
            None => write!(
                f,
                "{{\"frame\":[\"u16 sequence\",\"u32 period\",\"f32 per signal\",\"u16 crc\"],\
                 \"order\":\"little-endian\",\"crc\":\"CRC-16/IBM-3740\",\"framing\":\"00 COBS 00\",\
                 \"most\":{MOST_SIGNALS},\"period_s\":{PERIOD_S}}}"
            ),
        })
    })
}
