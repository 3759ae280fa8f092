//! Over-voltage protection without software: comparator 1 compares the pin of the dc link with a level from DAC3,
//! channel 1, inside the chip, and pulls the break of TIM1 (`pwm.rs`).
//!
//! The dc link is the only measured signal with a comparator of its own: the pins of both currents reach comparator 3
//! alone.

use cortex_m::asm;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use induction_drive::board;

/// Starts the comparator at the level of the converter code `level`, and locks it until the next reset.
pub fn watch(dac: &pac::DAC3, comparators: &pac::COMP, rcc: &mut Rcc, level: u16) {
    rcc.ahb2enr().modify(|_, w| w.dac3en().set_bit());
    rcc.apb2enr().modify(|_, w| w.syscfgen().enabled());
    dac.mcr().write(|w| {
        // Internal output, unbuffered.
        w.mode1().normal_chip_no_buffer();
        // SAFETY: two bits; 2 stands for bus clocks above 160 MHz.
        unsafe { w.hfsel().bits(2) }
    });
    dac.dhr12r1().write(|w| w.daccdhr().set(level));
    dac.cr().modify(|_, w| w.en1().set_bit());
    asm::delay(board::DAC_START_US * board::CYCLES_PER_US);

    comparators.c1csr().write(|w| {
        // SAFETY: three bits each; `board` keeps both inside.
        unsafe {
            w.inmsel().bits(board::COMP1_INVERTING_DAC3);
            w.hyst().bits(board::COMP_HYSTERESIS);
        }
        // The other input is the pin of the dc link (PA1); a high output means over-voltage.
        w.inpsel().clear_bit().pol().clear_bit().en().set_bit()
    });
    asm::delay(board::COMP_START_US * board::CYCLES_PER_US);
    comparators.c1csr().modify(|_, w| w.lock().set_bit());
}
