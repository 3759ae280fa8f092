//! The board for people and scripts: a pseudo-terminal as its serial port, the log on the terminal, and a page with
//! plots at the end.
#![deny(clippy::use_debug)]

pub mod flash_file;
pub mod own;
pub mod page;
pub mod pty;
pub mod record;
pub mod script;
pub mod session;
pub mod transcript;
