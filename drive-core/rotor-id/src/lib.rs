//! Rotor time constant of an induction motor while it runs: [`online`] estimates it from current and voltage by the recursive
//! least squares of [`rls`].
//!
//! Both run in the main loop, in single precision, on the measurements of the control step.
#![cfg_attr(not(test), no_std)]

extern crate induction_drive_core as drive_core;
extern crate induction_drive_settings as drive_settings;

pub mod online;
pub mod rls;
