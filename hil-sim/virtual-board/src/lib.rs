//! Runs the flashed ELF on an emulated Cortex-M4F with modelled STM32G474 registers, and closes the loop with the
//! simulated inverter, motor and sensors of `hil-sim`.
//!
//! The emulator is Unicorn, inside [`cpu::Cpu`]. It is GPL-2.0: this crate reads the ELF, nothing that is shipped links
//! it, and its binaries are never distributed.
//!
//! # Extent of the model
//! * Registers that the firmware uses ([`periph`], [`scs`]); an access to any other register fails the run with the
//!   address and the place in the source.
//! * Time: an instruction in the flash takes one cycle (no wait states), one in CCM as many as [`cost`] counts.
//!   Exceptions are taken between instructions in the flash and at the end of the control interrupt's blocks; entry and
//!   exit take no time.
//! * Exceptions with priorities, nesting and masks; one stack; no traps for unaligned accesses and divisions by zero.
//!   The MPU is modelled with a region in RAM without any access, of 4 KiB at most. Bus faults are taken at once and
//!   become hard faults, as in the firmware.
//! * Oscillators and PLL are ready at once; ADCs, DACs and comparators take their time.
//! * Accesses that the chip would drop or process wrongly without an error are recorded and fail the run ([`rules`]):
//!   clocks of peripherals, voltage range, wait states, locks, order and times of ADCs, busy registers, pins. A debugger
//!   can halt the core ([`chip::debugger`]); the supply can sag ([`chip::Chip::set_supply`]).
//! * The gates are those after the drivers of a [`power_stage`]: levels follow from pins, timer and resistors, and are
//!   judged whenever one of them may change. Transients within a dead time are not modelled.
//! * The motor is advanced between the tops of the PWM counter. If outputs go off between two of them, they take effect
//!   at that time, with the mean voltage of the period until then. There is no model for a bridge of which only some
//!   legs are driven: such a bridge counts as off at the motor, but not in the judgement at the gates.
//! * Shunts show the mean current of the period between two tops, and after a top its slope in the zero vector; the
//!   ripple of the other vectors is not modelled.

/// Defines a structure with default values for its fields; a field without one has the default of its type.
macro_rules! defaults {
    (@value) => { Default::default() };
    (@value $value:expr) => { $value };
    ($(#[$about:meta])* $seen:vis struct $name:ident {
        $($(#[$meaning:meta])* $from:vis $field:ident: $kind:ty $(= $value:expr)?,)*
    }) => {
        $(#[$about])*
        $seen struct $name {
            $($(#[$meaning])* $from $field: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: defaults!(@value $($value)?)),* }
            }
        }
    };
}

pub mod addresses;
pub mod board;
pub mod campaign;
pub mod chip;
pub mod cost;
pub mod cpu;
pub mod cycles;
pub mod dump;
pub mod image;
pub mod interactive;
pub mod log;
pub mod memory;
pub mod pair;
pub mod periph;
pub mod power_stage;
pub mod rules;
pub mod scs;
pub mod shadow;
pub mod time;

pub use board::{Board, Options, Period};
pub use cpu::Counting;
pub use image::Image;
pub use pair::Pair;
pub use power_stage::PowerStage;
pub use shadow::Shadow;
