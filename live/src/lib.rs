//! `cargo live`: a local web page for the drive.
//!
//! [`drive`] talks to the console of the firmware, with the connection code of `cargo sim console`; [`server`] serves the page and a
//! WebSocket to one browser; [`shared`] is the state that both share; [`board`] starts the virtual board, [`simulated`] a board without
//! hardware in this program.
#![warn(missing_docs)]

pub mod board;
pub mod drive;
pub mod server;
pub mod shared;
pub mod simulated;
