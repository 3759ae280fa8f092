//! Identification on the drive itself: learning with locked shaft, and the rotor time constant online.

pub mod learning;
pub mod online;
pub mod rls;
