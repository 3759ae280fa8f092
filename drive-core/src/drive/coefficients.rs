//! The coefficients of the control step.

#[cfg(test)]
mod tests;

use crate::carrier::Injection;
use crate::carrier::at_start::AtStart;
use crate::current::{DeadTime, DqPi, InverterDrop, Modulator, VoltageLimit};
use crate::flux::{Estimator, Indirect, Observer, Path, VoltsPerHertz};
use crate::protect::{
    LockMonitor, NoiseWatch, OffsetCheck, Prediction, SaliencyCheck, Thermal, TravelWatch,
    WiringCheck,
};
use crate::{Angle, AngleSource, DcLink, Fault, FrontEnd, Learning, Motion, Relay, UnitVector};

/// The coefficients of the control step, designed outside the interrupt.
// In this order: the fields of every step come first and lie together; see the state of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Coefficients {
    /// Scales of the sensors and checks of their samples.
    pub front_end: FrontEnd,
    /// Limits that trip.
    pub protection: Protection,
    /// Source of the angle of the frame.
    pub source: AngleSource,
    /// Inject a carrier at all.
    pub inject: bool,
    /// Demodulate and, with the injection as source, track.
    pub demodulate: bool,
    /// Take a rotor time constant while running.
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
    /// Its inverse.
    pub speed_per_freq: f32,
    /// Delay of the measured current beside the filter, samples.
    pub current_lag: f32,
    /// 1 where the delays of the current are compensated, 0 where not.
    pub lag_share: f32,
    /// Times of a start and a stop.
    pub sequence: SequenceSteps,
    /// Estimator of the flux angle from the carrier.
    pub estimator: Estimator,
    /// The observer, where the angle is not the injection's alone.
    pub observer: Option<Observer>,
    /// The watch on the sensors' noise, where the angle is the injection's.
    pub noise_watch: Option<NoiseWatch>,
    /// The carrier.
    pub injection: Injection,
    /// The watch on the lock, if it is wanted.
    pub lock_monitor: Option<LockMonitor>,
    /// The start on a turning shaft, if it is wanted.
    pub flying_start: Option<FlyingStart>,
    /// Limit of the torque current by the voltage.
    pub voltage_limit: VoltageLimit,
    /// Limits of the torque current by the dc link, and chopper.
    pub dc_link: DcLink,
    /// Speed and position loop.
    pub motion: Motion,
    /// Injection axis seen from the flux, as an angle and a unit vector.
    pub injection_turn: Angle,
    /// See `injection_turn`.
    pub injection_axis: UnitVector,
    /// The check of a sensorless start, if it is wanted.
    pub saliency_check: Option<SaliencyCheck>,
    /// The measurement of the offsets of the current sensors.
    pub offsets: OffsetCheck,
    /// The check of the wiring at the first start.
    pub wiring: WiringCheck,
    /// Largest test voltage of an axis, V.
    pub largest_test_v: f32,
    /// The measurement of the voltage that the inverter drops beyond its dead time.
    pub inverter_drop: InverterDrop,
    /// The learning.
    pub learning: Learning,
    /// Thermal loads of motor and inverter.
    pub thermal: Thermal,
    /// The precharge relay, if there is one.
    pub relay: Option<Relay>,
    /// The mode without identification, where the pairs of poles fit the nameplate.
    pub volts_per_hertz: Option<VoltsPerHertz>,
    /// Whether a start without encoder is refused until the drive has learned.
    pub unlearned: bool,
    /// Temperatures of the motor, °C, from which on the torque falls and at which there is none, where it has a sensor.
    pub motor_c: Option<[u8; 2]>,
    /// The watch on sensors that stand still.
    pub travel_watch: TravelWatch,
    /// The measurement of the asymmetry at a start, where the synchronous demodulation tracks.
    pub at_start: Option<AtStart>,
    /// Limits of dc current and power.
    pub power: PowerLimit,
}

impl Coefficients {
    /// The fault of a motor sensor of which no reading has come.
    pub(crate) fn no_motor_reading(&self) -> Option<Fault> {
        self.motor_c.map(|_| Fault::MotorSensorUnread)
    }

    /// Whether the coefficients are still finite numbers; a flipped bit may have changed that.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLimit {
    /// Current from the link, A.
    pub current_a: f32,
    /// Power from it, W.
    pub power_w: f32,
}

impl DcLimit {
    /// More than any inverter has.
    pub const NONE: Self = Self { current_a: 1000.0, power_w: 1e6 };
}

/// Limits of dc current and power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLimit {
    /// Of what motor and switches take from the link.
    pub motoring: DcLimit,
    /// Of what they give back.
    pub generating: DcLimit,
}

impl PowerLimit {
    /// None.
    pub const NONE: Self = Self { motoring: DcLimit::NONE, generating: DcLimit::NONE };
}

/// Limits in the units of the control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protection {
    /// Largest phase current, A.
    pub trip_a: f32,
    /// Dc link above which the drive trips, V.
    pub dc_over: f32,
    /// Dc link below which it trips, V.
    pub dc_under: f32,
    /// Largest speed of the rotor, electrical turns per period.
    pub rotor_freq: f32,
    /// Largest torque current, A.
    pub i_q: f32,
}

/// The sequence in control periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceSteps {
    /// Time with the low sides on, which charges the bootstraps.
    pub precharge: u32,
    /// Magnetisation.
    pub magnetise: u32,
    /// Verification of the lock.
    pub verify: u32,
    /// Electrical speed up to which the shaft counts as standing, turns per period.
    pub standing_freq: f32,
    /// The same of a free shaft that the small angle error of a healthy drive has pushed while the lock was verified.
    pub pushed_freq: f32,
    /// A per period.
    pub stop_ramp: f32,
}

/// Coefficients of a start on a turning shaft, control periods and A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlyingStart {
    /// Direct current that the rotor is looked for with, A.
    pub current: f32,
    /// Periods in which the injection alone corrects the angle.
    pub injection_only: u32,
    /// Periods in which the flux builds up.
    pub build_up: u32,
    /// Periods after which no flux is left in a motor that was switched off.
    pub flux_decay: u32,
    /// Model that the search subtracts from the voltage.
    pub path: Path,
    /// Largest voltage of flux that was left, V.
    pub residual_v: f32,
    /// Decay of that flux per period.
    pub decay: f32,
}

impl FlyingStart {
    /// Share of `current` that is enough where flux was left: the flux drives a current of its own.
    pub const WITH_FLUX: f32 = 0.4;
}
