//! The peripherals of the microcontroller. Their numbers come from the board.

pub mod adc;
pub mod clocks;
pub mod encoder;
pub mod flash;
pub mod memory;
pub mod over_voltage;
pub mod pwm;
pub mod serial;
pub mod stop;
pub mod watchdog;
