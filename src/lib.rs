//! The hardware-independent part of the firmware: tested and fuzzed on a host, and linked into the image.
//!
//! Start reading at `main.rs`.
#![cfg_attr(not(test), no_std)]
// They are made in constants, which `Default` cannot be.
#![allow(clippy::new_without_default)]

pub mod board;
pub mod console;
pub mod link;
pub mod monitor;
pub mod rotor_tracking;
pub mod store;
