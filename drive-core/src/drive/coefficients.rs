//! Coefficients of the control step.

#[cfg(test)]
mod tests;

use crate::blocks::Power;
use crate::carrier::Injection;
use crate::carrier::at_start::AtStart;
use crate::current::{DeadTime, DqPi, InverterDrop, Modulator, VoltageLimit};
use crate::flux::{Estimator, FlyingStart, Indirect, Observer, VoltsPerHertz};
use crate::protect::{
    LockMonitor, NoiseWatch, OffsetCheck, Prediction, SaliencyCheck, Thermal, TravelWatch,
    WiringCheck,
};
use crate::{
    Angle, AngleLoop, AngleSource, DcLink, Fault, FrontEnd, Learning, Motion, Relay, UnitVector,
};

/// The loop of a drive that names none: with the feature `printed` a [choice](crate::printed::ComparedLoop) by the settings.
#[cfg(feature = "printed")]
pub type DefaultLoop = crate::printed::ComparedLoop;
/// The loop of a drive that names none: the filter.
#[cfg(not(feature = "printed"))]
pub type DefaultLoop = crate::flux::FilterLoop;

/// Coefficients of the control step, designed outside the interrupt.
// The order matters: the fields that every step uses come first and lie together; see the state of the drive.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct Coefficients<L = DefaultLoop> {
    /// Scales of the sensors and checks of their samples.
    pub front_end: FrontEnd,
    /// Limits that trip.
    pub protection: Protection,
    /// Source of the angle of the frame.
    pub source: AngleSource,
    /// Whether to inject at all.
    pub inject: bool,
    /// Whether to demodulate and, with the injection as angle source, to track.
    pub demodulate: bool,
    /// Whether to accept a rotor time constant while running.
    pub track_rotor: bool,
    /// Current controllers.
    pub current_loop: DqPi,
    /// Modulation of the voltages.
    pub modulator: Modulator,
    /// Compensation of the dead time.
    pub dead_time: DeadTime,
    /// Prediction of the current.
    pub prediction: Prediction,
    /// Flux angle from encoder and slip.
    pub indirect: Indirect,
    /// Electrical turns per period for one mechanical turn/s.
    pub freq_per_speed: f32,
    /// Inverse of `freq_per_speed`.
    pub speed_per_freq: f32,
    /// Delay of the measured current without the filter, samples.
    pub current_lag: f32,
    /// 1 if the delays of the current are compensated, 0 if not.
    pub lag_share: f32,
    /// Times of a start and a stop.
    pub sequence: SequenceSteps,
    /// Estimator of the flux angle from the injection.
    pub estimator: Estimator<L>,
    /// The back-EMF observer, if the angle does not come from the injection alone.
    pub observer: Option<Observer>,
    /// Stator frequency above which the observer gives the angle, electrical turns per period.
    pub observer_leads: f32,
    /// The watch on the noise of the sensors, if the angle comes from the injection.
    pub noise_watch: Option<NoiseWatch>,
    /// The injection.
    pub injection: Injection,
    /// The lock monitor, if it is enabled.
    pub lock_monitor: Option<LockMonitor>,
    /// The flying start, if it is enabled.
    pub flying_start: Option<FlyingStart>,
    /// Limit of the q-axis current by the voltage.
    pub voltage_limit: VoltageLimit,
    /// Limits of the q-axis current by the dc link, and chopper.
    pub dc_link: DcLink,
    /// Speed and position loop.
    pub motion: Motion,
    /// Injection axis relative to the flux, as an angle and a unit vector.
    pub injection_turn: Angle,
    /// Unit vector of `injection_turn`.
    pub injection_axis: UnitVector,
    /// The saliency check of a sensorless start, if it is enabled.
    pub saliency_check: Option<SaliencyCheck>,
    /// The measurement of the offsets of the current sensors.
    pub offsets: OffsetCheck,
    /// The check of the wiring at the first start.
    pub wiring: WiringCheck,
    /// Largest test voltage of an axis, V.
    pub largest_test_v: f32,
    /// The measurement of the inverter voltage error beyond the dead time.
    pub inverter_drop: InverterDrop,
    /// The saliency self-commissioning.
    pub learning: Learning,
    /// Thermal loads of motor and inverter.
    pub thermal: Thermal,
    /// The precharge relay, if there is one.
    pub relay: Option<Relay>,
    /// V/f control, if the pole pairs fit the nameplate.
    pub volts_per_hertz: Option<VoltsPerHertz>,
    /// Whether a start without encoder is refused until the drive has learned.
    pub unlearned: bool,
    /// Temperatures of the motor, °C, at which the torque begins to fall and at which it is zero, if the motor has a sensor.
    pub motor_c: Option<[u8; 2]>,
    /// The watch on sensors whose signal does not change.
    pub travel_watch: TravelWatch,
    /// The measurement of the asymmetry at a start, if the synchronous demodulation tracks.
    pub at_start: Option<AtStart>,
    /// Limits of dc current and power, if there are any.
    pub power: Option<PowerLimit>,
}

impl<L: AngleLoop> Coefficients<L> {
    /// Returns the fault of a motor sensor that has given no reading.
    pub(crate) fn no_motor_reading(&self) -> Option<Fault> {
        self.motor_c.map(|_| Fault::MotorSensorUnread)
    }

    /// Whether the coefficients are finite numbers, which a flipped bit may have changed.
    pub(crate) fn is_finite(&self) -> bool {
        let (s, l) = (&self.front_end, &self.current_loop);
        crate::math::all_finite(&[
            s.current_a.gain,
            s.current_a.offset,
            s.current_b.gain,
            s.current_b.offset,
            s.dc_link.gain,
            s.dc_link.offset,
            l.d.k_c,
            l.d.z_c,
            l.q.k_c,
            l.q.z_c,
            self.injection.current_amplitude,
            self.estimator.lag,
            self.current_lag,
            self.motion.pi.k_c,
            self.motion.speed_limit,
            self.voltage_limit.i_d,
            self.sequence.stop_ramp,
        ])
    }
}

/// Largest dc current, A, and power, W, motoring and generating.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DcLimit {
    /// Current from the link, A.
    pub current_a: f32,
    /// Power from the link, W.
    pub power_w: f32,
}

impl DcLimit {
    /// Limits that are larger than those of any inverter.
    pub const NONE: Self = Self { current_a: 1000.0, power_w: 1e6 };
}

/// Limits of dc current and power.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PowerLimit {
    /// See [`blocks`](crate::blocks).
    pub built: Power,
    /// Limits of current and power from the link into motor and switches.
    pub motoring: DcLimit,
    /// Limits of current and power back into the link.
    pub generating: DcLimit,
}

/// Limits in the units of the control step.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Protection {
    /// Largest phase current, A.
    pub trip_a: f32,
    /// Dc link above which the drive trips, V.
    pub dc_over: f32,
    /// Dc link below which the drive trips, V.
    pub dc_under: f32,
    /// Largest speed of the rotor, electrical turns per period.
    pub rotor_freq: f32,
    /// Largest q-axis current, A.
    pub i_q: f32,
}

/// The sequence in control periods.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SequenceSteps {
    /// Time with the low sides on, which charges the bootstraps.
    pub precharge: u32,
    /// Time of the magnetisation.
    pub magnetise: u32,
    /// Time of the verification of the lock.
    pub verify: u32,
    /// Electrical speed up to which the shaft counts as being at rest, turns per period.
    pub standing_freq: f32,
    /// Electrical speed up to which a free shaft counts as being at rest after the verification of the lock, in which the small
    /// angle error of a healthy drive may push it.
    pub pushed_freq: f32,
    /// Ramp of the q-axis current at a stop, A per period.
    pub stop_ramp: f32,
}
