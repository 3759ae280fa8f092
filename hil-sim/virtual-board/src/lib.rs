//! Runs the flashed ELF on an emulated Cortex-M4F with modelled STM32G474 registers, and closes the loop with the
//! simulated inverter, motor and sensors of `hil-sim`.
//!
//! The chip is that of the crate [`stm32g4_unicorn`], which describes the extent of its model. It links Unicorn, which is
//! GPL-2.0: this crate reads the ELF, nothing that is shipped links it, and its binaries are never distributed.
//!
//! # Extent of the model
//! * An access to a register that is not modelled fails the run with the address and the place in the source; so does a
//!   broken rule of the chip ([`stm32g4_unicorn::rules`]).
//! * Exceptions are taken between instructions in the flash and at the end of the control interrupt's blocks. Bus faults
//!   are taken at once and become hard faults, as in the firmware.
//! * The gates are those after the drivers of a [`power_stage`]: levels follow from pins, timer and resistors, and are
//!   judged whenever one of them may change. Transients within a dead time are not modelled.
//! * The motor is advanced between the tops of the PWM counter. If outputs go off between two of them, they take effect
//!   at that time, with the mean voltage of the period until then. There is no model for a bridge of which only some
//!   legs are driven: such a bridge counts as off at the motor, but not in the judgement at the gates. (A gate that stays
//!   off behind its driver is modelled by the plant.)
//! * Shunts show the mean current of the period between two tops, and after a top its slope in the zero vector; the
//!   ripple of the other vectors is not modelled.

pub mod addresses;
pub mod board;
pub mod faults;
pub mod image;
pub mod interactive;
pub mod log;
pub mod power_stage;
pub mod shadow;

pub use board::{Board, Options, Period};
pub use image::Image;
pub use power_stage::PowerStage;
pub use shadow::Shadow;
pub use stm32g4_unicorn::Counting;
