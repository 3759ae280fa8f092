//! Identification on the drive itself: the reference of the angle tracking, and the rotor time constant.

pub mod learning;
pub mod online;
pub mod rls;
