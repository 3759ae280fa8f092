//! Supervision of the control from the main loop: its memory, its rate, and why the last run ended.

pub mod memory_check;
pub mod record;
pub mod watchdog;
