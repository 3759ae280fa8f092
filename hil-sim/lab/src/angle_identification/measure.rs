//! Measurement of the response to a rotation of the injection axis, alone or with the current, while the encoder holds the orientation.

use drive_core::filter::{PP, SosState};

use crate::identification::signals::{self, Prbs};
use crate::prelude::*;

/// Number of samples for which each value of the sequence (8 bits, as in section 3.10) is held: 10 ms, so that the
/// excitation lies in the frequency range of the loop. If a value is held for one sample or for 3 ms, the delay of the
/// filters, for which Eq. 3.43 has no term, dominates the fit: it is 50 % or less, and the gains are wrong by half. The source
/// states no length; its poles are those of shorter steps (see [`filter_alone`]).
const HOLD: usize = 60;
/// Periods of the sequence: one to settle; the others are averaged.
const PERIODS: usize = 7;
/// Rotation of the axis in either direction, rad: 3°.
pub const TURN: f64 = 0.052_36;

/// Half of the encoder's step, counts of 0.072° electrical: 2° in either direction.
const STEP_COUNTS: i32 = 28;
/// Samples on each side of a step.
const STEP_SAMPLES: usize = 360;
/// Number of steps in either direction.
const STEPS: usize = 200;
/// Samples at which the slow gain is read: the current has followed, the flux (186 ms) has hardly changed.
const SLOW: std::ops::Range<usize> = 240..360;

/// Record of the identification experiment: input and output over one period of the sequence, averaged.
#[derive(Clone, Debug)]
pub struct Record {
    /// Rotation of the injection axis, rad.
    pub u: Vec<f64>,
    /// Signal without its mean, A or dimensionless.
    pub y: Vec<f64>,
}

fn turn(rig: &mut Rig, radians: f64) -> Result<(), Error> {
    rig.command(&Command::TurnInjection(radians.to_degrees() as f32)).map(|_| ())
}

/// Measures with the pseudo-random sequence on theta, while the encoder orients the current.
///
/// # Errors
/// If the drive refuses a command.
pub fn sequence(mut rig: Rig) -> Result<Record, Error> {
    let mut prbs = Prbs::default();
    let bits = [(); Prbs::PERIOD].map(|()| TURN * prbs.step());
    let mut y = vec![0.0; bits.len() * HOLD];
    for period in 0..PERIODS {
        for (n, &bit) in bits.iter().enumerate() {
            turn(&mut rig, bit)?;
            let mut k = n * HOLD;
            rig.run(HOLD as f64 / RATE_HZ, |p| {
                if period > 0 {
                    y[k] += p.signal() / (PERIODS - 1) as f64;
                }
                k += 1;
            });
        }
    }
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    y.iter_mut().for_each(|y| *y -= mean);
    Ok(Record { u: bits.iter().flat_map(|&bit| [bit; HOLD]).collect(), y })
}

/// Makes the record of the post-processing filter alone: the sequence with each value held for `hold` samples, and white noise, rms as a
/// share of the rms of the output.
pub fn filter_alone(hold: usize, noise: f64, seed: u64) -> Record {
    let (mut prbs, mut state) = (Prbs::default(), SosState::default());
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let u: Vec<f64> = (0..Prbs::PERIOD).flat_map(|_| vec![prbs.step(); hold]).collect();
    let output = u.repeat(2).into_iter().map(|u| f64::from(PP.step(&mut state, u as f32)));
    let mut y: Vec<f64> = output.skip(u.len()).collect();
    let rms = Stats::of(y.iter().copied()).rms();
    // A uniform number up to `largest` has an rms of largest/√3.
    y.iter_mut().for_each(|y| *y += signals::noise(&mut random, noise * rms * 3.0_f64.sqrt()).re);
    Record { u, y }
}

/// Measures the signal per rad of a step of the injection axis, after the current has settled: of the axis alone, and of the estimated
/// flux angle, which moves axis and current.
///
/// # Errors
/// If the drive refuses a command.
pub fn steps(mut rig: Rig) -> Result<[f64; 2], Error> {
    let size = f64::from(2 * STEP_COUNTS) * TURN_PER_COUNT;
    let alone = alternate(&mut rig, |rig, side, k| {
        if k == 0 {
            turn(rig, side * 0.5 * size)?;
        }
        let mut signal = 0.0;
        rig.run(1.0 / RATE_HZ, |p| signal = p.signal());
        Ok((signal, side * 0.5 * size))
    })?;
    turn(&mut rig, 0.0)?;
    rig.wait(0.3);
    let mut offset = 0_u32;
    let with_current = alternate(&mut rig, |rig, side, k| {
        if k == 0 {
            offset = (STEP_COUNTS * side as i32).cast_unsigned();
        }
        let mut sample = rig.plant.sample();
        sample.encoder = sample.encoder.wrapping_add(offset);
        let truth = rig.plant.rotor_flux_angle();
        rig.step_with(&sample);
        let telemetry = rig.drive.telemetry();
        let error = wrapped_degrees(truth - f64::from(telemetry.phi.to_radians()));
        let signal = f64::from(telemetry.delta_i) + f64::from(telemetry.saliency);
        Ok((signal, -error.to_radians()))
    })?;
    Ok([alone, with_current])
}

/// Electrical angle of a count of the encoder of the default drive: two pole pairs, 10 000 counts.
const TURN_PER_COUNT: f64 = 2.0 * std::f64::consts::TAU / 10_000.0;

/// Steps between the two sides many times; returns the mean change of the signal divided by the mean change of the
/// angle, both at [`SLOW`].
fn alternate(
    rig: &mut Rig,
    mut one: impl FnMut(&mut Rig, f64, usize) -> Result<(f64, f64), Error>,
) -> Result<f64, Error> {
    let (mut signal, mut angle) = (vec![0.0; STEP_SAMPLES], 0.0);
    for n in 0..2 * STEPS + 1 {
        let side = if n % 2 == 0 { 1.0 } else { -1.0 };
        for (k, signal) in signal.iter_mut().enumerate() {
            let (y, x) = one(rig, side, k)?;
            // The first step starts in the middle. Half of the others go up, half go down.
            if n > 0 {
                *signal += side * y;
                if SLOW.contains(&k) {
                    angle += side * x;
                }
            }
        }
    }
    let angle = angle / SLOW.len() as f64;
    // The signal goes from -y to y for angles from -x to x; before a step it has the value of the opposite side.
    let end = SLOW.map(|k| signal[k]).sum::<f64>() / SLOW.len() as f64;
    Ok(SLOW.map(|k| 0.5 * (signal[k] + end) / angle).sum::<f64>() / SLOW.len() as f64)
}
