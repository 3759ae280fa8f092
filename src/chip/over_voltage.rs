//! Over-voltage protection without software: comparator 1 compares the pin of the dc link with a level from DAC3,
//! channel 1, inside the chip, and pulls the break of TIM1 (`pwm.rs`).
//!
//! The dc link is the only measured signal with a comparator of its own: the pins of both currents reach comparator 3
//! alone.

use cortex_m::asm;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::pwm::Pwm;
use super::{StartError, pins};
use induction_drive::board;
use induction_drive::boards::{Level, SELECTED};

/// Starts the comparator, proves that it pulls the break of the timer at the level zero and does not at the converter
/// code `level`, and locks it there until the next reset. The outputs are off.
///
/// # Errors
/// The first step of the proof that fails.
pub fn watch(
    dac: &pac::DAC3,
    comparators: &pac::COMP,
    rcc: &mut Rcc,
    pwm: &mut Pwm,
    level: u16,
) -> Result<(), StartError> {
    clock_on!(rcc.ahb2enr(), dac3en, "self-test: DAC3")?;
    clock_on!(rcc.apb2enr(), syscfgen, "self-test: COMP1")?;
    let set = |code: u16| {
        dac.dhr12r1().write(|w| w.daccdhr().set(code));
        asm::delay(board::DAC_START_US * board::CYCLES_PER_US);
    };
    // The data first, then the mode, then the enable.
    dac.dhr12r1().write(|w| w.daccdhr().set(level));
    dac.mcr().write(|w| {
        // Internal output, unbuffered.
        w.mode1().normal_chip_no_buffer();
        // SAFETY: two bits; 2 stands for bus clocks above 160 MHz.
        unsafe { w.hfsel().bits(2) }
    });
    dac.cr().modify(|_, w| w.en1().set_bit());
    asm::delay(board::DAC_START_US * board::CYCLES_PER_US);
    if !dac.sr().read().dac1rdy().bit() {
        return Err("self-test: DAC3 is not ready");
    }

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

    // Without a dc link its pin is at ground, as the level zero is: the resistor of the chip lifts it.
    pins::pulled_input(SELECTED.dc_link.pin, Level::High);
    // An earlier break, of the fault input for example, does not count.
    pwm.take_break();
    set(0);
    let (trips, broken) = (comparators.c1csr().read().value().bit(), pwm.take_break());
    pins::analog(SELECTED.dc_link.pin);
    set(level);
    pwm.take_break();
    asm::delay(board::BREAK_FILTER_NS * board::CYCLES_PER_US / 1000 + board::CYCLES_PER_US);
    let trips_again = comparators.c1csr().read().value().bit();
    comparators.c1csr().modify(|_, w| w.lock().set_bit());
    if !trips {
        Err("self-test: the over-voltage comparator does not trip at the level zero")
    } else if !broken {
        Err("self-test: the over-voltage comparator does not reach the break of TIM1")
    } else if trips_again {
        Err(
            "self-test: the over-voltage comparator trips at its own level: dc link too high, its wire off, or no level",
        )
    } else {
        Ok(())
    }
}
