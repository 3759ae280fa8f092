//! What the steps have found, and the settings that follow from it.

use super::levels::Fitted;
use crate::settings::{PlantSource, Settings};

/// What the steps have found; `None` for a step that has not been done or was refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Noise of the current sensors, A rms: the larger of both.
    pub noise: Option<f32>,
    /// Transient inductance by the pulses, H: up to 60 % too large.
    pub rough: Option<f32>,
    /// Resistances and rotor.
    pub levels: Option<Levels>,
    /// Transient inductance and saliency.
    pub leakage: Option<Leakage>,
}

/// Result of the current levels: parameters of the inverse-Gamma circuit, inverter, sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// Rotor resistance as the stator sees it, (L_m/L_r)^2 r_r, ohm.
    pub r_r: f32,
    /// Rotor time constant, s.
    pub tau_r: f32,
    /// Voltage that a phase of the inverter loses, V: dead time and drop.
    pub inverter_v: f32,
    /// Dc link at which that holds, V.
    pub dc_link_v: f32,
    /// (gain of sensor a)/(gain of b) - 1.
    pub mismatch: f32,
}

/// Result of the carrier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leakage {
    /// Transient inductance sigma L_s, H.
    pub inductance: f32,
    /// Saliency at standstill, (across - along)/(across + along), with half the test current along phase a.
    pub saliency: f32,
}

impl Levels {
    /// Coupled magnetising inductance L_M = (L_m/L_r) L_m, H.
    pub fn coupled(&self) -> f32 {
        self.tau_r * self.r_r
    }

    pub(super) fn new(fit: &Fitted, mismatch: f32, dc_link_v: f32) -> Self {
        // Impedances were divided by the current of sensor a.
        let gain = 1.0 + 0.5 * mismatch;
        Self {
            r_s: fit.r_s * gain,
            r_r: fit.r_r * gain,
            tau_r: fit.tau_r,
            inverter_v: 0.75 * fit.e,
            dc_link_v,
            mismatch,
        }
    }
}

impl Found {
    /// These settings with what has been found. The inverse-Gamma circuit becomes that of a T with equal leakages.
    pub(super) fn settings(&self, settings: &Settings, pole_pairs: u8) -> Settings {
        let mut new = *settings;
        let (Some(levels), Some(leakage)) = (self.levels, self.leakage) else { return new };
        let coupled = levels.coupled();
        let k = 1.0 / libm::sqrtf(1.0 + leakage.inductance / coupled);
        let motor = &mut new.motor;
        motor.r_s = levels.r_s;
        motor.r_r = levels.r_r / (k * k);
        motor.l_m = coupled / k;
        motor.l_ls = leakage.inductance / (1.0 + k);
        motor.l_lr = motor.l_ls;
        motor.pole_pairs = pole_pairs;
        let half = 0.5 * levels.mismatch;
        new.scales.current_a = new.scales.current_a.scaled(1.0 / (1.0 + half));
        new.scales.current_b = new.scales.current_b.scaled(1.0 + half);
        new.current_plant.source = PlantSource::Motor;
        new
    }
}
