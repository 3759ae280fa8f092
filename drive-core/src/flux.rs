//! Angle of the rotor flux: from encoder and slip, or from the saliency measured with the carrier.

pub mod catch;
pub mod estimator;
pub mod hand_over;
pub mod indirect;
pub mod observer;
pub mod schedule;
pub mod tracker;
pub mod volts_per_hertz;
