//! Running by voltage and frequency, without a model of the motor: see [`volts_per_hertz`](crate::flux::volts_per_hertz).

use core::f32::consts::TAU;

use super::Drive;
use crate::current::sensing::Measured;
use crate::dc_link::{DIVIDER, Limiting};
use crate::drive::state::State;
use crate::fault::Fault;
use crate::flux::volts_per_hertz::{Demand, VoltsPerHertz, VoltsPerHertzSettings};
use crate::io::{Compare, PERIOD_S};
use crate::settings::Settings;
use crate::settings::rules::PEAK_OF_PHASE;

/// Frequency below which a motor that stops is switched off, turns per period.
const STANDS: f32 = 0.2 * PERIOD_S;

/// Voltage that the inverter loses at most, with 311 V.
const LOST_V: f32 = 15.0;
/// Largest rated slip that is believed.
const LARGEST_SLIP: f32 = 0.15;

impl Settings {
    /// The mode without identification, where the pairs of poles fit the nameplate.
    pub(crate) fn volts_per_hertz(&self) -> Option<VoltsPerHertz> {
        let plate = &self.nameplate;
        let pole_pairs = f32::from(self.motor.pole_pairs);
        let slip_hz = plate.frequency_hz - plate.speed_rpm / 60.0 * pole_pairs;
        let fits = slip_hz > 0.0 && slip_hz < LARGEST_SLIP * plate.frequency_hz;
        fits.then(|| {
            VoltsPerHertz::new(&VoltsPerHertzSettings {
                volts_per_hz: PEAK_OF_PHASE * self.volts_per_hz(),
                rated_volts_per_hz: PEAK_OF_PHASE * plate.voltage_v / plate.frequency_hz,
                frequency_hz: plate.frequency_hz,
                slip_hz,
                torque_nm: plate.power_w / (TAU * plate.speed_rpm / 60.0),
                pole_pairs,
                rated_a: self.rated_a(),
                limit_a: self.current_limit_a(),
                boost_a: self.boost_a(),
                impedance: plate.base_impedance(),
                lost_v: self.share_of_dc_link(LOST_V),
                ramp_hz_per_s: self.ramp_rpm_per_s() / 60.0 * pole_pairs,
                quick_hz_per_s: self.quick_rpm_per_s() / 60.0 * pole_pairs,
                slip_share: self.vf.slip_share,
            })
        })
    }
}

impl Drive {
    /// One period. All protections of a sample act, over-speed by the frequency, and the thermal loads.
    ///
    /// # Errors
    /// The state to go to with the outputs off.
    #[cold]
    pub(super) fn turn_by_voltage(&mut self, measured: &Measured) -> Result<Compare, State> {
        let (c, s) = (&self.c, &mut self.control);
        let Some(turning) = &c.volts_per_hertz else { return Err(State::Off) };
        let rotor_freq = s.turning.rotor_freq();
        let stops = self.state == State::BrakingByFrequency;
        if stops && rotor_freq.abs() < STANDS {
            return Err(State::Off);
        }
        let freq = if stops { 0.0 } else { c.freq_per_speed * s.references.speed };
        if self.elapsed.is_multiple_of(u32::from(DIVIDER)) {
            let most = (c.protection.i_q - s.too_hot_for, s.too_hot);
            s.limits = c.dc_link.step(&mut s.dc_link, measured.dc_link, rotor_freq, most);
            if rotor_freq.abs() > c.protection.rotor_freq {
                return Err(Fault::OverSpeed.into());
            }
        }
        let largest_v = c.modulator.circle(measured.dc_link);
        let demand = Demand { freq, quick: s.quick_stop, i_q: s.limits.i_q, largest_v };
        let turned = turning.step(&mut s.turning, measured.current, &demand)?;
        if !(turned.voltage.d + turned.voltage.q + s.turning.freq).is_finite() {
            return Err(self.not_finite().unwrap_or(Fault::NonFiniteState).into());
        }
        let voltage = turned.voltage.to_alpha_beta(turned.applied);
        let flowing = turned.current.to_alpha_beta(turned.applied);
        let signs = c.dead_time.signs(flowing.to_abc());
        let compensation = c.dead_time.voltage(signs, measured.dc_link, 0.0);
        let modulated = c.modulator.step(voltage, compensation, measured.dc_link);

        let (_, why) = s.limits.hold(turned.current.q);
        s.limiting = match why {
            Limiting::No if s.turning.by_voltage => Limiting::Voltage,
            why => why,
        };
        let seen = &mut s.seen;
        (seen.phi, seen.flux_freq) = (turned.angle, s.turning.freq);
        (seen.current, seen.voltage) = (turned.current, turned.voltage);
        (seen.measured, seen.realised) = (measured.current, modulated.realised);
        seen.dc_link = measured.dc_link;
        Ok(Compare::on(modulated.compare))
    }
}
