//! Signal of a demodulation while the encoder holds the angle: mean, slope, noise, delay.

use sim_bench::plant::MeasurementSettings;

use crate::prelude::*;

/// Half of the turn over which the slope is taken, degrees.
const TURN_DEG: f64 = 4.0;
/// Time for the current to settle, s.
pub const SETTLED_S: f64 = 0.5;
/// Time to settle after a turn, and to average, s.
const SETTLE_S: f64 = 0.1;
const AVERAGE_S: f64 = 0.4;

/// Signal of a demodulation at the true flux angle.
#[derive(Clone, Copy, Debug)]
pub struct SignalQuality {
    /// Signal, A or 1.
    pub signal: f64,
    /// Change of the signal with the angle error, per rad: the current held, the axis turned.
    pub slope: f64,
    /// Deviation of the signal, rms.
    pub noise: f64,
}

/// Measures at the true flux angle and 4° to either side.
///
/// # Errors
/// When the drive refuses a command.
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

/// Changes of the saliency, their size (1/A), and the samples after each: no multiple of the carrier
/// period, so that they fall on every phase of the carrier. The first is not counted: as many go up
/// then as down.
const CHANGES: usize = 41;
const CHANGE: f64 = 0.004;
const AFTER: usize = 603;

/// Mean delay, samples, from a change of the motor's saliency to the signal: the area above the step
/// response, measured without noise.
///
/// # Errors
/// As [`Rig::oriented`].
pub fn delay(mut config: Config, iq: f64, seed: u64) -> Result<f64, Error> {
    config.measurement.noise_a = Some(0.0);
    // 16 bits.
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
            // The first change comes from the middle.
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
