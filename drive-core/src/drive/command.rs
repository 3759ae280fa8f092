//! The commands to the drive, and its answers.

use crate::drive::state::{Mode, State};
use crate::drive::test_signal::TestSignal;
use crate::{Coefficients, Dq, Fault};

/// A command to the drive; see [`Drive::command`](crate::Drive::command) for the refusals.
///
/// Exhaustive on purpose: who checks or names commands has to handle a new one.
// The large variant is passed by reference and kept once, in a mailbox.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Command {
    /// From off: calibrate the offsets, charge the bootstraps, magnetise, verify the lock where the
    /// angle comes from the injection, then regulate as `Mode` says.
    Start(Mode),
    /// While regulating with the injection, at rest: no torque, magnetise again, verify that the flux is
    /// tracked, then go on at zero torque. After a fault the same is done by a clear and a start.
    Relock,
    /// From off: the next start checks the wiring first; see `crate::protect::wiring_check`.
    CheckWiring,
    /// From off: the motor has a brake, which needs this time to close, s; 0: none, as at the beginning. A start then proves the torque,
    /// and a stop keeps it for that time; see `drive/brake.rs`.
    Brake(f32),
    /// From off, or while a motor at rest is tested: this test signal. From off the drive calibrates the
    /// offsets and charges the bootstraps first. See `crate::commission`.
    #[cfg_attr(feature = "serde", serde(skip))]
    Test(TestSignal),
    /// Stop in this way. A drive that neither regulates torque, speed or position nor turns by voltage and frequency does it by
    /// [`Stop::Coast`].
    Stop(Stop),
    /// Forget the latched fault and be off.
    Clear,
    /// Reference of the quadrature-axis current, A peak; limited to the machine's limits.
    Torque(f32),
    /// Reference of the speed, mechanical rpm; limited to `speed.limit_rpm`.
    Speed(f32),
    /// A speed as [`Speed`](Self::Speed), while the drive regulates the speed, that ends by the ramp when it is not given again
    /// within 0.5 s; a `Speed` ends it as well.
    Jog(f32),
    /// Reference of the position, mechanical turns from where the drive was started, or from [`Home`](Self::Home); limited
    /// to the counted range. It ends [`Press`](Self::Press).
    Position(f32),
    /// While the drive regulates the position: turn at this speed, mechanical rpm, with at most this torque current, A peak,
    /// instead, to find a stop; see [`homing`](crate::homing). The speed is limited to `speed.limit_rpm`.
    Press(f32, f32),
    /// While the drive regulates the position: this position, mechanical turns, is 0 from now on, and the shaft goes there.
    /// With the encoder as angle source this holds until new settings; without, until the next start.
    Home(f32),
    /// Reference of the direct-axis (magnetising) current, A peak.
    Magnetising(f32),
    /// Turn the injection axis by this many electrical degrees away from phi + 90°, to map delta_i
    /// over the angle (Figure 19). Only with the encoder as angle source; a start takes it back.
    TurnInjection(f32),
    /// A voltage in the flux frame, V, added to that of the current loop from the next period on: to
    /// identify the plant of the loop. Up to 60 V a component; a start takes it back.
    TestVoltage(Dq),
    /// Rotor time constant that the slip is computed with, s, as `online` finds it.
    /// Only with `track_rotor`; within
    /// [`TAU_R_LIMITS`](crate::flux::indirect::TAU_R_LIMITS), and approached by no more than 2 % with each command.
    RotorTimeConstant(f32),
    /// Reading of the motor's temperature sensor, °C, or the fault that it shows; in every state, ten times a second. Without effect
    /// where the settings have no sensor. A fault, or a motor that is too hot, switches off; a start is refused while it stands.
    MotorTemperature(Result<f32, Fault>),
    /// Replace all settings. Only while off or in fault.
    #[cfg_attr(feature = "serde", serde(skip))]
    Configure(Coefficients),
}

/// A way to stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stop {
    /// Take the torque to zero by `sequence.stop_a_per_s`, then switch off: the shaft coasts. Whatever is set, the outputs are off
    /// [`COAST_S`](crate::COAST_S) after the command, and later by the time of the [brake](Command::Brake) if there is one. While the motor
    /// at rest is tested, switch off at once.
    #[default]
    Coast,
    /// Take the speed to zero by `speed.ramp_rpm_per_s`, then as [`Coast`](Self::Coast).
    Ramp,
    /// The same by `speed.quick_rpm_per_s`, also during a stop by ramp.
    Quick,
    /// Switch off at once, whatever the drive does: the motor's current decays through the diodes of the inverter.
    Now,
}

/// An accepted command.
///
/// Exhaustive on purpose: an answer that is overlooked would be taken for another.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Accepted {
    /// As it was given.
    AsGiven,
    /// Limited to the range of the machine; the value that holds now.
    Limited(f32),
}

/// The reason of a refusal. A refused command changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refused {
    /// The value is not a number or infinite.
    #[error("the value is not a finite number")]
    NotFinite,
    /// Not in this state.
    #[error("not possible while the drive is {0}")]
    State(State),
    /// Only while the shaft stands.
    #[error("the shaft turns: bring it to rest first")]
    Turning,
    /// The encoder is needed for this mode and the settings name another angle source.
    #[error("this mode needs the encoder as angle source")]
    NeedsEncoder,
    /// The injection is needed as angle source; to learn, with a demodulation that tracks.
    #[error("this needs the injection, demodulated by a way that tracks")]
    NeedsInjection,
    /// The direct current is the one that tables and lock monitor are for.
    #[error("the direct current cannot change while the lock monitor watches the angle")]
    FluxIsFixed,
    /// The drive has not learned its motor, and `injection.allow_unlearned` is off.
    #[error(
        "nothing is learned of this motor with these settings: lock the shaft and `learn` first"
    )]
    NotLearned,
    /// Rated frequency and speed of the nameplate are those of other pairs of poles.
    #[error(
        "nameplate.speed_rpm must be 0.85 to 1 times 60 nameplate.frequency_hz/motor.pole_pairs"
    )]
    Nameplate,
    /// The precharge relay is open: the dc link is not charged yet, or too low.
    #[error("the precharge relay is open: the dc link is too low, or not steady yet")]
    NotCharged,
    /// The settings do not want the rotor time constant tracked.
    #[error("track_rotor is off in the settings")]
    RotorNotTracked,
    /// A fault is latched; clear it first.
    #[error("fault {code} is latched: {0}", code = .0.code())]
    Fault(Fault),
    /// This fault stands.
    #[error("fault {code} stands: {0}", code = .0.code())]
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
