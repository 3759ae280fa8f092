//! The tasks of the firmware: start-up, the control interrupt, and the main loop's side of the drive.

pub mod bring_up;
pub mod check;
pub mod clock;
pub mod control;
pub mod sources;
pub mod supervisor;
