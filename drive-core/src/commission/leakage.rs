//! Step 5: the transient inductance from the response to the carrier.
//!
//! The response of the commanded voltage to the sampled current, at `z = e^(j omega T)`:
//!
//! ```text
//! |h| = |(1 - p) / R' / (z - p)| |(1 - b) + b/z|        p = exp(-T R' / L)        b = tau_f/T (1 - e^(-T/tau_f))
//! ```
//!
//! with the analog filter `tau_f` of the sensors, whose input is straight between two samples.

use core::f32::consts::TAU;

use super::collector::Phasors;
use crate::carrier::injection::CARRIER_SAMPLES;
use crate::io::PERIOD_S;
use crate::math::frames::AlphaBeta;

/// Bisections of the inductance.
const BISECTIONS: u32 = 30;

/// An amplitude along an axis, of its cosine and sine parts.
fn amplitude(parts: [AlphaBeta; 2], along: fn(&AlphaBeta) -> f32) -> f32 {
    let [re, im] = parts.map(|part| along(&part));
    libm::hypotf(re, im)
}

/// A/V along phase a, and across it.
pub(super) fn admittances(seen: &Phasors) -> [f32; 2] {
    let axes: [fn(&AlphaBeta) -> f32; 2] = [|v| v.alpha, |v| v.beta];
    axes.map(|axis| amplitude(seen.current, axis) / amplitude(seen.voltage, axis))
}

/// Gain mismatch that the carrier along phase a shows: (gain of a)/(gain of b) - 1.
pub(super) fn mismatch(seen: &Phasors) -> f32 {
    let [re, im] = seen.current;
    let square = re.alpha * re.alpha + im.alpha * im.alpha;
    const SQRT_3: f32 = 1.732_050_8;
    SQRT_3 * (re.alpha * re.beta + im.alpha * im.beta) / square
}

/// The inductance, H, that gives this admittance, A/V, with the resistance R', ohm, and the analog filter, periods.
pub(super) fn inductance(admittance: f32, resistance: f32, filter: f32, range: (f32, f32)) -> f32 {
    let (sin, cos) = libm::sincosf(TAU / CARRIER_SAMPLES as f32);
    let b = if filter > 0.0 { filter * -libm::expm1f(-1.0 / filter) } else { 0.0 };
    let seen = libm::hypotf((1.0 - b) + b * cos, b * sin);
    let (mut low, mut high) = (libm::logf(range.0), libm::logf(range.1));
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let decayed = -libm::expm1f(-PERIOD_S * resistance / libm::expf(middle));
        let to_pole = libm::hypotf(cos - (1.0 - decayed), sin);
        if seen * decayed / (resistance * to_pole) > admittance {
            low = middle;
        } else {
            high = middle;
        }
    }
    libm::expf(0.5 * (low + high))
}
