//! Offsets in a drive of quantities that a debugger or a test reads from memory, without a reference to the drive.

use core::mem::offset_of;
use core::ops::Range;

use super::Drive;

/// Offsets in a [`Drive`], bytes. Those of [`Telemetry`](super::Telemetry) have its units.
pub struct Layout {
    /// All that changes while the drive regulates.
    pub state: Range<usize>,
    /// `phi` of the telemetry, a `u32` fraction of a turn.
    pub phi: usize,
    /// `rotor_freq` of the telemetry, an `f32`.
    pub rotor_freq: usize,
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
        state: offset_of!(Self, kept)..size_of::<Self>(),
        phi: offset_of!(Self, kept.seen.phi),
        rotor_freq: offset_of!(Self, kept.seen.rotor_freq),
        reference_q: offset_of!(Self, kept.seen.reference.q),
        current_q: offset_of!(Self, kept.seen.current.q),
        dc_link: offset_of!(Self, kept.seen.dc_link),
    };
}
