//! V/f control, without a model of the motor; see [`volts_per_hertz`](crate::flux::volts_per_hertz).

use super::{CarryOver, Common, End, Telemetry};
use crate::dc_link::DIVIDER;
use crate::drive::state::State;
use crate::flux::volts_per_hertz::{Demand, VoltsPerHertzState};
use crate::{Abc, Coefficients, Fault, Limiting, Measured, PERIOD_S};

/// Frequency below which a motor that stops is switched off, turns per period.
const STANDS: f32 = 0.2 * PERIOD_S;

/// A drive in V/f control.
#[derive(Clone, Debug)]
pub(super) struct Scalar {
    turning: VoltsPerHertzState,
    /// Speed reference, mechanical turns/s.
    pub speed: f32,
    /// Present while the drive stops: whether by the ramp of a quick stop.
    pub stop: Option<bool>,
    pub carried: CarryOver,
}

impl Scalar {
    pub fn new(speed: f32, carried: CarryOver) -> Self {
        Self { turning: VoltsPerHertzState::default(), speed, stop: None, carried }
    }

    pub fn state(&self) -> State {
        if self.stop.is_some() { State::BrakingByFrequency } else { State::VoltsPerHertz }
    }

    /// Runs one period. All protections of a sample are active, over-speed (by the frequency) and the thermal loads.
    ///
    /// # Errors
    /// The reason why the outputs are switched off.
    #[cold]
    pub fn step(
        &mut self,
        c: &Coefficients,
        k: &mut Common,
        measured: &Measured,
    ) -> Result<[f32; 3], End> {
        let (s, current) = (&mut self.turning, measured.current());
        let Some(turning) = &c.volts_per_hertz else { return Err(End::Stopped) };
        let rotor_freq = s.rotor_freq;
        let stops = self.stop.is_some();
        if stops && rotor_freq.abs() < STANDS {
            return Err(End::Stopped);
        }
        let freq = if stops { 0.0 } else { c.freq_per_speed * self.speed };
        if k.elapsed.is_multiple_of(u32::from(DIVIDER)) {
            let by_voltage = (f32::INFINITY, Limiting::None);
            k.limits.step(c, measured.dc_link, rotor_freq, by_voltage);
            // The voltage of V/f control contains the inverter voltage error.
            k.limit_power(c, k.seen.current.d, 0.0);
            if rotor_freq.abs() > c.protection.rotor_freq {
                return Err(Fault::OverSpeed.into());
            }
        }
        let largest_v = c.modulator.circle(measured.dc_link);
        let quick = self.stop == Some(true);
        let demand = Demand { freq, quick, i_q: k.limits.now.i_q, largest_v };
        let turned = turning.step(s, current, &demand)?;
        if !(turned.voltage.d + turned.voltage.q + s.freq).is_finite() {
            let fault = k.not_finite(c, self.speed.is_finite());
            return Err(fault.unwrap_or(Fault::NonFiniteState).into());
        }
        let voltage = turned.voltage.to_alpha_beta(turned.applied);
        let flowing = turned.current.to_alpha_beta(turned.applied);
        let signs = c.dead_time.signs(flowing.to_abc(), Abc::ZERO);
        let compensation = c.dead_time.voltage(signs, measured.dc_link, 0.0);
        let modulated = c.modulator.step(voltage, compensation, measured.dc_link);

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
