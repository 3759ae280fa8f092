//! What experiments without a position sensor have in common.

use crate::config::{Config, plant_settings};

/// An error beyond this, degrees, is a lost angle: half way to where the saliency, which repeats
/// every 180°, has the wrong sign.
pub const LOST_DEG: f64 = 45.0;

/// Assumptions of the simulated plant, for the remarks of an outcome.
pub fn assumptions(config: &Config) -> Vec<String> {
    let (s, motor) = (plant_settings(config).saliency, config.motor_text());
    vec![format!(
        "Simulated motor: {motor}, with a flux-fixed saliency of {:.2} % at nominal flux and {:.2} \
         %/A by the current. Nothing in the source measures the saliency: every angle error here is a \
         statement about this simulated motor.",
        s.a_psi * 100.0,
        s.b1 * 100.0
    )]
}
