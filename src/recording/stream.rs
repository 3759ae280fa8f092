//! The stream: chosen signals as frames, beside the lines of the console.

use core::fmt;

use drive_core::io::PERIOD_S;
use drive_settings::Settings;
use drive_stream::{Frame, LONGEST, MOST_SIGNALS, wire_bytes};

use super::ring::{self, Record};
use super::trace::{self, SIGNALS, SignalChoice};
use crate::board;

const _: () = assert!(trace::MOST == MOST_SIGNALS);

/// Share of the port's bytes that a stream may take, %: the rest is for the lines of the console.
const STREAM_SHARE: u32 = 80;

/// A requested stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream {
    /// Its signals.
    pub choice: SignalChoice,
    /// Control periods from one frame to the next.
    pub divider: u16,
    /// Time without a line after which the drive stops, s; 0: never.
    pub alive_s: f32,
}

/// The frames of a stream, if there is one.
pub struct Frames {
    stream: Option<Stream>,
    frame: [u8; LONGEST],
    /// Bytes of a frame that waits for space.
    waiting: usize,
    sent: u32,
    dropped: u32,
    /// Control period of the last frame, in dividers, and its sequence number; `None` before the first.
    last: Option<(u32, u16)>,
}

impl Default for Frames {
    fn default() -> Self {
        Self { stream: None, frame: [0; LONGEST], waiting: 0, sent: 0, dropped: 0, last: None }
    }
}

impl Frames {
    /// Begins a stream at a port with this rate, bits per second.
    ///
    /// # Errors
    /// The frames do not fit.
    pub fn begin(&mut self, stream: Stream, baud: u32) -> Result<(), impl fmt::Display + use<>> {
        let rate = board::PWM_HZ / u32::from(stream.divider).max(1);
        let wanted = rate * wire_bytes(stream.choice.signals().count()) as u32;
        // Ten bits a byte.
        let room = baud / 10 * STREAM_SHARE / 100;
        if wanted > room {
            return Err(fmt::from_fn(move |f| {
                write!(
                    f,
                    "the stream needs {wanted} bytes/s; {baud} baud has room for {room}: `baud`, or fewer"
                )
            }));
        }
        *self = Self { stream: Some(stream), ..Self::default() };
        Ok(())
    }

    /// Ends the stream.
    pub fn end(&mut self) {
        self.stream = None;
    }

    /// Time without a line after which the drive stops, s; 0: never.
    pub fn alive_s(&self) -> f32 {
        self.stream.as_ref().map_or(0.0, |stream| stream.alive_s)
    }

    /// Sends the frames for which there is space; returns whether none waits any more. `next` gives the next record of the stream,
    /// `write` sends all bytes or none, and `freq` is the speed of a shaft whose drive is off, electrical turns per control period.
    pub fn send(
        &mut self,
        mut next: impl FnMut() -> Option<Record>,
        mut write: impl FnMut(&[u8]) -> bool,
        settings: &Settings,
        freq: f32,
    ) -> bool {
        // At most as many frames as the ring holds, so that the main loop goes on.
        for _ in 0..=ring::PERIODS {
            if self.waiting == 0 {
                let Some(record) = next() else { return true };
                self.make(&record, settings, freq);
            }
            if !write(self.frame.get(..self.waiting).unwrap_or_default()) {
                return false;
            }
            self.waiting = 0;
            self.sent = self.sent.wrapping_add(1);
        }
        false
    }

    /// Makes the frame of a record, and counts the frames before it that were dropped.
    fn make(&mut self, record: &Record, settings: &Settings, freq: f32) {
        let Some(stream) = &self.stream else { return };
        let all = trace::shown(&record.telemetry, &record.sampled, freq);
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

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = if self.stream.is_some() { "on" } else { "off" };
        write!(f, "{on}, {} frames, {} dropped", self.sent, self.dropped)
    }
}

/// A line of `describe stream`: the signals, then the layout.
pub fn described(line: usize) -> Option<impl fmt::Display> {
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
