//! The encoder: TIM2 counts both edges of both tracks, 32 bits, wrapping.
//!
//! The index is not used: the flux angle needs no absolute position, and the drive detects lost counts
//! by itself (`Fault::Encoder`, and by the current that does not follow the voltage).

use stm32g4xx_hal::gpio::{Debugger, PA15, PB3, Pull};
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use induction_drive::board;

/// The counter of the encoder.
pub struct Encoder {
    timer: pac::TIM2,
}

impl Encoder {
    /// Starts counting from 0. Track A is PA15, track B is PB3; A leads when the rotor turns from
    /// phase a towards phase b.
    ///
    /// Both pins belong to JTAG after reset; the two-wire debug port does not need them.
    pub fn new(timer: pac::TIM2, a: PA15<Debugger>, b: PB3<Debugger>, rcc: &mut Rcc) -> Self {
        rcc.apb1enr1().modify(|_, w| w.tim2en().enabled());
        // Pulled up, for encoders with open collectors.
        a.into_alternate::<{ board::ENCODER_AF }>().set_internal_resistor(Pull::Up);
        b.into_alternate::<{ board::ENCODER_AF }>().set_internal_resistor(Pull::Up);

        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1().ic1f().set(board::ENCODER_FILTER);
            w.cc2s().ti2().ic2f().set(board::ENCODER_FILTER)
        });
        // SAFETY: SMS is three bits wide; 3 is the encoder mode that counts every edge.
        timer.smcr().write(|w| unsafe { w.sms().bits(3) });
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.cr1().write(|w| w.cen().enabled());
        Self { timer }
    }

    /// The count, four per line.
    pub fn count(&self) -> u32 {
        self.timer.cnt().read().bits()
    }
}
