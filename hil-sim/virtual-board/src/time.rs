//! The unit of time: ticks of the core clock.

/// Ticks per second.
pub const TICKS_PER_S: u64 = 170_000_000;
/// Ticks of a PWM period, from one top of the counter to the next.
pub const TICKS_PER_PERIOD: u64 = 2 * induction_drive::board::PWM_TOP as u64;
