//! What of the firmware touches no register: tested on a host, fuzzed there, and linked into the image.
//!
//! Start reading at `main.rs`.
#![cfg_attr(not(test), no_std)]
// They are made in constants, which `Default` cannot be.
#![allow(clippy::new_without_default)]

pub mod board;
pub mod console;
pub mod link;
pub mod mailbox;
pub mod memory_check;
pub mod record;
pub mod ring;
pub mod saved;
pub mod trace;
pub mod tracking;
pub mod watchdog;
