//! Protections: checks of sensors, wiring, saliency and lock. Each raises a fault.

pub(crate) mod heat_sink;
pub(crate) mod lock_monitor;
pub(crate) mod noise_watch;
pub(crate) mod offsets;
pub(crate) mod plausibility;
pub(crate) mod saliency_check;
pub(crate) mod thermal;
pub(crate) mod travel_watch;
pub(crate) mod wiring_check;

pub use heat_sink::HeatSink;
pub use lock_monitor::LockMonitor;
pub use noise_watch::NoiseWatch;
pub use offsets::OffsetCheck;
pub use plausibility::Prediction;
pub use saliency_check::SaliencyCheck;
pub use thermal::{Body, Thermal};
pub use travel_watch::TravelWatch;
pub use wiring_check::{WiringCheck, WiringSettings};
