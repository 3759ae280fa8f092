//! Signal of a demodulation while the encoder holds the angle: mean, sensitivity to the angle, noise, delay.

use sim_bench::plant::MeasurementSettings;

use crate::prelude::*;

/// Half of the rotation over which the sensitivity is measured, degrees.
const TURN_DEG: f64 = 4.0;
/// Time for the current to settle, s.
pub const SETTLED_S: f64 = 0.5;
/// Time to settle after a rotation, s; the averaging takes the same time.
const SETTLE_S: f64 = 0.1;
const AVERAGE_S: f64 = 0.4;

/// Signal of a demodulation at the true flux angle.
#[derive(Clone, Copy, Debug)]
pub struct SignalQuality {
    /// Signal, A or dimensionless.
    pub signal: f64,
    /// Change of the signal with the angle error, per rad, with the current held and the axis rotated.
    pub slope: f64,
    /// Standard deviation of the signal.
    pub noise: f64,
}

/// Measures at the true flux angle and at 4° to either side.
///
/// # Errors
/// If the drive refuses a command.
pub fn signal_quality(mut rig: Rig) -> Result<SignalQuality, Error> {
    let mut at = |turn: f64| -> Result<(Stats, f64), Error> {
        rig.settle(&Command::TurnInjection(turn as f32), SETTLE_S)?;
        let [signal, error] = rig.stats(AVERAGE_S, |p| [p.signal(), p.angle_error_deg - turn]);
        Ok((signal, error.mean().to_radians()))
    };
    let [behind, here, ahead] = [at(-TURN_DEG)?, at(0.0)?, at(TURN_DEG)?];
    Ok(SignalQuality {
        signal: here.0.mean(),
        slope: (ahead.0.mean() - behind.0.mean()) / (ahead.1 - behind.1),
        noise: here.0.deviation(),
    })
}

/// Number of changes of the saliency, their size (1/A), and the samples after each. The samples are no multiple of the
/// injection period, so that the changes fall on every phase of the injection. The first change does not count; half of
/// the others go up, half go down.
const CHANGES: usize = 41;
const CHANGE: f64 = 0.004;
const AFTER: usize = 603;

/// Returns the mean delay, samples, from a change of the motor's saliency to the signal: the area above the step
/// response, measured without noise.
///
/// # Errors
/// As [`Rig::oriented`].
pub fn delay(mut config: Config, iq: f64, seed: u64) -> Result<f64, Error> {
    config.measurement.noise_a = Some(0.0);
    // A resolution of 16 bits.
    let fine = MeasurementSettings::IDEAL;
    config.measurement.lsb_a = Some(fine.lsb_a / fine.range_a * config.measurement.range_a);
    config.calibrate();
    let mut rig = Rig::oriented(&config, seed, iq, SETTLED_S)?;
    let plant = plant_settings(&config);
    let mut response = [0.0; AFTER];
    for n in 0..CHANGES {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        let mut saliency = plant.saliency;
        saliency.b1 += 0.5 * sign * CHANGE;
        rig.plant.set_saliency(&plant.machine, &saliency).map_err(Error::refused)?;
        let mut k = 0;
        rig.run(AFTER as f64 / sim_bench::rig::RATE_HZ, |p| {
            // The first change starts in the middle.
            if n > 0 {
                response[k] += sign * p.signal();
            }
            k += 1;
        });
    }
    let end = Stats::of(response[AFTER - 200..].iter().copied()).mean();
    // The steps go from -end to end.
    Ok(response.iter().map(|x| 0.5 * (1.0 - x / end)).sum())
}
