//! V/f control, without a model of the motor; see [`volts_per_hertz`](crate::flux::volts_per_hertz).

use super::{CarryOver, Common, End, Telemetry};
use crate::blocks::Vf;
use crate::dc_link::DIVIDER;
use crate::drive::state::State;
use crate::flux::volts_per_hertz::{Demand, VoltsPerHertzState};
use crate::{Abc, AngleLoop, Coefficients, Fault, Limiting, Measured, PERIOD_S};

/// Frequency below which a motor that stops is switched off, turns per period.
const STANDS: f32 = 0.2 * PERIOD_S;

/// A drive in V/f control.
#[derive(Clone, Debug)]
pub(super) struct Scalar {
    _built: Vf,
    turning: VoltsPerHertzState,
    /// Speed reference, mechanical turns/s.
    pub speed: f32,
    /// Present while the drive stops: whether by the ramp of a quick stop.
    pub stop: Option<bool>,
    pub carried: CarryOver,
}

impl Scalar {
    pub fn new(built: Vf, speed: f32, carried: CarryOver) -> Self {
        Self { _built: built, turning: VoltsPerHertzState::default(), speed, stop: None, carried }
    }

    pub fn state(&self) -> State {
        if self.stop.is_some() { State::BrakingByFrequency } else { State::VoltsPerHertz }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Runs one period of V/f control. All protections of a sample are active, over-speed (by the frequency) and the thermal loads.
    ///
    /// # Errors
    /// The reason why the outputs are switched off.
    #[cold]
    pub(super) fn step_scalar(
        &self,
        scalar: &mut Scalar,
        k: &mut Common,
        measured: &Measured,
    ) -> Result<[f32; 3], End> {
        let (s, current) = (&mut scalar.turning, measured.current());
        let Some(turning) = &self.volts_per_hertz else { return Err(End::Stopped) };
        let rotor_freq = s.rotor_freq;
        let stops = scalar.stop.is_some();
        if stops && rotor_freq.abs() < STANDS {
            return Err(End::Stopped);
        }
        let freq = if stops { 0.0 } else { self.freq_per_speed * scalar.speed };
        if k.elapsed.is_multiple_of(u32::from(DIVIDER)) {
            let by_voltage = (f32::INFINITY, Limiting::None);
            self.limit_by_dc_link(&mut k.limits, measured.dc_link, rotor_freq, by_voltage);
            // The voltage of V/f control contains the inverter voltage error.
            self.limit_power(k, k.seen.current.d, 0.0);
            if rotor_freq.abs() > self.protection.rotor_freq {
                return Err(Fault::OverSpeed.into());
            }
        }
        let largest_v = self.modulator.circle(measured.dc_link);
        let quick = scalar.stop == Some(true);
        let demand = Demand { freq, quick, i_q: k.limits.now.i_q, largest_v };
        let turned = turning.step(s, current, &demand)?;
        if !(turned.voltage.d + turned.voltage.q + s.freq).is_finite() {
            let fault = self.not_finite(k, scalar.speed.is_finite());
            return Err(fault.unwrap_or(Fault::NonFiniteState).into());
        }
        let voltage = turned.voltage.to_alpha_beta(turned.applied);
        let flowing = turned.current.to_alpha_beta(turned.applied);
        let signs = self.dead_time.signs(flowing.to_abc(), Abc::ZERO);
        let compensation = self.dead_time.voltage(signs, measured.dc_link, 0.0);
        let modulated = self.modulator.step(voltage, compensation, measured.dc_link);

        k.limits.clamp_torque(turned.current.q);
        if k.limits.why == Limiting::None && s.by_voltage {
            k.limits.why = Limiting::Voltage;
        }
        k.seen = Telemetry {
            phi: turned.angle,
            flux_freq: s.freq,
            rotor_freq: s.rotor_freq,
            current: turned.current,
            voltage: turned.voltage,
            measured: current,
            realised: modulated.realised,
            dc_link: measured.dc_link,
            ..k.seen
        };
        Ok(modulated.duties)
    }
}
