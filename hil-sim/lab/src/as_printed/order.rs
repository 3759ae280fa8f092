//! Section 3.4: LPF before and after the rotation into the frame of the flux.

use drive_core::filter::{LPF, LpfState};
use drive_settings::tuning::motor_plant;

use crate::prelude::*;
use crate::recomputed::PERIOD_S;

/// Rotation speeds of the frame, Hz.
const FRAME_HZ: [f64; 4] = [0.0, 5.0, 25.0, 48.0];
const SAMPLES: usize = 6000;

/// Adds the table and the comparisons.
pub fn add(outcome: &mut Outcome) -> Result<(), Error> {
    let mut table = texts::table("as-printed", "order");
    let [mut settles, mut all] = [true, true];
    for hz in FRAME_HZ {
        let (before, after) = (swing(hz, false)?, swing(hz, true)?);
        settles &= after < 0.01;
        all &= before < 0.01;
        let milli = |x: f64| Cell::fixed(1e3 * x, 2);
        table.record([
            ("frame (Hz)", Cell::fixed(hz, 0)),
            ("rotation before the filter, swing after 0.5 s (mA)", milli(after)),
            ("filter before the rotation (mA)", milli(before)),
        ]);
    }
    outcome.tables.push(table);
    outcome.metrics.set("orders_that_settle", f64::from(u8::from(settles) + u8::from(all)));
    outcome.compared.extend([
        named("order_matters").simulated(settles != all),
        named("currents_settle").simulated(settles),
        named("direct_current_oscillates").simulated(!settles),
    ]);
    Ok(())
}

/// Largest distance of the currents from their mean over the second half of a second after a step of both currents, A.
fn swing(frame_hz: f64, rotated_first: bool) -> Result<f64, Error> {
    let motor = motor_plant(&Settings::default().motor.into(), PERIOD_S).map_err(Error::refused)?;
    let (k_c, z_c) = (printed("section 3.8", "k_c"), printed("Eq. 3.38", "z_c"));
    let turn = std::f64::consts::TAU * frame_hz * PERIOD_S;
    let reference = Complex64::new(0.7, 1.0);
    let [mut i, mut u, mut delayed, mut before] = [Complex64::ZERO; 4];
    let mut filter = LpfState::default();
    let mut late = Vec::new();
    for n in 0..SAMPLES {
        let angle = Complex64::cis(turn * n as f64);
        // The current in the stator frame; the filter is linear and equal for both axes.
        let input = if rotated_first { i } else { i * angle };
        let out = LPF.step(&mut filter, AlphaBeta::new(input.re as f32, input.im as f32));
        let out = Complex64::new(out.alpha.into(), out.beta.into());
        let seen = if rotated_first { out } else { out * angle.conj() };
        let error = reference - seen;
        u += (error - before * z_c) * k_c;
        before = error;
        // The current in the flux frame, which rotates on by one period until the voltage takes effect.
        i = (i * motor.p + delayed * motor.k) * Complex64::cis(-turn);
        delayed = u;
        if n >= SAMPLES / 2 {
            late.push(i);
        }
    }
    let mean = late.iter().sum::<Complex64>() / late.len() as f64;
    Ok(late.iter().map(|i| (i - mean).norm()).fold(0.0, f64::max))
}
