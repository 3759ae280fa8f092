//! A step of the torque, and its characteristic numbers.

use crate::prelude::*;
use drive_core::carrier::CARRIER_SAMPLES;

/// Time that is recorded after the step, s, and the part at its end that gives the final value.
const RECORDED_S: f64 = 0.06;
const FINAL_S: f64 = 0.02;

/// A quantity after a step of the torque reference from zero, one value per control period, the first at the command.
pub struct Response(pub Vec<f64>);

impl Response {
    /// Returns the final value: the mean of the last 20 ms.
    pub fn end(&self) -> f64 {
        let last = &self.0[self.0.len() - (FINAL_S * RATE_HZ) as usize..];
        last.iter().sum::<f64>() / last.len() as f64
    }

    /// Returns the time from the command until this share of the final value is reached, ms, by a straight line between two samples.
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

    /// Returns the excess over the final value, relative to the final value.
    pub fn overshoot(&self) -> f64 {
        self.0.iter().map(|value| value / self.end() - 1.0).fold(0.0, f64::max)
    }
}

/// Response of the motor to a step of the torque reference from zero.
pub struct Rise {
    /// q-axis current of the motor, A: its torque divided by the torque of an ampere. It is the mean over steps at all
    /// ten samples of an injection period, which cancels the injection.
    pub current: Response,
    /// Largest current of a phase, A.
    pub peak_a: f64,
    /// Largest error of the angle, electrical degrees.
    pub angle_deg: f64,
}

impl Rise {
    /// # Errors
    /// [`Error::Refused`] if the drive refuses the command or stops.
    pub fn measured(rig: &Rig, i_q: f64) -> Result<Self, Error> {
        let mut currents = vec![0.0; (RECORDED_S * RATE_HZ) as usize];
        let (mut peak_a, mut angle_deg) = (0.0_f64, 0.0_f64);
        for wait in 0..CARRIER_SAMPLES {
            let mut rig = rig.clone();
            rig.wait(wait as f64 / RATE_HZ);
            rig.command(&Command::Torque(i_q as f32))?;
            rig.peak_a = peak_a;
            for current in &mut currents {
                rig.run(1.0 / RATE_HZ, |point| {
                    let true_current = point.torque / (point.torque_per_flux_ampere * point.flux);
                    *current += true_current / CARRIER_SAMPLES as f64;
                    angle_deg = angle_deg.max(point.angle_error_deg.abs());
                });
            }
            peak_a = rig.peak_a;
            if let Some(fault) = rig.fault() {
                return Err(Error::Refused(format!("the drive stops at a torque step: {fault}")));
            }
        }
        Ok(Self { current: Response(currents), peak_a, angle_deg })
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
        assert!(lag.overshoot() < 2e-3);
        let ringing = of(|t| 1.0 - (-t / 0.004).exp() * (t * 500.0).cos());
        let expected = (-std::f64::consts::PI / 500.0 / 0.004).exp();
        assert!((ringing.overshoot() - expected).abs() < 0.03, "{}", ringing.overshoot());
    }
}
