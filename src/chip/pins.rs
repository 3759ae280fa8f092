//! Pins as data: a board names its pins, so their types are not known to the compiler.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::gpioc::RegisterBlock;

use crate::boards::Level;
use crate::boards::pin::{Pin, Port};

/// The registers of a port.
fn registers(port: Port) -> &'static RegisterBlock {
    let address = match port {
        Port::A => pac::GPIOA::ptr() as *const RegisterBlock,
        Port::B => pac::GPIOB::ptr() as *const RegisterBlock,
        Port::C => pac::GPIOC::ptr(),
    };
    // SAFETY: the ports exist for as long as the chip does and have the same registers; only bits of pins that a board
    // names are changed, during start-up, in one context.
    unsafe { &*address }
}

/// Fields of MODER.
const INPUT: u32 = 0b00;
const OUTPUT: u32 = 0b01;
const ALTERNATE: u32 = 0b10;
const ANALOG: u32 = 0b11;

/// Connects a pin with a peripheral: the function and the resistor first, so that the pin never shows another level.
///
/// `pull`: the level of the chip's own resistor, if it is on.
pub fn alternate(pin: Pin, function: u8, pull: Option<Level>) {
    let port = registers(pin.port);
    let (shift, bits) = (4 * u32::from(pin.number % 8), u32::from(function));
    let set = |old: u32| old & !(0xf << shift) | bits << shift;
    if pin.number < 8 {
        // SAFETY: four bits of one pin; `boards::pin` holds existing functions.
        port.afrl().modify(|r, w| unsafe { w.bits(set(r.bits())) });
    } else {
        // SAFETY: as above.
        port.afrh().modify(|r, w| unsafe { w.bits(set(r.bits())) });
    }
    resistor(pin, pull);
    mode(pin, ALTERNATE);
}

/// Makes a pin an analog input, without a resistor.
pub fn analog(pin: Pin) {
    mode(pin, ANALOG);
    resistor(pin, None);
}

/// Makes a pin an input that the chip's own resistor pulls.
pub fn pulled_input(pin: Pin, pull: Level) {
    resistor(pin, Some(pull));
    mode(pin, INPUT);
}

/// Makes a pin an output: the level first, so that it never shows another.
pub fn output(pin: Pin, level: Level) {
    set(pin, level);
    mode(pin, OUTPUT);
}

/// Whether a pin is high.
pub fn is_high(pin: Pin) -> bool {
    registers(pin.port).idr().read().bits() >> pin.number & 1 == 1
}

/// Sets the level of an output, from any context: one write.
#[inline(always)] // the control interrupt calls it, and nothing in the CCM may call into the flash
pub fn set(pin: Pin, level: Level) {
    let shift = u32::from(pin.number) + if level == Level::Low { 16 } else { 0 };
    // SAFETY: the bit that sets or resets one pin.
    registers(pin.port).bsrr().write(|w| unsafe { w.bits(1 << shift) });
}

fn mode(pin: Pin, mode: u32) {
    let shift = 2 * u32::from(pin.number);
    // SAFETY: two bits of one pin, each value a mode.
    registers(pin.port)
        .moder()
        .modify(|r, w| unsafe { w.bits(r.bits() & !(3 << shift) | mode << shift) });
}

fn resistor(pin: Pin, pull: Option<Level>) {
    let shift = 2 * u32::from(pin.number);
    let bits = match pull {
        None => 0,
        Some(Level::High) => 1,
        Some(Level::Low) => 2,
    };
    // SAFETY: two bits of one pin, each value but 3 a resistor.
    registers(pin.port)
        .pupdr()
        .modify(|r, w| unsafe { w.bits(r.bits() & !(3 << shift) | bits << shift) });
}
