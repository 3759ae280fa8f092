//! The encoder: TIM2 counts both edges of both tracks, 32 bits, wrapping.
//!
//! The index is not used: the flux angle needs no absolute position, and the drive detects lost counts
//! by itself (`Fault::Encoder`, and by the current that does not follow the voltage).

use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::{StartError, pins};
use crate::board;
use crate::boards::{SELECTED, pin};

/// The counter of the encoder.
pub struct Encoder {
    timer: pac::TIM2,
}

impl Encoder {
    /// Starts counting from 0. Track A leads when the rotor turns from phase a towards phase b.
    ///
    /// PA15 and PB3 belong to JTAG after reset; the two-wire debug port does not need them.
    pub fn new(timer: pac::TIM2, rcc: &mut Rcc) -> Result<Self, StartError> {
        clock_on!(rcc.apb1enr1(), tim2en, "TIM2")?;
        // No resistors of the chip: with them, the pins do not withstand the 5 V of a push-pull encoder (AN4899), and 40 kOhm are too
        // slow for an open collector. An open collector needs an external resistor of 1 to 4.7 kOhm to 3.3 V.
        let [a, b] = SELECTED.wiring.encoder;
        pins::alternate(a, a.function(pin::TIM2_CH1), None);
        pins::alternate(b, b.function(pin::TIM2_CH2), None);

        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1().ic1f().set(board::ENCODER_FILTER);
            w.cc2s().ti2().ic2f().set(board::ENCODER_FILTER)
        });
        // SAFETY: SMS is three bits wide; 3 is the encoder mode that counts every edge.
        timer.smcr().write(|w| unsafe { w.sms().bits(3) });
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.cr1().write(|w| w.cen().enabled());
        Ok(Self { timer })
    }

    /// The count, four per line.
    pub fn count(&self) -> u32 {
        self.timer.cnt().read().bits()
    }
}
