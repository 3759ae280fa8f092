//! Offsets in a drive of quantities that a debugger or a test reads from memory, without a reference to the drive.

use core::mem::offset_of;
use core::ops::Range;

use super::{ControlState, Drive};

/// Offsets in a [`Drive`], bytes. Those of [`Telemetry`](super::Telemetry) have its units.
pub struct Layout {
    /// All that changes while the drive regulates.
    pub state: Range<usize>,
    /// Angle source, one byte: 0 is the encoder.
    pub angle_source: usize,
    /// `phi` of the telemetry, a `u32` fraction of a turn.
    pub phi: usize,
    /// `rotor_freq` of the telemetry with the encoder, an `f32`.
    pub rotor_freq_encoder: usize,
    /// `rotor_freq` of the telemetry with the injection, an `f32`.
    pub rotor_freq_injection: usize,
    /// `reference.q` of the telemetry, an `f32`.
    pub reference_q: usize,
    /// `current.q` of the telemetry, an `f32`.
    pub current_q: usize,
    /// `dc_link` of the telemetry, an `f32`.
    pub dc_link: usize,
}

impl Drive {
    /// Offsets in a drive.
    pub const LAYOUT: Layout = Layout {
        state: offset_of!(Self, control)..offset_of!(Self, control) + size_of::<ControlState>(),
        angle_source: offset_of!(Self, c.source),
        phi: offset_of!(Self, control.seen.phi),
        rotor_freq_encoder: offset_of!(Self, control.indirect.rotor_freq),
        rotor_freq_injection: offset_of!(Self, control.estimator.rotor_freq),
        reference_q: offset_of!(Self, control.seen.reference.q),
        current_q: offset_of!(Self, control.seen.current.q),
        dc_link: offset_of!(Self, control.seen.dc_link),
    };
}
