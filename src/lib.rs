//! The hardware-independent part of the firmware: tested and fuzzed on a host, and linked into the image.
//!
//! Start reading at `main.rs`.
#![cfg_attr(not(test), no_std)]
// `new` is used in constants, where `Default` is not available.
#![allow(clippy::new_without_default)]

pub mod board;
pub mod boards;
pub mod commissioning;
pub mod console;
pub mod desk;
pub mod front;
mod hash;
pub mod link;
pub mod modbus;
pub mod monitor;
pub mod rotor_tracking;
pub mod settings;
pub mod store;
pub mod strip;
pub mod terminals;

// The fuzz targets share a file of the tests, which names the library from outside.
#[cfg(test)]
extern crate self as induction_drive;
#[cfg(test)]
#[path = "../tests/common/generated.rs"]
mod generated;
