//! The angle of the rotor flux: from the encoder, or from the saliency that the carrier sees.

pub mod estimator;
pub mod indirect;
pub mod schedule;
pub mod tracker;
