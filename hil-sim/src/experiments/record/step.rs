//! How fast the torque follows a step, and what takes the time.

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::current::DIRECT_SHARE;
use drive_core::filter::{LPF, LpfState};
use drive_core::io::PERIOD_S;
use drive_core::{AlphaBeta, Command, FirstOrder};
use drive_settings::tuning::{CurrentLoopDesign, EquivalentCircuit, motor_plant};

use crate::config::{Config, built};
use crate::error::Error;
use crate::rig::{RATE_HZ, Rig};

/// Time that is recorded after the step, s, and the part at its end that gives the final value.
const RECORDED_S: f64 = 0.06;
const FINAL_S: f64 = 0.02;

/// A quantity after a step of the torque reference from zero, one value per control period, the first at the command.
pub struct Response(pub Vec<f64>);

impl Response {
    /// The final value: the mean of the last 20 ms.
    pub fn end(&self) -> f64 {
        let last = &self.0[self.0.len() - (FINAL_S * RATE_HZ) as usize..];
        last.iter().sum::<f64>() / last.len() as f64
    }

    /// Time from the command until this share of the final value is reached, ms; straight between two samples.
    pub fn time_ms(&self, share: f64) -> f64 {
        let wanted = share * self.end();
        let reached = self.0.iter().position(|value| value / wanted >= 1.0);
        let k = reached.unwrap_or(self.0.len());
        let part = match (k.checked_sub(1).map(|k| self.0[k]), self.0.get(k)) {
            (Some(before), Some(now)) => (wanted - before) / (now - before) - 1.0,
            _ => 0.0,
        };
        1e3 * (k as f64 + part) / RATE_HZ
    }

    /// Time from the command until it stays within 2 % of the final value, ms.
    pub fn settled_ms(&self) -> f64 {
        let end = self.end();
        let last = self.0.iter().rposition(|value| (value / end - 1.0).abs() > 0.02);
        1e3 * last.map_or(0, |k| k + 1) as f64 / RATE_HZ
    }

    /// How far it goes beyond its final value, in relation to that.
    pub fn overshoot(&self) -> f64 {
        self.0.iter().map(|value| value / self.end() - 1.0).fold(0.0, f64::max)
    }
}

/// What a step of the torque reference from zero does on a drive that regulates no torque: torque of the motor, Nm, and the
/// filtered reference, A. Means over steps at all ten samples of a carrier period, in which the carrier cancels.
///
/// # Errors
/// [`Error::Refused`] when the drive refuses the command or stops.
pub fn measured(rig: &Rig, i_q: f64) -> Result<[Response; 2], Error> {
    let periods = (RECORDED_S * RATE_HZ) as usize;
    let mut sums = [vec![0.0; periods], vec![0.0; periods]];
    for wait in 0..CARRIER_SAMPLES {
        let mut rig = rig.clone();
        rig.run(wait as f64 / RATE_HZ, |_| {});
        rig.command(&Command::Torque(i_q as f32))?;
        let mut k = 0;
        rig.run(RECORDED_S, |point| {
            sums[0][k] += point.torque / CARRIER_SAMPLES as f64;
            sums[1][k] += point.iq_ref / CARRIER_SAMPLES as f64;
            k += 1;
        });
        if let Some(fault) = rig.fault() {
            return Err(Error::Refused(format!("the drive stops at a torque step: {fault}")));
        }
    }
    Ok(sums.map(Response))
}

/// The linear loop of the torque current: reference filter, PI, one period of delay, plant, low-pass filter.
#[derive(Clone, Copy)]
pub struct CurrentLoop {
    design: CurrentLoopDesign,
    plant: FirstOrder,
    /// Which parts are there: reference filter, low-pass filter, delay.
    parts: [bool; 4],
}

/// The parts of [`CurrentLoop`] that may be left out, in words.
pub const PARTS: [&str; 4] =
    ["reference filter", "direct share of the reference", "low-pass filter", "delay of a period"];

impl CurrentLoop {
    /// That of the configuration.
    ///
    /// # Errors
    /// [`Error::Refused`] when the drive or the motor is refused.
    pub fn new(config: &Config) -> Result<Self, Error> {
        let m = &config.motor;
        let circuit =
            EquivalentCircuit { r_s: m.r_s, r_r: m.r_r, l_m: m.l_m, l_ls: m.l_ls, l_lr: m.l_lr };
        let plant = motor_plant(&circuit, f64::from(PERIOD_S)).map_err(Error::refused)?;
        built(&config.drive)?;
        let design = config.drive.current_loops().map_err(Error::refused)?[1];
        Ok(Self { design, plant, parts: [true; 4] })
    }

    /// The same without one of its parts, and with the same controller.
    pub fn without(mut self, part: usize) -> Self {
        self.parts[part] = false;
        self
    }

    /// The current after a unit step.
    pub fn response(&self) -> Response {
        let (design, [filters, direct, low_passes, delays]) = (&self.design, self.parts);
        let mut low_pass = LpfState::default();
        let (mut filtered, mut current, mut voltage) = (0.0, 0.0, 0.0);
        let (mut error, mut acting) = (0.0, 0.0);
        let periods = 0..(RECORDED_S * RATE_HZ) as usize;
        let one = |_| {
            let seen = current;
            let share = if direct { f64::from(DIRECT_SHARE) } else { 0.0 };
            let reference = if filters { share + (1.0 - share) * filtered } else { 1.0 };
            filtered += (1.0 - design.z_c) * (1.0 - filtered);
            let measured = match low_passes {
                true => LPF.step(&mut low_pass, AlphaBeta::new(current as f32, 0.0)).alpha.into(),
                false => current,
            };
            let now = reference - measured;
            voltage += design.k_c * (now - design.z_c * error);
            error = now;
            let applied = if delays { acting } else { voltage };
            current = self.plant.p * current + self.plant.k * applied;
            acting = voltage;
            seen
        };
        Response(periods.map(one).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 - exp(-t/T) reaches 90 % at 2.3026 T; a decaying oscillation about 1 overshoots by its first half wave.
    #[test]
    fn times_and_overshoot_of_known_responses() {
        let of =
            |f: fn(f64) -> f64| Response((0..360).map(|k| f(f64::from(k) / RATE_HZ)).collect());
        let lag = of(|t| -2.0 * (1.0 - (-t / 0.003).exp()));
        assert!((lag.time_ms(0.9) - 6.908).abs() < 0.02, "{}", lag.time_ms(0.9));
        // To 2 %: 50 to the natural logarithm, 3.912 T, and up to a sample.
        assert!((lag.settled_ms() - 11.736).abs() < 0.2, "{}", lag.settled_ms());
        assert!(lag.overshoot() < 2e-3);
        let ringing = of(|t| 1.0 - (-t / 0.004).exp() * (t * 500.0).cos());
        let expected = (-std::f64::consts::PI / 500.0 / 0.004).exp();
        assert!((ringing.overshoot() - expected).abs() < 0.03, "{}", ringing.overshoot());
    }

    /// Each part costs time, and the reference filter keeps the step from overshooting.
    #[test]
    fn parts_of_the_loop_cost_time() {
        let whole = CurrentLoop::new(&Config::default()).unwrap();
        let (response, without) = (whole.response(), whole.without(0).response());
        assert!((response.end() - 1.0).abs() < 1e-3);
        // The pole of Eq. 3.40 alone takes ln(0.1)/ln(p_f) periods.
        assert!(response.time_ms(0.9) > without.time_ms(0.9) + 0.5);
        assert!(whole.without(1).response().time_ms(0.9) > response.time_ms(0.9) + 2.0);
        assert!(without.overshoot() > 0.2 && response.overshoot() < 0.1);
    }
}
