//! The peripherals of the microcontroller. Their numbers come from the board.

pub mod adc;
pub mod clocks;
pub mod dc_link;
pub mod encoder;
pub mod flash;
pub mod memory;
pub mod over_voltage;
pub mod pins;
pub mod pwm;
pub mod sleep;
pub mod stage;
pub mod start;
pub mod stop;
pub mod time;
pub mod watchdog;
pub mod window;

/// The lowest priority of an interrupt, that of the serial ports. Only the four upper bits are implemented (datasheet).
pub const LOWEST_PRIORITY: u8 = 0xf0;

/// Reason why the drive is not started, in words: for the log and the console.
pub type StartError = &'static str;
