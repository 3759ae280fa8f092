//! The parameters of the motor.

use crate::tuning::EquivalentCircuit;

/// The motor: T-equivalent circuit per phase (Figure 21), star, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// Rotor resistance, ohm.
    pub r_r: f32,
    /// Stator leakage inductance, H.
    pub l_ls: f32,
    /// Rotor leakage inductance, H.
    pub l_lr: f32,
    /// Magnetising inductance, H.
    pub l_m: f32,
    /// Pole pairs.
    pub pole_pairs: u8,
    /// Inertia of rotor and load, kg m^2: the speed loop is designed for it.
    pub inertia: f32,
}

impl Default for Motor {
    /// Table 5; the inertia is assumed.
    fn default() -> Self {
        Self {
            r_s: 5.4,
            r_r: 1.1,
            l_ls: 0.0276,
            l_lr: 0.0276,
            l_m: 0.1771,
            pole_pairs: 2,
            inertia: 0.012,
        }
    }
}

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
