//! Over-voltage protection without software: comparator 1 or 3 compares the pin of the dc link with a level from DAC3,
//! channel 1, inside the chip, and pulls the break of TIM1 (`pwm.rs`).
//!
//! On the connector of ST the dc link is the only measured signal with a comparator of its own: the pins of both currents reach comparator
//! 3 only.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::asm;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::pwm::Pwm;
use super::{StartError, pins};
use crate::board;
use crate::boards::{Level, SELECTED};

/// The comparator has tripped by a voltage at its pin.
static PROVED: AtomicBool = AtomicBool::new(false);
/// Reason why no motor is switched on before the comparator has tripped.
pub const UNPROVED: StartError = "self-test: the over-voltage comparator does not trip at the level zero; with a sensor that drives its pin: dc link above a tenth of the range first";

/// The register of the comparator.
fn csr(comparators: &pac::comp::RegisterBlock) -> &pac::comp::CCSR {
    comparators.ccsr(2 * usize::from(board::COMPARATOR.0))
}

/// Starts the comparator and locks it at `level`, in ADC counts, until the next reset. Proves before that it pulls the break of the
/// timer, and that it does not at `level`. The outputs are off. The comparator has to trip at the level zero as well; if a sensor drives
/// the pin to ground against the chip's resistor, [`prove`] shows that later with a dc link.
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
    clock_on!(rcc.apb2enr(), syscfgen, "self-test: comparator")?;
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

    let csr = csr(comparators);
    csr.write(|w| {
        // SAFETY: three bits each; `board` keeps both inside.
        unsafe {
            w.inmsel().bits(board::COMP_INVERTING_DAC3);
            w.hyst().bits(board::COMP_HYSTERESIS);
        }
        // The other input is the pin of the dc link; a high output means over-voltage.
        w.inpsel().bit(board::COMPARATOR.1 == 1).pol().clear_bit().en().set_bit()
    });
    asm::delay(board::COMP_START_US * board::CYCLES_PER_US);

    let filtered = || {
        asm::delay(board::BREAK_FILTER_NS * board::CYCLES_PER_US / 1000 + board::CYCLES_PER_US);
    };
    // Without a dc link its pin is at ground, and so is the level zero: the chip's resistor lifts the pin and charges a capacitor there.
    pins::pulled_input(SELECTED.dc_link.pin, Level::High);
    // An earlier break, of the fault input for example, does not count.
    pwm.take_break();
    set(0);
    let trips = (0..board::LIFT_US).any(|_| {
        asm::delay(board::CYCLES_PER_US);
        csr.read().value().bit()
    });
    filtered();
    let mut broken = pwm.take_break();
    pins::analog(SELECTED.dc_link.pin);
    set(level);
    if !trips {
        // The opposite polarity shows that the signal reaches the break.
        pwm.take_break();
        csr.modify(|_, w| w.pol().set_bit());
        filtered();
        broken = pwm.take_break();
        csr.modify(|_, w| w.pol().clear_bit());
        filtered();
    }
    pwm.take_break();
    filtered();
    let trips_again = csr.read().value().bit();
    csr.modify(|_, w| w.lock().set_bit());
    if !broken {
        Err("self-test: the over-voltage comparator does not reach the break of TIM1")
    } else if trips_again {
        Err(
            "self-test: the over-voltage comparator trips at its own level: dc link too high, its wire off, or no level",
        )
    } else {
        PROVED.store(trips, Ordering::Relaxed);
        Ok(())
    }
}

/// Whether the comparator works. With a dc link (ADC counts) this tests it: it has to trip at half of the dc link, and not at its own level
/// afterwards. Without one the last test counts. For a drive that is off, before each start.
pub fn prove(dc_link: u16) -> bool {
    if dc_link >= board::COMPARABLE {
        // SAFETY: both always exist. After `watch` only this function writes the level; it only reads the comparator.
        let (dac, comparators) = unsafe { (&*pac::DAC3::ptr(), &*pac::COMP::ptr()) };
        let level = dac.dhr12r1().read().daccdhr().bits();
        let trips_at = |code: u16| {
            dac.dhr12r1().write(|w| w.daccdhr().set(code));
            asm::delay(board::DAC_START_US * board::CYCLES_PER_US);
            csr(comparators).read().value().bit()
        };
        PROVED.store(trips_at(dc_link / 2) & !trips_at(level), Ordering::Relaxed);
    }
    PROVED.load(Ordering::Relaxed)
}
