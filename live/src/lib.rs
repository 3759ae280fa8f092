//! `cargo live`: a local web page for the drive.
//!
//! [`drive`] talks to the console of the firmware, with the connection code of `cargo sim console`; [`server`] gives one
//! browser the page and a WebSocket; [`shared`] is what the two have in common; [`board`] starts the virtual board, [`simulated`]
//! one without hardware in this program.
#![warn(missing_docs)]

pub mod board;
pub mod drive;
pub mod server;
pub mod shared;
pub mod simulated;
