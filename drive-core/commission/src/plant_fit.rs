//! Least squares of a plant of the current loop; [`plant`](super::plant) has the equation.

use num_complex::Complex32;

use super::Refusal;
use drive_core::filter::{LPF, LpfState};
use drive_core::{AlphaBeta, FirstOrder};
use rotor_id::rls::ud::Ud;

/// Number of samples until the filters and the amplitude have settled.
pub(super) const SETTLING: u32 = 600;
/// Covariance before the first sample, in units of the bases.
const P0: f32 = 1e6;

/// Least squares of one axis, in units of bases that make voltage and current about one.
#[derive(Clone, Debug)]
pub(super) struct PlantFit {
    ud: Ud,
    low_pass: LpfState,
    /// Voltages of the last three samples, and the last current.
    u: [f32; 3],
    y: f32,
    samples: u32,
    sound: bool,
}

impl Default for PlantFit {
    fn default() -> Self {
        let (ud, low_pass) = (Ud::new([Complex32::ZERO; 4], P0), LpfState::default());
        Self { ud, low_pass, u: [0.0; 3], y: 0.0, samples: 0, sound: true }
    }
}

impl PlantFit {
    /// Takes a sample: the voltage realised in that step, and the measured current.
    pub fn push(&mut self, voltage: f32, current: f32) {
        let filtered = LPF.step(&mut self.low_pass, AlphaBeta::new(voltage, current));
        let ([u1, u2, u3], y1) = (self.u, self.y);
        (self.u, self.y) = ([filtered.alpha, u1, u2], filtered.beta);
        self.samples += 1;
        if self.samples > SETTLING {
            let x = [y1, u2, u3, 1.0].map(|x| Complex32::new(x, 0.0));
            let y = Complex32::new(filtered.beta, 0.0);
            self.sound &= self.ud.update(x, y, 1.0).is_some();
        }
    }

    /// Returns the plant, in units of the bases.
    pub fn found(&self) -> Result<FirstOrder, Refusal> {
        let [p, b1, b2, _] = self.ud.theta.map(|x| f64::from(x.re));
        let is_sound = self.sound && self.samples > SETTLING;
        is_sound.then_some(FirstOrder { k: b1 + b2, p }).ok_or(Refusal::SamplesLost)
    }
}
