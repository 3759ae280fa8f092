//! The induction machine from one magnetic energy ("energy model").
//!
//! Saliency is not assumed: it emerges from the saturation of the main flux, of the leakage inductances and of the
//! teeth. All vectors are complex, in the stator frame. With the currents `i` and `i_r` of [`magnetics`], electrical
//! rotor speed `w` and mechanical rotor angle `theta_m`:
//!
//! ```text
//! ds/dt = v - rs i                  dr/dt = -r1 (i_r - i_2) + j w r
//! dd/dt = -r2 i_2 + j w d           i_2   = (d - r)/Lb            bottom of the bars
//! de/dt = -Re (e - m)/Le                                          eddy currents of the iron
//! Te    = -3/2 P Im(r* (i_r - i_2) + d* i_2) - 3/2 dW/dtheta_m    explicit: rotor slots
//! ```
//!
//! The ladder network of the bar has `r1 = K rr` on the gap side, and `r2 = rr K/(K - 1)` and `Lb = Lx/(1 - 1/K)^2`
//! below it. The rotor shows `rr` and the whole rotor leakage at slip frequency, and K times `rr` and the leakage minus
//! `Lx` at high frequency. Without skin effect only `dr/dt = -rr i_r + j w r` remains. The eddy currents have a leakage
//! `Le = Re 100 us`, so the iron loss follows the square of the frequency up to 1.6 kHz. Hysteresis, space harmonics
//! and the iron loss by the ripple of the PWM edges are not modelled.
//!
//! Within an integration step, main flux, current and the axis of the slots are integrated by their exact rates. At the
//! end of the step main flux and current are solved for. At the start of a period the slots are set to the angle of the
//! rotor.

mod family;
mod magnetics;
mod settings;
mod state;

pub use family::{FAMILIES, Family};
pub use settings::IronSettings;
pub use state::{EnergyRate, EnergyState};

use magnetics::{Leakage, Magnetics, MainFlux, Teeth};

use crate::complex::{Complex, dot, square};
use crate::error::PlantError;
use crate::machine::MachineSettings;
use crate::model::MachineModel;

/// Time constant of the eddy currents, s.
const EDDY_LAG: f64 = 100e-6;
/// Corner of the lag behind which a load rotates the axis of the teeth, rad/s: far below an injection frequency.
const LOAD_CORNER: f64 = std::f64::consts::TAU * 20.0;
/// Number of corrections that set a current; each one squares the error.
const CURRENT_STEPS: u32 = 8;

/// Coefficients of the energy model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyMachine {
    magnetics: Magnetics,
    rs: f64,
    rr: f64,
    /// Resistances of the gap side and of the bottom of the bars divided by `rr`; the latter is 0 without skin effect.
    top: f64,
    bottom: f64,
    /// 1/Lb.
    inverse_bar: f64,
    /// 1/Le times Re, 1/s.
    eddy_rate: f64,
    pole_pairs: f64,
    lm: f64,
    lr: f64,
}

impl EnergyMachine {
    /// Makes the machine with these settings.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(m: &MachineSettings, iron: &IronSettings) -> Result<Self, PlantError> {
        m.check()?;
        iron.check_in(m)?;
        let pole_pairs = f64::from(m.pole_pairs);
        let (ls, lr) = (m.lls + m.lm, m.llr + m.lm);
        let relative = (ls - m.lm * m.lm / lr) / (m.lls * m.lls);
        let unsaturated = if iron.chord { m.lm * iron.saturation } else { m.lm };
        let knee = (iron.saturation - 1.0).powf(1.0 / f64::from(iron.exponent)) / iron.psi_n;
        let chord = unsaturated / iron.saturation;
        let skin = iron.skin_ratio > 1.0;
        let share = 1.0 - 1.0 / iron.skin_ratio;
        let outside = m.llr - if skin { iron.skin_leakage } else { 0.0 };
        let bar = iron.skin_leakage / (share * share);
        let eddy = if iron.loss > 0.0 { 1.0 / (iron.loss * EDDY_LAG) } else { 0.0 };
        Ok(Self {
            magnetics: Magnetics {
                stator: Leakage::new(m.lls, iron.nominal_a, iron.leakage_saturation),
                rotor: Leakage::new(outside, iron.nominal_a, iron.rotor_leakage_saturation),
                main: MainFlux {
                    inverse: 1.0 / unsaturated,
                    inverse_knee: knee,
                    exponent: iron.exponent as i32,
                },
                teeth: (iron.teeth != 0.0).then(|| Teeth {
                    twice: 2.0 * iron.teeth * relative,
                    knee_squared: iron.psi_n * iron.psi_n,
                    gap: iron.teeth_gap,
                    turn: iron.teeth_turn_deg.to_radians(),
                    turn_per_a: iron.teeth_turn_deg_per_a.to_radians(),
                    load: 0.0,
                    conservative: iron.conservative(),
                }),
                fixed: Complex::cis(2.0 * iron.stator_fixed_deg.to_radians())
                    * (iron.stator_fixed * relative),
                slots: iron.slots * relative,
                bars: f64::from(iron.bars) / pole_pairs,
                eddy,
            },
            rs: m.rs,
            rr: m.rr,
            top: iron.skin_ratio,
            bottom: if skin { 1.0 / share } else { 0.0 },
            inverse_bar: if skin { 1.0 / bar } else { 0.0 },
            eddy_rate: if eddy > 0.0 { 1.0 / EDDY_LAG } else { 0.0 },
            pole_pairs,
            lm: chord,
            lr: chord + m.llr,
        })
    }

    /// Changes the resistances and keeps everything else.
    pub(crate) fn set_resistances(&mut self, rs: f64, rr: f64) {
        (self.rs, self.rr) = (rs, rr);
    }

    /// Returns the machine with this current across the rotor flux, A, as the load that rotates the axis of its teeth.
    #[must_use]
    pub fn with_load(mut self, across: f64) -> Self {
        if let Some(teeth) = &mut self.magnetics.teeth {
            teeth.load = across;
        }
        self
    }

    /// Whether the bars have a bottom with its own flux.
    pub fn has_skin_effect(&self) -> bool {
        self.inverse_bar != 0.0
    }

    /// Whether the iron has losses.
    pub fn has_iron_loss(&self) -> bool {
        self.eddy_rate != 0.0
    }

    /// Torque per rotor flux and current across it, 3/2 P Lm/Lr, N m/(Wb A), at the nominal flux.
    pub fn torque_factor(&self) -> f64 {
        1.5 * self.pole_pairs * self.lm / self.lr
    }

    /// Rotor time constant `Lr/rr` at the nominal flux, s.
    pub fn tau_r(&self) -> f64 {
        self.lr / self.rr
    }

    /// Magnetic energy, J.
    pub fn energy(&self, x: &EnergyState) -> f64 {
        let bar = 0.5 * self.inverse_bar * square(x.psi_deep - x.psi_r);
        1.5 * (bar + self.magnetics.energy([x.psi_s, x.psi_r, x.psi_iron], x.theta, x.main_flux()))
    }

    /// Power turned into heat in stator, rotor and iron, W.
    pub fn losses(&self, x: &EnergyState) -> f64 {
        let (top, bottom) = self.bar_currents(x);
        let iron = square(x.psi_iron - x.main_flux()) * self.magnetics.eddy * self.eddy_rate;
        let rotor = self.rr * (self.top * square(top) + self.bottom * square(bottom));
        1.5 * (self.rs * square(x.solution.i) + rotor + iron)
    }

    /// Currents of top and bottom of the bars, A.
    #[inline(always)]
    fn bar_currents(&self, x: &EnergyState) -> (Complex, Complex) {
        let bottom = (x.psi_deep - x.psi_r) * self.inverse_bar;
        (x.solution.i_r - bottom, bottom)
    }

    /// Computes the derivative as `derivative` does, without the rates of the dependent quantities.
    #[inline(always)]
    fn flux_rates(&self, x: &EnergyState, v: Complex, w: f64) -> EnergyRate {
        let (top, bottom) = self.bar_currents(x);
        let turning = |psi: Complex| Complex::new(-w * psi.im, w * psi.re);
        let deep = self.inverse_bar != 0.0;
        EnergyRate {
            psi_s: v - x.solution.i * self.rs,
            psi_r: turning(x.psi_r) - top * (self.rr * self.top),
            psi_deep: if deep {
                turning(x.psi_deep) - bottom * (self.rr * self.bottom)
            } else {
                Complex::ZERO
            },
            psi_iron: (x.solution.m - x.psi_iron) * self.eddy_rate,
            theta: w,
            slots: turning(x.solution.slots) * self.magnetics.bars,
            ..EnergyRate::default()
        }
    }

    /// Adds the rates of main flux and current to those of the fluxes.
    #[inline(always)]
    fn completed(&self, x: &EnergyState, mut k: EnergyRate) -> EnergyRate {
        let fluxes = [k.psi_s, k.psi_r, k.psi_iron];
        let turned = k.slots * (x.psi_s - x.solution.m).conj();
        (k.m, k.i) = self.magnetics.rates(&x.solution.slopes, fluxes, turned);
        k
    }

    /// Change of the current for a change of the stator flux, everything else constant.
    #[inline]
    fn current_by_flux(&self, x: &EnergyState, d: Complex) -> Complex {
        self.magnetics.rates(&x.solution.slopes, [d, Complex::ZERO, Complex::ZERO], Complex::ZERO).1
    }

    /// Change of the stator flux that changes the current by `d`.
    fn flux_for_current(&self, x: &EnergyState, d: Complex) -> Complex {
        let (a, b) = (
            self.current_by_flux(x, Complex::new(1.0, 0.0)),
            self.current_by_flux(x, Complex::new(0.0, 1.0)),
        );
        let scale = 1.0 / (a.re * b.im - a.im * b.re);
        Complex::new(d.re * b.im - d.im * b.re, a.re * d.im - a.im * d.re) * scale
    }
}

impl MachineModel for EnergyMachine {
    type State = EnergyState;

    #[inline]
    fn pole_pairs(&self) -> f64 {
        self.pole_pairs
    }

    #[inline]
    fn torque(&self, x: &EnergyState) -> f64 {
        let (top, bottom) = self.bar_currents(x);
        let cross = |a: Complex, b: Complex| a.re * b.im - a.im * b.re;
        let torque = -self.pole_pairs * (cross(x.psi_r, top) + cross(x.psi_deep, bottom));
        if self.magnetics.slots == 0.0 {
            return 1.5 * torque;
        }
        let leakage = x.psi_s - x.solution.m;
        let slots = cross(leakage * leakage, x.solution.slots);
        1.5 * (torque + 0.5 * self.magnetics.bars * self.pole_pairs * slots)
    }

    #[inline(always)]
    fn derivative(&self, x: &EnergyState, v: Complex, w: f64) -> EnergyRate {
        self.completed(x, self.flux_rates(x, v, w))
    }

    fn derivative_on_line(
        &self,
        x: &EnergyState,
        v_axis: f64,
        axis: Complex,
        w: f64,
    ) -> (EnergyRate, Complex) {
        let normal = axis * Complex::i();
        let k = self.derivative(x, axis * v_axis, w);
        let by_normal = self.current_by_flux(x, normal);
        let v_normal = -dot(k.i, normal) / dot(by_normal, normal);
        let v = axis * v_axis + normal * v_normal;
        (self.derivative(x, v, w), v)
    }

    fn derivative_open(&self, x: &EnergyState, w: f64) -> (EnergyRate, Complex) {
        let k = self.derivative(x, Complex::ZERO, w);
        let v = self.flux_for_current(x, -k.i);
        (self.derivative(x, v, w), v)
    }

    #[inline]
    fn after_step(&mut self, x: &EnergyState, h: f64) {
        if let Some(teeth) = self.magnetics.teeth.as_mut().filter(|t| t.turn_per_a != 0.0) {
            let flux = square(x.psi_r).sqrt().max(1e-9);
            let across = (x.psi_r.conj() * x.solution.i).im / flux;
            teeth.load += (across - teeth.load) * (LOAD_CORNER * h).min(1.0);
        }
    }

    fn with_current(&self, x: &EnergyState, i: Complex) -> EnergyState {
        let mut x = *x;
        for _ in 0..CURRENT_STEPS {
            let missing = i - x.solution.i;
            if square(missing) < 1e-24 {
                break;
            }
            x.psi_s += self.flux_for_current(&x, missing);
            self.settle(&mut x);
        }
        // Exactly, so that a current of zero is exactly zero.
        x.solution.i = i;
        x
    }

    fn with_turned_flux(&self, x: &EnergyState, turn: Complex) -> EnergyState {
        let mut turned = EnergyState { psi_r: x.psi_r * turn, psi_deep: x.psi_deep * turn, ..*x };
        self.settle(&mut turned);
        self.with_current(&turned, x.solution.i)
    }

    #[inline]
    fn turn(&self, x: &mut EnergyState) {
        x.solution.slots = self.magnetics.slot_vector(x.theta);
    }

    #[inline]
    fn finish(&self, x: &mut EnergyState) {
        self.magnetics.solve([x.psi_s, x.psi_r, x.psi_iron], &mut x.solution);
    }

    /// Keeps main flux and current as integrated.
    #[inline]
    fn correct(&self, x: &mut EnergyState) {
        let i = x.solution.i;
        self.magnetics.evaluate([x.psi_s, x.psi_r, x.psi_iron], &mut x.solution);
        x.solution.i = i;
    }
}
