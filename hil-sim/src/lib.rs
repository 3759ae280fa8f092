//! The motor, inverter and sensors that the drive is tested against, and the experiments.
pub mod plant;
