//! Model of the motor for the blocks of the control.

use num_complex::Complex64;

/// The motor: T-equivalent circuit per phase (Figure 21), star, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Stator resistance of a phase, ohm.
    pub r_s: f32,
    /// Rotor resistance, referred to the stator, ohm.
    pub r_r: f32,
    /// Leakage inductance of the stator, H.
    pub l_ls: f32,
    /// Leakage inductance of the rotor, referred to the stator, H.
    pub l_lr: f32,
    /// Magnetising inductance, H.
    pub l_m: f32,
    /// Pole pairs.
    pub pole_pairs: u8,
}

impl Motor {
    /// The motor of the dissertation, Table 5.
    pub const DEFAULT: Self =
        Self { r_s: 5.4, r_r: 1.1, l_ls: 0.0276, l_lr: 0.0276, l_m: 0.1771, pole_pairs: 2 };

    /// Returns the rotor inductance, H.
    pub fn l_r(&self) -> f32 {
        self.l_m + self.l_lr
    }

    /// Returns the transient inductance sigma L_s, H.
    pub fn sigma_l_s(&self) -> f32 {
        self.l_ls + self.l_m * (self.l_lr / self.l_r())
    }

    /// Returns the coupling of the rotor flux to the stator, (L_m / L_r) L_m, H.
    pub fn coupled_inductance(&self) -> f32 {
        self.l_m / self.l_r() * self.l_m
    }

    /// Returns the rotor time constant L_r / r_r, s.
    pub fn tau_r(&self) -> f32 {
        self.l_r() / self.r_r
    }

    /// Returns the torque per q-axis current, Nm/A, at a constant d-axis current `i_d`, A peak: 3/2
    /// P L_m^2 / L_r i_d (Eq. 2.7 prints L_m for L_m^2 / L_r).
    pub fn torque_per_ampere(&self, i_d: f32) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.l_m * self.l_m / self.l_r() * i_d
    }
}

impl Default for Motor {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// First-order plant k/(z - p), for example current in A over voltage in V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// Gain k, output unit per input unit.
    pub k: f64,
    /// Pole p, in (0, 1).
    pub p: f64,
}

impl FirstOrder {
    /// Returns the frequency response G(e^(j omega_t)).
    #[cold]
    pub fn response(&self, omega_t: f64) -> Complex64 {
        Complex64::new(self.k, 0.0) / (Complex64::cis(omega_t) - Complex64::new(self.p, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f32, expected: f32) {
        assert!((value / expected - 1.0).abs() < 1e-5, "{value}, not {expected}");
    }

    /// The expected values were computed by hand from Table 5.
    #[test]
    fn derived_parameters_of_the_motor() {
        let motor = Motor::default();
        near(motor.l_r(), 0.2047);
        near(motor.sigma_l_s(), 0.051_478_7);
        near(motor.coupled_inductance(), 0.153_221_3);
        near(motor.l_m + motor.l_ls, motor.sigma_l_s() + motor.coupled_inductance());
        near(motor.tau_r(), 0.186_090_9);
        near(motor.torque_per_ampere(0.7), 0.321_764_7);
        near(motor.torque_per_ampere(1.4), 0.643_529_4);
    }
}
