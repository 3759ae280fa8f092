//! Frequency responses as panels.

use crate::prelude::*;

/// Control rate, Hz.
pub const RATE: f64 = 6000.0;

/// Returns the angle per sample at the control rate, rad/sample, of a frequency.
pub fn omega_t(hz: f64) -> f64 {
    TAU * hz / RATE
}

/// Returns `count` frequencies from `low` to `high`, evenly spaced in the logarithm.
pub fn frequencies(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = (high / low).ln() / (count - 1) as f64;
    (0..count).map(|k| low * (k as f64 * step).exp()).collect()
}

/// Axes of a Bode plot. The responses are functions of rad/sample. Gain and phase (without jumps of 360°) are drawn
/// over the frequencies in Hz that `shown` computes from those in `hz`.
pub struct Bode<'a> {
    /// Real frequencies, Hz.
    pub hz: &'a [f64],
    /// Label of the frequency axis.
    pub label: &'a str,
    /// Conversion from a real frequency to the one on the axis.
    pub shown: fn(f64) -> f64,
}

impl Bode<'_> {
    /// Returns the panels of gain and phase.
    pub fn panels<N: AsRef<str>, F: Fn(f64) -> Complex64>(
        &self,
        responses: impl IntoIterator<Item = (N, F)>,
    ) -> (Panel, Panel) {
        let axes = |y| Panel { log_x: true, ..Panel::new(self.label, y) };
        let (mut gain, mut phase) = (axes("gain (dB)"), axes("phase (°)"));
        for (name, response) in responses {
            let values: Vec<Complex64> = self.hz.iter().map(|&hz| response(omega_t(hz))).collect();
            let (name, decibels) = (name.as_ref(), values.iter().map(|h| decibels(*h)));
            gain = gain.with(Series::line(name, self.along(decibels)));
            phase = phase.with(Series::line(name, self.along(unwrapped(&values).into_iter())));
        }
        (gain, phase)
    }

    fn along(&self, values: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
        self.hz.iter().map(|&hz| (self.shown)(hz)).zip(values).collect()
    }
}

/// Magnitude of a response in dB.
pub fn decibels(response: Complex64) -> f64 {
    20.0 * response.norm().log10()
}

/// Returns phases in degrees, each within 180° of the phase before.
pub fn unwrapped(values: &[Complex64]) -> Vec<f64> {
    let mut before = 0.0;
    let mut phases = Vec::with_capacity(values.len());
    for value in values {
        let phase = value.arg().to_degrees();
        before = phase - 360.0 * ((phase - before) / 360.0).round();
        phases.push(before);
    }
    phases
}

/// Returns the fictitious frequency of the w plane (Eq. 2.18), Hz, for a real frequency.
pub fn fictitious(hz: f64) -> f64 {
    RATE / (0.5 * TAU) * (0.5 * omega_t(hz)).tan()
}
