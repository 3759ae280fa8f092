//! Supervision of the control from the main loop: its memory, its registers, its rate, and the reason why the last run ended.

pub mod memory_check;
pub mod record;
pub mod register_check;
pub mod watchdog;
