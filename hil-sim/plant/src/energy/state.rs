//! State of the energy model.

use super::magnetics::Solution;
use crate::complex::Complex;
use crate::model::{ElectricalRate, ElectricalState, integrated};

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

    // `correct` sets the rotor current and the derivatives.
    integrated!(EnergyRate: psi_s = psi_s, psi_r = psi_r, psi_deep = psi_deep, psi_iron = psi_iron, theta = theta,
        solution.slots = slots, solution.m = m, solution.i = i);
}
