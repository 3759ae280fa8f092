//! What `drive-core` computes outside its control step: the design of its controllers in `f64`, and
//! numbers as text.
//!
//! A crate of its own because of the microcontroller: nothing here is in a hurry, and there it is
//! compiled for size, while the control step is compiled for speed. Use it through `drive_core`,
//! which has everything in here under its own name.
#![cfg_attr(not(test), no_std)]

pub mod complex;
pub mod decimal;
pub mod elementary;
pub mod section;
pub mod tuning;
