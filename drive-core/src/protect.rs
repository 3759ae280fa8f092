//! Protections: checks of sensors, wiring, saliency and lock. Each raises a fault.

pub mod lock_monitor;
pub mod noise_watch;
pub mod offsets;
pub mod plausibility;
pub mod saliency_check;
pub mod thermal;
pub mod wiring_check;
