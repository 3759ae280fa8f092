//! A drive without hardware: the firmware's own console and command arbiter, its drive and a simulated motor, in one program.
//!
//! [`board`] is the board, connected by the bytes of a serial port; [`machine`] its drive and motor; [`motors`] the motors to
//! choose from; [`around`] the changes around it; [`talk`] the messages with the page; [`loops`] the figures of the control loops. In a
//! browser this library is WebAssembly with the functions of `wasm.rs`; `cargo live --simulated` has the same board.
#![warn(missing_docs)]

pub mod around;
pub mod board;
pub mod loops;
pub mod machine;
pub mod motors;
pub mod talk;
#[cfg(target_family = "wasm")]
mod wasm;
