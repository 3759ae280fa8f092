//! State of the energy model.

use super::magnetics::Solution;
use crate::complex::Complex;
use crate::model::{ElectricalState, increment};

/// Electrical state of the energy model. Fluxes are integrated; currents follow from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyState {
    /// Stator flux linkage, Wb.
    pub psi_s: Complex,
    /// Rotor flux linkage behind its leakage, on the side of the air gap, Wb.
    pub psi_r: Complex,
    /// Flux linkage of the bottom of the bars, Wb; unused without skin effect.
    pub psi_deep: Complex,
    /// Flux linkage of the iron's eddy currents, Wb; unused without iron loss.
    pub psi_iron: Complex,
    /// Electrical angle of the rotor, rad.
    pub theta: f64,
    pub(super) solution: Solution,
}

impl EnergyState {
    /// With these fluxes, Wb, in the order of the fields. [`EnergyMachine`](super::EnergyMachine) settles its currents.
    pub fn of_fluxes([psi_s, psi_r, psi_deep, psi_iron]: [Complex; 4]) -> Self {
        Self { psi_s, psi_r, psi_deep, psi_iron, ..Self::default() }
    }

    /// Main flux, Wb.
    pub fn main_flux(&self) -> Complex {
        self.solution.m
    }

    /// Rotor current, A, referred to the stator.
    pub fn rotor_current(&self) -> Complex {
        self.solution.i_r
    }
}

impl ElectricalState for EnergyState {
    #[inline]
    fn current(&self) -> Complex {
        self.solution.i
    }

    #[inline]
    fn rotor_flux(&self) -> Complex {
        self.psi_r
    }

    // Main flux and current go along as a first guess of the solution.
    #[inline]
    fn moved(&self, k: &Self, h: f64) -> Self {
        let guess = &self.solution;
        Self {
            psi_s: self.psi_s + k.psi_s * h,
            psi_r: self.psi_r + k.psi_r * h,
            psi_deep: self.psi_deep + k.psi_deep * h,
            psi_iron: self.psi_iron + k.psi_iron * h,
            theta: self.theta + k.theta * h,
            solution: Solution {
                m: guess.m + k.solution.m * h,
                i: guess.i + k.solution.i * h,
                ..*guess
            },
        }
    }

    #[inline]
    fn advanced(&self, k: [&Self; 4], h: f64) -> Self {
        let sixth = h * (1.0 / 6.0);
        let guess = &self.solution;
        Self {
            psi_s: self.psi_s + increment(k.map(|k| k.psi_s), sixth),
            psi_r: self.psi_r + increment(k.map(|k| k.psi_r), sixth),
            psi_deep: self.psi_deep + increment(k.map(|k| k.psi_deep), sixth),
            psi_iron: self.psi_iron + increment(k.map(|k| k.psi_iron), sixth),
            theta: self.theta + (k[0].theta + k[3].theta + (k[1].theta + k[2].theta) * 2.0) * sixth,
            solution: Solution {
                m: guess.m + increment(k.map(|k| k.solution.m), sixth),
                i: guess.i + increment(k.map(|k| k.solution.i), sixth),
                ..*guess
            },
        }
    }
}
