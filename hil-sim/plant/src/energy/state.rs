//! State of the energy model.

use super::magnetics::Solution;
use crate::complex::Complex;
use crate::model::{ElectricalRate, ElectricalState, increment};

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
    /// Makes a state with these fluxes, Wb, in the order of the fields. [`EnergyMachine`](super::EnergyMachine) then
    /// computes its currents.
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

/// Time derivative of an [`EnergyState`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyRate {
    /// Rate of the stator flux, V.
    pub psi_s: Complex,
    /// Rate of the rotor flux, V.
    pub psi_r: Complex,
    /// Rate of the flux of the bottom of the bars, V.
    pub psi_deep: Complex,
    /// Rate of the flux of the eddy currents, V.
    pub psi_iron: Complex,
    /// Electrical speed, rad/s.
    pub theta: f64,
    /// Rate of the saliency of the rotor's slots.
    pub(super) slots: Complex,
    /// Rates of main flux and stator current.
    pub(super) m: Complex,
    pub(super) i: Complex,
}

impl ElectricalRate for EnergyRate {
    #[inline]
    fn current_rate(&self) -> Complex {
        self.i
    }
}

impl ElectricalState for EnergyState {
    type Rate = EnergyRate;

    #[inline]
    fn current(&self) -> Complex {
        self.solution.i
    }

    #[inline]
    fn rotor_flux(&self) -> Complex {
        self.psi_r
    }

    #[inline(always)]
    fn set_moved(&mut self, x: &Self, k: &EnergyRate, h: f64) {
        self.psi_s = x.psi_s + k.psi_s * h;
        self.psi_r = x.psi_r + k.psi_r * h;
        self.psi_deep = x.psi_deep + k.psi_deep * h;
        self.psi_iron = x.psi_iron + k.psi_iron * h;
        self.theta = x.theta + k.theta * h;
        self.solution.slots = x.solution.slots + k.slots * h;
        // `correct` sets the rotor current and the derivatives.
        self.solution.m = x.solution.m + k.m * h;
        self.solution.i = x.solution.i + k.i * h;
    }

    #[inline(always)]
    fn set_advanced(&mut self, x: &Self, k: [&EnergyRate; 4], h: f64) {
        let sixth = h * (1.0 / 6.0);
        self.psi_s = x.psi_s + increment(k.map(|k| k.psi_s), sixth);
        self.psi_r = x.psi_r + increment(k.map(|k| k.psi_r), sixth);
        self.psi_deep = x.psi_deep + increment(k.map(|k| k.psi_deep), sixth);
        self.psi_iron = x.psi_iron + increment(k.map(|k| k.psi_iron), sixth);
        self.theta = x.theta + (k[0].theta + k[3].theta + (k[1].theta + k[2].theta) * 2.0) * sixth;
        self.solution.slots = x.solution.slots + increment(k.map(|k| k.slots), sixth);
        self.solution.m = x.solution.m + increment(k.map(|k| k.m), sixth);
        self.solution.i = x.solution.i + increment(k.map(|k| k.i), sixth);
    }
}
