//! Commands to the drive, and its answers.

use crate::drive::coefficients::DefaultLoop;
use crate::drive::state::{Mode, State};
use crate::drive::test_signal::TestSignal;
use crate::{Coefficients, Dq, Fault};

/// A command to the drive; see [`Drive::command`](crate::Drive::command) for the refusals.
///
/// Exhaustive on purpose, so that code that checks or names the commands has to handle a new one.
// The large variant is passed by reference and stored only once, in a mailbox.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Command<L = DefaultLoop> {
    /// From off: calibrate the offsets, charge the bootstraps, magnetise, verify the lock if the
    /// angle comes from the injection, then regulate as `Mode` says.
    Start(Mode),
    /// While regulating with the injection, at rest: remove the torque, magnetise again, verify that the
    /// flux is tracked, then continue at zero torque. After a fault, use `Clear` and `Start` instead.
    Relock,
    /// From off: let the next start check the wiring first; see `crate::protect::wiring_check`.
    CheckWiring,
    /// From off: declare that the motor has a brake, which needs this time to close, s; 0 for no brake, the initial value. A start then
    /// proves the torque, and a stop keeps the torque for that time; see `drive/brake.rs`.
    Brake(f32),
    /// From off, or while a motor at rest is tested: apply this test signal. From off the drive first
    /// calibrates the offsets and charges the bootstraps. See `crate::commission`.
    #[serde(skip)]
    Test(TestSignal),
    /// Stop in this way. A drive that neither regulates torque, speed or position nor runs in V/f control stops by
    /// [`Stop::Coast`].
    Stop(Stop),
    /// Clear the latched fault; the drive is off then.
    Clear,
    /// Q-axis current reference, A peak; limited to the limits of the machine.
    Torque(f32),
    /// Speed reference, mechanical rpm; limited to `speed.limit_rpm`.
    Speed(f32),
    /// While the drive regulates the speed: a speed reference as [`Speed`](Self::Speed) that ends by the ramp if the command is
    /// not repeated within 0.5 s. A `Speed` also ends it.
    Jog(f32),
    /// Position reference, mechanical turns from the position at the start or from [`Home`](Self::Home); limited to the
    /// counted range. It ends [`Press`](Self::Press).
    Position(f32),
    /// While the drive regulates the position: turn at this speed instead, mechanical rpm, with at most this q-axis current,
    /// A peak, to find a stop; see [`homing`](crate::homing). The speed is limited to `speed.limit_rpm`.
    Press(f32, f32),
    /// While the drive regulates the position: make this position, mechanical turns, position 0 from now on, and move the
    /// shaft there. With the encoder as angle source this is valid until new settings; without, until the next start.
    Home(f32),
    /// D-axis (magnetising) current reference, A peak.
    Magnetising(f32),
    /// Turn the injection axis by this many electrical degrees away from phi + 90°, to map delta_i
    /// over the angle (Figure 19). Only with the encoder as angle source; a start resets it.
    TurnInjection(f32),
    /// Add this voltage in the flux frame, V, to the output of the current loop from the next period
    /// on, to identify the plant of the loop. Up to 60 V per component; a start resets it.
    TestVoltage(Dq),
    /// Rotor time constant for the slip, s, as `online` estimates it. Only with `track_rotor`; within
    /// [`TAU_R_LIMITS`](crate::flux::indirect::TAU_R_LIMITS), and changed by at most 2 % with each command.
    RotorTimeConstant(f32),
    /// Reading of the motor's temperature sensor, °C, or the fault that the sensor shows; accepted in every state, ten times a
    /// second. Without effect if the settings have no sensor. A fault or a motor that is too hot switches the drive off, and a start
    /// is refused as long as it is present.
    MotorTemperature(Result<f32, Fault>),
    /// Replace all settings. Only while off or in fault.
    #[serde(skip)]
    Configure(Coefficients<L>),
}

/// A way to stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stop {
    /// Reduce the torque to zero by `sequence.stop_a_per_s`, then switch off: the shaft coasts. With any setting, the outputs are off
    /// [`COAST_S`](crate::COAST_S) after the command, or later by the time of the [brake](Command::Brake) if there is one. A drive that
    /// tests a motor at rest switches off at once.
    #[default]
    Coast,
    /// Reduce the speed to zero by `speed.ramp_rpm_per_s`, then stop as by [`Coast`](Self::Coast).
    Ramp,
    /// Stop as by [`Ramp`](Self::Ramp), but by `speed.quick_rpm_per_s`; also possible during a stop by ramp.
    Quick,
    /// Switch off at once in any state. The motor's current decays through the diodes of the inverter.
    Now,
}

/// An accepted command.
///
/// Exhaustive on purpose, so that no answer is overlooked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Accepted {
    /// The value was accepted as given.
    AsGiven,
    /// The value was limited to the range of the machine; this value is valid now.
    Limited(f32),
}

/// The reason of a refusal. A refused command changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refused {
    /// The value is NaN or infinite.
    #[error("the value is not a finite number")]
    NotFinite,
    /// The command is not possible in this state.
    #[error("not possible while the drive is {0}")]
    State(State),
    /// The command needs a shaft at rest.
    #[error("the shaft turns: bring it to rest first")]
    Turning,
    /// This mode needs the encoder, and the settings name another angle source.
    #[error("this mode needs the encoder as angle source")]
    NeedsEncoder,
    /// The command needs the injection as angle source; to learn, with a demodulation that can track.
    #[error("this needs the injection and a demodulation that can track")]
    NeedsInjection,
    /// The tables and the lock monitor are valid for one d-axis current only.
    #[error("the d-axis current cannot change while the lock monitor watches the angle")]
    FluxIsFixed,
    /// The drive has not learned its motor, and `injection.allow_unlearned` is off.
    #[error(
        "nothing is learned of this motor with these settings: lock the shaft and `learn` first"
    )]
    NotLearned,
    /// Rated frequency and speed of the nameplate belong to another number of pole pairs.
    #[error(
        "nameplate.speed_rpm must be 0.85 to 1 times 60 nameplate.frequency_hz/motor.pole_pairs"
    )]
    Nameplate,
    /// The precharge relay is open: the dc link is not charged yet, or too low.
    #[error("the precharge relay is open: the dc link is too low, or not steady yet")]
    NotCharged,
    /// The build is without the block of this mode, see [`blocks`](crate::blocks).
    #[error("this build is without this mode")]
    NotBuilt,
    /// The settings do not want the rotor time constant tracked.
    #[error("track_rotor is off in the settings")]
    RotorNotTracked,
    /// A fault is latched; clear it first.
    #[error("fault {code} is latched: {0}", code = .0.code())]
    Fault(Fault),
    /// This fault is still present.
    #[error("fault {code} is present: {0}", code = .0.code())]
    Stands(Fault),
    /// The value is outside the allowed range.
    #[error("the value is outside the allowed range {min} to {max}")]
    OutOfRange {
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
}
