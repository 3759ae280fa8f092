//! Quantities that follow from the parameters and from the nameplate of the motor.

use super::{Motor, Nameplate};
use crate::math::frames::SQRT_3;
use crate::tuning::EquivalentCircuit;

impl Motor {
    /// The equivalent circuit in double precision, for the design of the controllers.
    pub fn circuit(&self) -> EquivalentCircuit {
        EquivalentCircuit {
            r_s: self.r_s.into(),
            r_r: self.r_r.into(),
            l_m: self.l_m.into(),
            l_ls: self.l_ls.into(),
            l_lr: self.l_lr.into(),
        }
    }

    /// Rotor inductance, H.
    pub fn l_r(&self) -> f32 {
        self.l_m + self.l_lr
    }

    /// Transient inductance sigma L_s, H.
    pub fn sigma_l_s(&self) -> f32 {
        self.l_ls + self.l_m * (self.l_lr / self.l_r())
    }

    /// Coupling of the rotor flux to the stator, (L_m / L_r) L_m, H.
    pub fn coupled_inductance(&self) -> f32 {
        self.l_m / self.l_r() * self.l_m
    }

    /// Rotor time constant L_r / r_r, s.
    pub fn tau_r(&self) -> f32 {
        self.l_r() / self.r_r
    }

    /// Torque per quadrature current, Nm/A, at a constant direct current `i_d`, A peak:
    /// 3/2 P L_m^2 / L_r i_d (Eq. 2.7 prints L_m for L_m^2 / L_r).
    pub fn torque_per_ampere(&self, i_d: f32) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.l_m * self.l_m / self.l_r() * i_d
    }
}

impl Nameplate {
    /// Base impedance of a phase, ohm.
    pub(crate) fn base_impedance(&self) -> f32 {
        self.voltage_v / (SQRT_3 * self.current_a)
    }
}
