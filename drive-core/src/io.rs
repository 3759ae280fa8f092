//! What goes into the drive and what comes out: [`Sample`], [`Command`], [`Compare`].
//!
//! # The delay convention
//!
//! One PWM period lasts `T` = 1/6000 s. It begins and ends with all low sides on (vector O_000),
//! and at that instant, `t = k T`, the currents are sampled. [`Drive::step`](crate::Drive::step)
//! turns the sample of instant `k` into the compare values of the period from `(k + 1) T` to
//! `(k + 2) T`: the timer preloads them and takes them over at the next period boundary. So
//!
//! * a voltage takes effect one period after the sample it was computed from, and
//! * its mean acts at `(k + 1.5) T`.

use crate::decimal::Shortest;

/// What the converters and the encoder read at the instant `k T` of one PWM period.
///
/// Plain register values: scaling is the drive's work, so that there is one place for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Converter code of the current into phase a.
    pub current_a: u16,
    /// Converter code of the current into phase b.
    pub current_b: u16,
    /// Converter code of the dc-link voltage.
    pub dc_link: u16,
    /// Converter code of the heat-sink temperature.
    pub heat_sink: u16,
    /// Position counter of the quadrature encoder, four counts a line, wrapping, upwards when the
    /// rotor turns from phase a towards phase b.
    pub encoder: u32,
    /// What the hardware has noticed since the last sample.
    pub hardware: Hardware,
}

/// Events that the hardware around the drive reports with a sample; each latches a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hardware(u8);

impl Hardware {
    /// Nothing to report.
    pub const NONE: Self = Self(0);
    /// The power stage has pulled the timer's break input: outputs are off already.
    pub const BREAK: Self = Self(1);
    /// An analog watchdog or comparator has seen a current beyond its limit.
    pub const ANALOG_WATCHDOG: Self = Self(1 << 1);
    /// The control interrupt came late, was skipped, or took too long.
    pub const DEADLINE_MISS: Self = Self(1 << 2);
    /// A conversion was overwritten before it was read, or did not take place.
    pub const CONVERTER_OVERRUN: Self = Self(1 << 3);
    /// The clock has failed over.
    pub const CLOCK_FAILURE: Self = Self(1 << 4);

    /// Both sets of events.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether any event of `other` is in this set.
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// What the timer is to do during the period from `(k + 1) T` to `(k + 2) T`.
///
/// The counter runs up and down between 0 and [`Inverter::top`](crate::settings::Inverter::top)
/// and the high side of a leg is on while it is below the compare value; the period starts at the
/// top, so that 0 means low side on throughout and `top` means high side on throughout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Compare {
    /// Compare value of phase a.
    pub a: u16,
    /// Compare value of phase b.
    pub b: u16,
    /// Compare value of phase c.
    pub c: u16,
    /// Whether the outputs are on at all. When not, all six switches are off at once, without
    /// waiting for the period to end.
    pub enabled: bool,
}

impl Compare {
    /// All six switches off.
    pub const OFF: Self = Self { a: 0, b: 0, c: 0, enabled: false };
    /// All low sides on: zero voltage, and the bootstrap capacitors charge.
    pub const LOW_SIDES_ON: Self = Self { a: 0, b: 0, c: 0, enabled: true };

    /// Outputs on, with the compare values of a, b, c.
    #[inline]
    pub const fn on([a, b, c]: [u16; 3]) -> Self {
        Self { a, b, c, enabled: true }
    }
}

/// What the drive is to regulate once it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Torque, by the current on the quadrature axis.
    Torque,
    /// Speed of the rotor; see [`motion`](crate::motion).
    Speed,
    /// Position of the rotor. Without the encoder it drifts; see [`motion`](crate::motion).
    Position,
    /// Identification of the motor. Not available yet: refused.
    Commissioning,
    /// Learns, with the shaft locked, what the angle tracking needs (see [`crate::learning`]), then
    /// stops.
    Learning,
}

/// A command to the drive; see [`Drive::command`](crate::Drive::command) for what is refused when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command<'a> {
    /// From off: calibrate the offsets, charge the bootstraps, magnetise, verify the lock where the
    /// angle comes from the injection, then regulate as `Mode` says.
    Start(Mode),
    /// While regulating with the injection: no torque, magnetise again, verify that the flux is
    /// tracked, then go on at zero torque. After a fault the same is done by a clear and a start.
    Relock,
    /// From off: the next start checks the wiring first; see [`crate::wiring_check`].
    CheckWiring,
    /// Take the torque to zero, then switch off.
    Stop,
    /// Forget the latched fault and be off.
    Clear,
    /// Reference of the quadrature-axis current, A peak; limited to the machine's limits.
    Torque(f32),
    /// Reference of the speed, mechanical rpm; limited to `speed.limit_rpm`.
    Speed(f32),
    /// Reference of the position, mechanical turns from where the drive was started; limited to
    /// what is counted.
    Position(f32),
    /// Reference of the direct-axis (magnetising) current, A peak.
    Magnetising(f32),
    /// Turn the injection axis by this many electrical degrees away from phi + 90°, to map delta_i
    /// over the angle (Figure 19). Only with the encoder as angle source; a start takes it back.
    TurnInjection(f32),
    /// A voltage in the flux frame, V, added to that of the current loop from the next period on: to
    /// identify the plant of the loop. Up to 60 V a component; a start takes it back.
    TestVoltage(crate::Dq),
    /// Rotor time constant, s, as [`online`](crate::online) finds it: what the slip is computed with.
    /// Only with [`track_rotor`](crate::Settings::track_rotor); within
    /// [`LIMITS`](crate::online::LIMITS), and approached by no more than 2 % with each command.
    RotorTimeConstant(f32),
    /// Replace all settings. Only while off or in fault.
    Configure(&'a crate::Coefficients),
}

/// How a command was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Taken {
    /// As it was given.
    AsGiven,
    /// Limited to what the machine can bear: the value that holds now.
    Limited(f32),
}

/// Why a command was refused; nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refused {
    /// The value is not a number or infinite.
    NotFinite,
    /// Not in this state.
    State(crate::State),
    /// This mode is not available.
    ModeNotAvailable(Mode),
    /// The encoder is needed for this mode and the settings name another angle source.
    NeedsEncoder,
    /// The injection is needed as angle source; to learn, with a demodulation that tracks.
    NeedsInjection,
    /// The settings do not want the rotor time constant tracked.
    RotorNotTracked,
    /// A fault is latched; clear it first.
    Fault(crate::Fault),
    /// The value is outside the allowed range.
    OutOfRange {
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite => write!(f, "the value is not a finite number"),
            Self::State(state) => write!(f, "not possible while the drive is {state}"),
            Self::ModeNotAvailable(mode) => write!(f, "mode {mode:?} is not available"),
            Self::NeedsEncoder => write!(f, "this mode needs the encoder as angle source"),
            Self::NeedsInjection => {
                write!(f, "this needs the injection, demodulated by a way that tracks")
            }
            Self::RotorNotTracked => write!(f, "track_rotor is off in the settings"),
            Self::Fault(fault) => write!(f, "fault {} is latched: {fault}", fault.code()),
            Self::OutOfRange { min, max } => {
                let (min, max) = (Shortest(*min), Shortest(*max));
                write!(f, "the value is outside the allowed range {min} to {max}")
            }
        }
    }
}

impl core::error::Error for Refused {}
