//! The chain of limits of the q-axis current, with the reason of the active limit.

use super::{Common, Drive, Phase};
use crate::current::voltage_limit::VoltageLimitState;
use crate::dc_link::{DcLinkLimits, DcLinkState, Limiting};
use crate::drive::coefficients::Coefficients;
use crate::protect::thermal::Thermal;
use crate::{AngleLoop, Fault, Measured};

/// Limits of the q-axis current. The heat of the brake resistor outlives a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub dc_link: DcLinkState,
    pub voltage: VoltageLimitState,
    /// Power that the model of the power limit does not explain, over 3/2, W.
    pub power_error: f32,
    /// Present limits, from dc link, voltage and heat together.
    pub now: DcLinkLimits,
    /// Reason why the q-axis current is smaller than commanded.
    pub why: Limiting,
    /// Reduction of the largest q-axis current by the temperature of heat sink, motor or inverter, A, and its reason.
    pub thermal_reduction_a: f32,
    pub thermal_reason: Limiting,
    /// Reduction of the squared current by the temperature sensor of the motor, in 1/255.
    pub motor_hot: u8,
    /// Fault of that sensor that prevents a start.
    pub motor_fault: Option<Fault>,
}

impl Limits {
    /// Returns the q-axis current within the limits, A.
    pub fn clamp_torque(&mut self, i_q: f32) -> f32 {
        let (held, why) = self.now.clamp(i_q);
        self.why = why;
        held
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Resets the limits at a start.
    pub(super) fn start_limits(&self, limits: &mut Limits) {
        let voltage = self.voltage_limit.start();
        (limits.voltage, limits.power_error) = (voltage, 0.0);
        (limits.now, limits.why) = Default::default();
        limits.now.i_q = (-voltage.most.q, voltage.most.q);
    }

    /// Updates the limits by the dc link, V, and the speed of the rotor, electrical turns per period, of an injection
    /// period, with the limit by the voltage, A.
    pub(super) fn limit_by_dc_link(
        &self,
        limits: &mut Limits,
        dc_link: f32,
        rotor_freq: f32,
        (by_voltage, why): (f32, Limiting),
    ) {
        let hot = self.protection.i_q - limits.thermal_reduction_a;
        let most = if hot < by_voltage { (hot, limits.thermal_reason) } else { (by_voltage, why) };
        limits.now = self.dc_link.step(&mut limits.dc_link, dc_link, rotor_freq, most);
    }

    /// Narrows the limits by dc current and power; see [`PowerLimit::step`](crate::PowerLimit::step).
    #[inline(never)] // inlined, 32 bytes more of control code
    pub(super) fn limit_power(&self, k: &mut Common, magnetising: f32, drop: f32) {
        if let Some(power) = &self.power {
            let Limits { power_error, now, .. } = &mut k.limits;
            power.step(self, power_error, now, &k.seen, (magnetising, drop));
        }
    }

    /// Adds the current of the last [`Thermal::EVERY`] periods to the thermal loads, and computes the thermal reduction of
    /// the q-axis current, in every state. `is_energised`: whether a current is driven.
    ///
    /// # Errors
    /// The fault of a load that is too high. While the drive is off, motor and inverter cool and are not judged.
    pub(super) fn load(
        &self,
        k: &mut Common,
        measured: &Measured,
        is_energised: bool,
    ) -> Result<(), Fault> {
        let square = if is_energised { k.seen.current.length_squared() } else { 0.0 };
        let borne = self.thermal.step(&mut k.thermal, square);
        self.judge_heat(k, measured);
        if is_energised {
            borne
        } else {
            self.dc_link.rest(&mut k.limits.dc_link, Thermal::EVERY);
            Ok(())
        }
    }

    /// Computes the reduction of the q-axis current by the temperature of heat sink, motor and inverter.
    #[cold] // in the flash: once in sixty periods
    fn judge_heat(&self, k: &mut Common, measured: &Measured) {
        let Common { limits, thermal, references, .. } = k;
        let heat_sink = measured.heat_sink.clamp(0.0, 1.0);
        let (heat_sink, loads) = ((heat_sink * heat_sink, Limiting::HeatSink), thermal.share());
        let sensor = (1.0 - f32::from(limits.motor_hot) * (1.0 / 255.0), Limiting::Motor);
        let loads = if sensor.0 < loads.0 { sensor } else { loads };
        let (share, why) = if loads.0 < heat_sink.0 { loads } else { heat_sink };
        (limits.thermal_reduction_a, limits.thermal_reason) = if share < 1.0 {
            let (largest, i_d) = (self.protection.i_q, references.current.d);
            let square = share * largest * largest - i_d * i_d;
            (largest - if square > 0.0 { fpu_sqrt::sqrtf(square) } else { 0.0 }, why)
        } else {
            (0.0, Limiting::None)
        };
    }
}

impl<L: AngleLoop> Drive<L> {
    /// Whether the dc link is charged: if there is a precharge relay, it has closed.
    pub(super) fn is_charged(&self) -> bool {
        self.c.relay.is_none() || self.kept.relay.closed
    }

    /// Processes a reading of the motor's temperature sensor. The squared current falls from the first temperature to zero at the
    /// second.
    #[cold]
    pub(super) fn take_motor_temperature(&mut self, reading: Result<f32, Fault>) {
        let Some([from, trip]) = self.c.motor_c.map(|c| c.map(f32::from)) else { return };
        let limits = &mut self.kept.limits;
        // A conversion of NaN is 0, but NaN is not below the trip.
        let hot = |celsius: f32| (255.0 / (trip - from) * (celsius - from)) as u8;
        limits.motor_hot = reading.map_or(255, hot);
        let judged = reading.and_then(|celsius| Fault::MotorHot.unless(celsius < trip));
        limits.motor_fault = judged.err();
        if let (Err(fault), false) = (judged, self.is_off()) {
            self.end(fault.into());
        }
    }

    /// Returns the reason why the torque is smaller than commanded.
    pub fn limiting(&self) -> Limiting {
        match &self.phase {
            Phase::Field(field) if field.has_torque() => self.kept.limits.why,
            Phase::Scalar(_) => self.kept.limits.why,
            Phase::Field(_) | Phase::Off(_) | Phase::Fault(..) => Limiting::None,
            Phase::Prepare(_) | Phase::Test(_) => Limiting::None,
        }
    }
}
