//! Input and output of the control step, [`Measured`] and [`Output`], and of the [front end](crate::FrontEnd) around it, in
//! ADC counts and timer counts: [`Sample`] and [`Compare`].
//!
//! # The delay convention
//!
//! One PWM period lasts `T` = 1/6000 s. It begins and ends with all low sides on (vector O_000),
//! and at that instant, `t = k T`, the currents are sampled. [`Drive::step`](crate::Drive::step)
//! turns the sample of instant `k` into the duties of the period from `(k + 1) T` to `(k + 2) T`:
//! the timer preloads them and takes them over at the next period boundary. Therefore
//!
//! * a voltage takes effect one period after the sample it was computed from, and
//! * its mean acts at `(k + 1.5) T`.

use bitflags::bitflags;

use crate::fault::Fault;
use crate::math::frames::{Abc, AlphaBeta};

/// Period of the control, s: 6 kHz. Filters and injection are designed for this rate only.
pub const PERIOD_S: f32 = 1.0 / 6000.0;

/// Largest ADC counts of the 12-bit ADCs of dc link and heat sink.
pub const CONVERTER_CODES: u16 = 4095;

/// Returns the number of whole control periods in a time in s, rounded. It is not for the control step.
#[cold]
pub fn periods(seconds: f32) -> u32 {
    libm::roundf(seconds / PERIOD_S) as u32
}

/// Input of a control step: the quantities at the instant `k T` of one PWM period, in SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Currents into the motor, A, without the offsets of their sensors; c is -(a + b).
    pub phases: Abc,
    /// Current c from its own sensor, A; `phases.c` if there is none. Only the measurement of the offsets uses it.
    pub third: f32,
    /// Dc-link voltage, V.
    pub dc_link: f32,
    /// Share of the current that the temperature of the heat sink allows; 1 or more for all of it, 0 or less for none.
    pub heat_sink: f32,
    /// Position counter of the quadrature encoder, four counts a line, wrapping, upwards when the
    /// rotor turns from phase a towards phase b.
    pub encoder: u32,
    /// Events since the last step.
    pub hardware: Hardware,
    /// Fault of a sensor that cannot be trusted. It is ignored while the outputs are off.
    pub fault: Option<Fault>,
}

impl Measured {
    /// Returns the current in the stator frame, A peak.
    pub fn current(&self) -> AlphaBeta {
        AlphaBeta::from_two_phases(self.phases.a, self.phases.b)
    }
}

/// Output of a control step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// Duties of the high sides of a, b, c, 0 to 1, for the period from `(k + 1) T` to `(k + 2) T`. With `None`, all six
    /// switches are turned off at once, without waiting for the end of the period.
    pub duties: Option<[f32; 3]>,
    /// Duty of the brake chopper in that period, 0 to 1.
    pub chopper: f32,
    /// Whether the precharge relay is to be closed; always `false` if the settings have none.
    pub relay: bool,
}

/// Readings of ADCs and encoder at the instant `k T` of one PWM period, as plain register values. If the settings say so, the
/// reading of a current is the sum of two conversions: one half a period earlier, in the upper zero vector, and one now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// ADC counts of the current into phase a.
    pub current_a: u16,
    /// ADC counts of the current into phase b.
    pub current_b: u16,
    /// ADC counts of the current into phase c; not used unless `Scales::shunts` says so.
    pub current_c: u16,
    /// ADC counts of the dc-link voltage.
    pub dc_link: u16,
    /// ADC counts of the heat-sink temperature. A board without a thermistor gives a value inside the window of
    /// `Ntc`, for example 1309 for 25 °C with the defaults.
    pub heat_sink: u16,
    /// Position counter of the quadrature encoder, four counts a line, wrapping, upwards when the
    /// rotor turns from phase a towards phase b.
    pub encoder: u32,
    /// Events since the last sample.
    pub hardware: Hardware,
}

bitflags! {
    /// Events that the hardware around the drive reports with a sample; each latches a fault.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Hardware: u8 {
        /// The power stage has pulled the timer's break input, so the outputs are already off.
        const BREAK = 1;
        /// An analog watchdog or comparator has seen a current beyond its limit.
        const ANALOG_WATCHDOG = 1 << 1;
        /// The control interrupt was late, was skipped, or took too long.
        const DEADLINE_MISS = 1 << 2;
        /// A conversion was overwritten before it was read, or did not take place.
        const CONVERTER_OVERRUN = 1 << 3;
        /// The output of the brake chopper is off at any duty. It is no fault without a brake resistor.
        const CHOPPER_OFF = 1 << 4;
        /// The clock of the control and another one of the chip do not agree.
        const CLOCK = 1 << 5;
        /// The reference voltage of the ADCs is wrong.
        const REFERENCE = 1 << 6;
    }
}

/// Compare values of the timer for the period from `(k + 1) T` to `(k + 2) T`.
///
/// The counter runs up and down between 0 and `Inverter::top` and the high side of a leg is on
/// while it is below the compare value; the period starts at the top, so that 0 means low side on
/// all the time and `top` means high side on all the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Compare {
    /// Compare value of phase a.
    pub a: u16,
    /// Compare value of phase b.
    pub b: u16,
    /// Compare value of phase c.
    pub c: u16,
    /// Whether the outputs are on at all. If not, all six switches are turned off at once, without
    /// waiting for the end of the period.
    pub enabled: bool,
}

impl Compare {
    /// All six switches are off.
    pub const OFF: Self = Self { a: 0, b: 0, c: 0, enabled: false };
    /// All low sides are on: the voltage is zero, and the bootstrap capacitors charge.
    pub const LOW_SIDES_ON: Self = Self { a: 0, b: 0, c: 0, enabled: true };
}

/// Duties with all low sides on.
pub(crate) const LOW_SIDES_ON: [f32; 3] = [0.0; 3];
