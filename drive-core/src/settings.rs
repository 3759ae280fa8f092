//! Settings in SI units, and the coefficients the control step works with.

/// The timer that makes the PWM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimerSettings {
    /// Value at which the counter turns round.
    pub top: u16,
}

/// Everything the control step needs, made from settings outside the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {}
