//! Angle of the rotor flux: from encoder and slip, or from the saliency measured by injection.

pub(crate) mod angle_filter;
pub(crate) mod catch;
mod covariance;
pub(crate) mod estimator;
pub(crate) mod hand_over;
pub(crate) mod indirect;
pub(crate) mod observer;
mod printed_settings;
pub(crate) mod schedule;
pub(crate) mod tracker;
pub(crate) mod volts_per_hertz;

pub use angle_filter::AngleFilter;
pub use catch::{FlyingStart, Path};
pub use estimator::{AngleLoop, Estimator, FilterLoop};
pub use hand_over::Turning;
pub use indirect::{Indirect, TAU_R_LIMITS};
pub use observer::{Leakage, Observer};
pub use printed_settings::PrintedSettings;
pub use schedule::GainSchedule;
pub use tracker::Axis;
pub use volts_per_hertz::{VoltsPerHertz, VoltsPerHertzSettings};

/// Source of the flux angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum AngleSource {
    /// Encoder and slip, Eq. 2.10.
    Encoder,
    /// The injection, without a sensor on the shaft.
    Injection,
}
