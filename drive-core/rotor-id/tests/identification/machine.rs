//! The T-equivalent machine in stator coordinates, in `f64`, fed with a voltage that is constant over a period.

use induction_drive_core::Motor;
use num_complex::Complex64;

pub const J: Complex64 = Complex64::I;

/// Parameters and state. The flux is the rotor flux as the stator sees it, (L_m / L_r) psi_r, V s.
#[derive(Clone, Copy)]
pub struct Machine {
    pub r_s: f64,
    /// 1 / tau_r, 1/s.
    pub rate: f64,
    pub sigma_l_s: f64,
    /// L_m² / L_r, H.
    pub coupled: f64,
    /// Electrical rad/s.
    pub omega_m: f64,
    pub current: Complex64,
    pub flux: Complex64,
}

impl Machine {
    pub fn new(motor: &Motor, omega_m: f64) -> Self {
        let [l_m, l_ls, l_lr] = [motor.l_m, motor.l_ls, motor.l_lr].map(f64::from);
        let coupled = l_m * l_m / (l_m + l_lr);
        Self {
            r_s: motor.r_s.into(),
            rate: f64::from(motor.r_r) / (l_m + l_lr),
            sigma_l_s: l_m + l_ls - coupled,
            coupled,
            omega_m,
            current: Complex64::ZERO,
            flux: Complex64::ZERO,
        }
    }

    /// Puts the machine into the steady state of `current`, A, in the flux frame. Returns the voltage in
    /// that frame, V, and the frequency of the flux, rad/s.
    pub fn settle(&mut self, current: Complex64) -> (Complex64, f64) {
        let omega = self.omega_m + self.rate * current.im / current.re;
        self.current = current;
        self.flux = Complex64::from(self.coupled * current.re);
        let voltage = (self.r_s + J * omega * self.sigma_l_s) * current + J * omega * self.flux;
        (voltage, omega)
    }

    fn slope(&self, i: Complex64, flux: Complex64, v: Complex64) -> [Complex64; 2] {
        let d_flux = self.coupled * self.rate * i - (self.rate - J * self.omega_m) * flux;
        [(v - self.r_s * i - d_flux) / self.sigma_l_s, d_flux]
    }

    /// Advances by two steps of the classical Runge-Kutta method.
    pub fn advance(&mut self, v: Complex64, seconds: f64) {
        let h = seconds / 2.0;
        for _ in 0..2 {
            let (i, flux) = (self.current, self.flux);
            let [a, a_flux] = self.slope(i, flux, v);
            let [b, b_flux] = self.slope(i + a * (h / 2.0), flux + a_flux * (h / 2.0), v);
            let [c, c_flux] = self.slope(i + b * (h / 2.0), flux + b_flux * (h / 2.0), v);
            let [d, d_flux] = self.slope(i + c * h, flux + c_flux * h, v);
            self.current += (a + 2.0 * b + 2.0 * c + d) * (h / 6.0);
            self.flux += (a_flux + 2.0 * b_flux + 2.0 * c_flux + d_flux) * (h / 6.0);
        }
    }
}
