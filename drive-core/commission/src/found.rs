//! Results of the steps, and the settings that follow from them.

use super::fit::Fitted;
use drive_core::{FirstOrder, Motor};
use drive_settings::{CurrentPlant, Flux, IdentifiedPlant, PlantSource, Settings};

/// Phase margin of the speed loop for a shaft that rings: with the lower crossover the couplings no longer oscillate that do with the
/// default on motors with a large slip per ampere (experiment `shaft`: 1.2 instead of 15 % of torque noise on `krause-3hp`, 1.6 instead of
/// 23 % on `spindle-2kw2`).
const MARGIN_OF_RINGING_DEG: f32 = 70.0;

/// Results of the steps; `None` for a step that has not been done or was refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Noise of the noisier current sensor, A rms.
    pub noise: Option<f32>,
    /// Dc link, V.
    pub dc_link: Option<f32>,
    /// Transient inductance from the pulses, H: up to 60 % too large.
    pub rough: Option<f32>,
    /// Resistances and rotor.
    pub levels: Option<Levels>,
    /// Transient inductance and saliency.
    pub leakage: Option<Leakage>,
    /// Motor whose main flux saturates, from the magnetising-curve test: `l_m` is the chord of the magnetising curve at the
    /// magnetising current.
    pub iron: Option<Motor>,
    /// Plants of the current loop along the d axis and the q axis, A/V, from the pseudo-random voltage.
    pub plants: Option<[FirstOrder; 2]>,
    /// Inertia of rotor and load, kg m^2.
    pub inertia: Option<f32>,
    /// Whether the shaft rings after an impulse of torque, as with an elastic coupling.
    pub rings: bool,
}

/// Result of the dc current levels: parameters of the inverse-Gamma circuit, of the inverter and of the sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// Rotor resistance as the stator sees it, (L_m/L_r)^2 r_r, ohm.
    pub r_r: f32,
    /// Rotor time constant, s.
    pub tau_r: f32,
    /// Voltage error of a phase of the inverter, V: dead time and forward voltages.
    pub inverter_v: f32,
    /// Relative difference of the currents of phases b and c at dc, (-i_a)/(2 i_b) - 1, due to sensors and resistances.
    pub difference: f32,
    /// (gain of sensor a)/(gain of b) - 1; 0 until the injection has shown it.
    pub mismatch: f32,
    /// Whether the main flux saturates. Then `r_r` and `tau_r` belong to no circuit.
    pub saturates: bool,
}

/// Result of the injection.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leakage {
    /// Transient inductance sigma L_s, H.
    pub inductance: f32,
    /// Leakage inductance of the fundamental wave at no current, H.
    pub fundamental: f32,
    /// Change of that inductance per peak ampere, H/A.
    pub slope: f32,
}

impl Levels {
    /// Returns the coupled magnetising inductance L_M = (L_m/L_r) L_m, H.
    pub fn coupled(&self) -> f32 {
        self.tau_r * self.r_r
    }

    pub(super) fn new(fit: &Fitted) -> Self {
        let Fitted { r_s, r_r, tau_r, e, difference, .. } = *fit;
        Self { r_s, r_r, tau_r, inverter_v: 0.75 * e, difference, ..Self::default() }
    }

    /// Returns the result corrected for this gain mismatch, as all impedances were divided by the current of sensor a.
    pub(super) fn with_mismatch(self, mismatch: f32) -> Self {
        let gain = (1.0 + 0.5 * mismatch) / (1.0 + 0.5 * self.mismatch);
        Self { r_s: self.r_s * gain, r_r: self.r_r * gain, mismatch, ..self }
    }
}

impl Found {
    /// Returns the motor as a T circuit with equal leakages and the default pole pairs. `None` until the
    /// levels and the leakage are found and, if the main flux saturates, the magnetising curve.
    pub fn motor(&self) -> Option<Motor> {
        let (levels, leakage) = (self.levels?, self.leakage?);
        if levels.saturates {
            return self.iron;
        }
        let coupled = levels.coupled();
        let k = 1.0 / fpu_sqrt::sqrtf(1.0 + leakage.inductance / coupled);
        let l_ls = leakage.inductance / (1.0 + k);
        let (r_s, r_r, l_m) = (levels.r_s, levels.r_r / (k * k), coupled / k);
        Some(Motor { r_s, r_r, l_m, l_ls, l_lr: l_ls, ..Motor::default() })
    }

    /// Returns these settings with the results in them.
    pub(super) fn settings(&self, settings: &Settings, pole_pairs: u8) -> Settings {
        let mut new = *settings;
        new.inertia = self.inertia.or(settings.inertia);
        if self.rings {
            new.speed.phase_margin_deg = MARGIN_OF_RINGING_DEG;
        }
        let (Some(levels), Some(leakage)) = (self.levels, self.leakage) else { return new };
        let Some(motor) = self.motor() else { return new };
        new.motor = Motor { pole_pairs, ..motor };
        let half = 0.5 * levels.mismatch;
        new.scales.current_a = new.scales.current_a.scaled(1.0 / (1.0 + half));
        new.scales.current_b = new.scales.current_b.scaled(1.0 + half);
        new.current_plant.source = PlantSource::Motor;
        if let Some(plants) = self.plants {
            let set =
                |FirstOrder { k, p }| IdentifiedPlant { k: Some(k as f32), p: Some(p as f32) };
            let [d, q] = plants.map(set);
            new.current_plant = CurrentPlant { source: PlantSource::Identified, d, q };
        }
        let per = 1.0 / new.motor.sigma_l_s();
        new.observer.leakage_share = leakage.fundamental * per;
        new.observer.leakage_slope = leakage.slope * per;
        // The magnetising current follows from the rule for this motor.
        (new.sequence.flux, new.sequence.i_d) = (Flux::High, None);
        let of_dead_time = settings.inverter.dead_time_s / settings.inverter.carrier_s()
            * self.dc_link.unwrap_or(0.0);
        new.inverter.drop_v = Some(levels.inverter_v - of_dead_time);
        new
    }
}
