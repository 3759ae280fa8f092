//! The induction machine with a flux-fixed and a current-fixed saliency ("model A").
//!
//! All vectors are complex, in the stator frame. With `k = Lm/Lr`, `alpha = rr/Lr`,
//! `sigma Ls = Ls - Lm^2/Lr`, `R' = rs + rr k^2`, electrical rotor speed `w` and `x*` the conjugate:
//!
//! ```text
//! s       = a_psi (psi/psi_n)^2 2/(1 + r) + b1 i^2/|i|          r = (|psi|/psi_n)^2
//! y       = v - R' i + k (alpha - j w) psi - v_R
//! di/dt   = (y + s y*) / (sigma Ls (1 - |s|^2))                 that is, L x = sigma Ls (x - s x*)
//! dpsi/dt = rr k i - (alpha - j w) psi
//! v_R     = 1/2 chi rr k^2 (h - u h*)       h = i - i_lp, di_lp/dt = 2 pi 60 h, u = (psi/|psi|)^2
//! Te      = 3/2 P k Im(psi* i)
//! ```
//!
//! With `a_psi = b1 = chi = 0` this is Eq. 2.9 with the rotor currents eliminated, term by term. A positive `s` means
//! low impedance along its axis. The size of the saliency is an assumption, because nothing in the source measures it.
//! The factor `2/(1 + r)`, which is one at `psi_n`, limits the flux part to `2 |a_psi|`. Above the current `hold_a` the
//! current part stays at its value for `hold_a`, so that `|s|` remains below one at all currents. Iron loss, slotting,
//! skin effect and the saturation of the main flux are not modelled.

use crate::complex::{Complex, dot, square};
use crate::error::{PlantError, check};
use crate::model::{ElectricalRate, ElectricalState, MachineModel, integrated};
use crate::settings::settings;

/// Largest magnitude of the saliency vector that settings may reach.
const SALIENCY_LIMIT: f64 = 0.5;
/// Corner of the filter that splits off the high-frequency current for the `chi` term, rad/s.
const CHI_CORNER: f64 = std::f64::consts::TAU * 60.0;
/// Values below which the direction of the current (A) and of the flux (Wb squared) counts as undefined.
const NO_CURRENT: f64 = 1e-9;
const NO_FLUX_SQUARED: f64 = 1e-18;

settings! {
    /// Parameters of the T-equivalent circuit; the defaults are Table 5 of the source.
    MachineSettings "machine." {
        /// Stator resistance, ohm.
        rs: f64 = 5.4, 1e-4..=1000.0, "ohm";
        /// Rotor resistance, referred to the stator, ohm.
        rr: f64 = 1.1, 1e-4..=1000.0, "ohm";
        /// Stator leakage inductance, H.
        lls: f64 = 0.0276, 1e-7..=10.0, "H";
        /// Rotor leakage inductance, referred to the stator, H.
        llr: f64 = 0.0276, 1e-7..=10.0, "H";
        /// Magnetising inductance, H.
        lm: f64 = 0.1771, 1e-5..=100.0, "H";
        /// Pole pairs.
        pole_pairs: u32 = 2, 1.0..=50.0, "";
    }
}

settings! {
    /// Size of the saliency. The defaults are assumed. If all values are zero (with any `psi_n`), it is the textbook
    /// machine.
    SaliencySettings "saliency." {
        /// Part fixed to the rotor flux, at the flux `psi_n`; negative is high impedance along the flux.
        a_psi: f64 = -0.035, -0.25..=0.25, "";
        /// Part fixed to the stator current, 1/A; positive is low impedance along the current (saturating leakage
        /// paths).
        b1: f64 = 0.036, -50.0..=50.0, "1/A";
        /// Resistive part of Eq. 3.8, as a factor: 0 is none, 1 is the part as printed. It acts only well above 60 Hz.
        chi: f64 = 0.0, 0.0..=10.0, "";
        /// Current above which the current part no longer grows, A peak.
        hold_a: f64 = 5.0, 0.01..=10_000.0, "A";
        /// Flux at which `a_psi` holds, Wb; if not given, the flux of a magnetising current of 0.7 A.
        psi_n: Option<f64> = None;
        /// Part fixed to the stator; positive is low impedance along its axis.
        stator_fixed: f64 = 0.0, -0.1..=0.1, "";
        /// Axis of that part, electrical degrees from phase a.
        stator_fixed_deg: f64 = 0.0, -180.0..=180.0, "deg";
    }
}

impl SaliencySettings {
    /// No saliency: the textbook machine.
    pub const NONE: Self = Self { a_psi: 0.0, b1: 0.0, ..Self::DEFAULT };
}

/// Electrical state of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineState {
    /// Stator current, A.
    pub i: Complex,
    /// Rotor flux linkage, Wb.
    pub psi: Complex,
    /// Stator current after the 60 Hz low-pass filter of the `chi` term, A; unused if `chi` is 0.
    pub i_lp: Complex,
}

impl ElectricalRate for MachineState {
    #[inline]
    fn current_rate(&self) -> Complex {
        self.i
    }
}

impl ElectricalState for MachineState {
    type Rate = Self;

    #[inline]
    fn current(&self) -> Complex {
        self.i
    }

    #[inline]
    fn rotor_flux(&self) -> Complex {
        self.psi
    }

    integrated!(Self: i = i, psi = psi, i_lp = i_lp);
}

/// Coefficients of the machine equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    pole_pairs: f64,
    coupling: f64,
    alpha: f64,
    rr_coupling: f64,
    r_prime: f64,
    sigma_ls: f64,
    inv_sigma_ls: f64,
    lr: f64,
    torque_factor: f64,
    two_a_psi: f64,
    b1: f64,
    hold_a: f64,
    psi_n_squared: f64,
    half_chi_r: f64,
    stator_fixed: Complex,
}

impl Machine {
    /// Makes the machine with these settings.
    ///
    /// It refuses values that are not finite or outside the range named in the error. It also refuses a saliency that
    /// could reach `|s| > 0.5` with any current up to `hold_a` and any flux up to the flux of `hold_a`. (The largest
    /// `|s|` is the sum of the largest magnitudes of its two parts, because their directions are independent; the flux
    /// part grows with the flux.)
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(m: &MachineSettings, s: &SaliencySettings) -> Result<Self, PlantError> {
        m.check()?;
        s.check()?;
        let psi_n = s.psi_n.unwrap_or(0.7 * m.lm);
        check("saliency.psi_n", psi_n, 1e-4..=100.0, "Wb")?;
        refuse_singular(m, s, psi_n)?;

        let (ls, lr) = (m.lls + m.lm, m.llr + m.lm);
        let coupling = m.lm / lr;
        let sigma_ls = ls - m.lm * coupling;
        let pole_pairs = f64::from(m.pole_pairs);
        Ok(Self {
            pole_pairs,
            coupling,
            alpha: m.rr / lr,
            rr_coupling: m.rr * coupling,
            r_prime: m.rs + m.rr * coupling * coupling,
            sigma_ls,
            inv_sigma_ls: 1.0 / sigma_ls,
            lr,
            torque_factor: 1.5 * pole_pairs * coupling,
            two_a_psi: 2.0 * s.a_psi,
            b1: s.b1,
            hold_a: s.hold_a,
            psi_n_squared: psi_n * psi_n,
            half_chi_r: 0.5 * s.chi * m.rr * coupling * coupling,
            stator_fixed: Complex::cis(2.0 * s.stator_fixed_deg.to_radians()) * s.stator_fixed,
        })
    }

    /// Changes the resistances and keeps everything else.
    pub(crate) fn set_resistances(&mut self, rs: f64, rr: f64) {
        let coupling = self.coupling;
        self.half_chi_r *= rr / (self.alpha * self.lr);
        self.alpha = rr / self.lr;
        self.rr_coupling = rr * coupling;
        self.r_prime = rs + rr * coupling * coupling;
    }

    /// Torque per rotor flux and current across it, 3/2 P Lm/Lr, N m/(Wb A).
    pub fn torque_factor(&self) -> f64 {
        self.torque_factor
    }

    /// Transient inductance `sigma Ls`, H.
    pub fn sigma_ls(&self) -> f64 {
        self.sigma_ls
    }

    /// Rotor time constant `Lr/rr`, s.
    pub fn tau_r(&self) -> f64 {
        1.0 / self.alpha
    }

    /// Returns the saliency vector `s`: its magnitude is the relative saliency, half its angle the axis of low
    /// impedance.
    #[inline]
    pub fn saliency(&self, x: &MachineState) -> Complex {
        // (psi/psi_n)^2 2/(1 + r) = 2 psi^2 / (psi_n^2 + |psi|^2)
        let flux_part = self.two_a_psi / (self.psi_n_squared + square(x.psi));
        let length = square(x.i).sqrt();
        let current_part = if length > NO_CURRENT {
            let inverse = 1.0 / length;
            self.b1 * inverse.min(self.hold_a * inverse * inverse)
        } else {
            0.0
        };
        x.psi * x.psi * flux_part + x.i * x.i * current_part + self.stator_fixed
    }

    /// `(alpha - j w) psi`, the flux decay in the stator frame.
    #[inline]
    fn decay(&self, psi: Complex, w: f64) -> Complex {
        Complex::new(self.alpha * psi.re + w * psi.im, self.alpha * psi.im - w * psi.re)
    }

    /// Voltage that remains for the transient inductance, without the terminal voltage.
    #[inline]
    fn drive_voltage(&self, x: &MachineState, decay: Complex) -> Complex {
        let y = decay * self.coupling - x.i * self.r_prime;
        if self.half_chi_r == 0.0 {
            return y;
        }
        let h = x.i - x.i_lp;
        let flux = square(x.psi);
        let u = if flux > NO_FLUX_SQUARED { x.psi * x.psi / flux } else { Complex::ZERO };
        y - (h - u * h.conj()) * self.half_chi_r
    }

    /// Time derivative of the state, except for the current.
    #[inline]
    fn rest(&self, x: &MachineState, decay: Complex) -> MachineState {
        MachineState {
            i: Complex::ZERO,
            psi: x.i * self.rr_coupling - decay,
            i_lp: (x.i - x.i_lp) * CHI_CORNER,
        }
    }
}

impl MachineModel for Machine {
    type State = MachineState;

    #[inline]
    fn pole_pairs(&self) -> f64 {
        self.pole_pairs
    }

    /// Electromagnetic torque, N m: Eq. 4.4 in terms of stator current and rotor flux.
    #[inline]
    fn torque(&self, x: &MachineState) -> f64 {
        self.torque_factor * (x.psi.re * x.i.im - x.psi.im * x.i.re)
    }

    #[inline(always)]
    fn derivative(&self, x: &MachineState, v: Complex, w: f64) -> MachineState {
        let decay = self.decay(x.psi, w);
        let y = v + self.drive_voltage(x, decay);
        let s = self.saliency(x);
        let scale = self.inv_sigma_ls / (1.0 - square(s));
        MachineState { i: (y + s * y.conj()) * scale, ..self.rest(x, decay) }
    }

    fn derivative_on_line(
        &self,
        x: &MachineState,
        v_axis: f64,
        axis: Complex,
        w: f64,
    ) -> (MachineState, Complex) {
        let decay = self.decay(x.psi, w);
        let internal = self.drive_voltage(x, decay);
        let s = self.saliency(x);
        // A column of L x = sigma Ls (x - s x*), for x along the axis.
        let column = (axis - s * axis.conj()) * self.sigma_ls;
        let rate = (v_axis + dot(internal, axis)) / dot(column, axis);
        let rates = MachineState { i: axis * rate, ..self.rest(x, decay) };
        (rates, column * rate - internal)
    }

    fn derivative_open(&self, x: &MachineState, w: f64) -> (MachineState, Complex) {
        let decay = self.decay(x.psi, w);
        (self.rest(x, decay), -self.drive_voltage(x, decay))
    }

    fn with_current(&self, x: &MachineState, i: Complex) -> MachineState {
        MachineState { i, ..*x }
    }

    fn with_turned_flux(&self, x: &MachineState, turn: Complex) -> MachineState {
        MachineState { psi: x.psi * turn, ..*x }
    }
}
/// Refuses a saliency that could come near the singularity; see [`Machine::new`].
fn refuse_singular(
    m: &MachineSettings,
    s: &SaliencySettings,
    psi_n: f64,
) -> Result<(), PlantError> {
    let r = (m.lm * s.hold_a / psi_n).powi(2);
    let per_a_psi = 2.0 * r / (1.0 + r);
    let (flux_part, current_part) = (s.a_psi.abs() * per_a_psi, s.b1.abs() * s.hold_a);
    let saliency = flux_part + current_part + s.stator_fixed.abs();
    if saliency <= SALIENCY_LIMIT {
        return Ok(());
    }
    let (key, value, max, unit) = if flux_part > current_part {
        let rest = (SALIENCY_LIMIT - current_part).max(0.0);
        ("saliency.a_psi", s.a_psi, (rest / per_a_psi).min(0.25), "")
    } else {
        let rest = (SALIENCY_LIMIT - flux_part).max(0.0);
        ("saliency.b1", s.b1, rest / s.hold_a, "1/A")
    };
    Err(PlantError { key, value, min: -max, max, unit, saliency: Some(saliency) })
}
