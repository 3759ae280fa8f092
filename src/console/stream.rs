//! The requests of a stream, the silence that ends it, and the bits per second of the port.

use super::handle::{Firmware, Port};
use super::{Console, baud};
use crate::desk::Desk;
use crate::recording::stream::{Frames, Stream};
use crate::settings::Commander;

/// The stream, and the rate of the port.
pub(super) struct Wire {
    frames: Frames,
    /// Bits per second in force, and those requested.
    baud: u32,
    pub wanted: u32,
}

impl Default for Wire {
    fn default() -> Self {
        Self { frames: Frames::default(), baud: baud::USUAL, wanted: baud::USUAL }
    }
}

impl Console {
    /// Begins a stream.
    pub(super) fn stream(&mut self, stream: Stream, drive: &mut impl Firmware) {
        let divider = stream.divider;
        if let Err(why) = self.wire.frames.begin(stream, self.wire.wanted) {
            return self.error(&why);
        }
        drive.stream(0);
        drive.stream(divider);
        self.out.answer(format_args!("ok: every {divider} periods"));
    }

    /// Reports the state of the stream.
    pub(super) fn stream_state(&mut self) {
        self.out.answer(format_args!("ok: {}", self.wire.frames));
    }

    /// Ends the stream.
    pub(super) fn stop_stream(&mut self, drive: &mut impl Firmware) {
        drive.stream(0);
        self.wire.frames.end();
    }

    /// Sends the frames for which there is space; returns whether none waits any more.
    pub(super) fn send_frames(
        &mut self,
        port: &mut impl Port,
        desk: &Desk,
        drive: &mut impl Firmware,
    ) -> bool {
        let (settings, freq) = (&desk.settings().in_force().drive, desk.shaft().freq());
        let frames = &mut self.wire.frames;
        frames.send(|| drive.sampled(), |bytes| port.write(bytes), settings, freq)
    }

    /// Ends the stream when no line came for the time that it allows. If the console commands the drive, the drive is stopped.
    pub(super) fn watch_link(&mut self, desk: &mut Desk, drive: &mut impl Firmware, now_ms: u32) {
        let alive_s = self.wire.frames.alive_s();
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
        let usual = baud::USUAL;
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
            && self.line_ms.is_some_and(|heard| now_ms.wrapping_sub(heard) > baud::FALL_BACK_MS)
        {
            self.stop_stream(drive);
            self.wire.wanted = usual;
        }
    }
}
