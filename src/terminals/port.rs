//! The pins of the terminals, and the slow analog inputs at ADC3 and ADC4.
//!
//! ADC3 and ADC4 convert them without an interrupt, once a pulse of TIM1. A conversion of one ADC disturbs one of another that does not
//! begin with it (ES0430, 2.7.9), so TIM1 starts them behind its 0, where no current is sampled, and they end before its top. The pause
//! from one to the next is too short for the errors of ES0430, 2.7.7 and 2.7.8.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::adc1::RegisterBlock;
use stm32g4xx_hal::rcc::Rcc;

use crate::board;
use crate::boards::pin::Pin;
use crate::boards::{ANALOG, CONTACTS, Level, SELECTED};
use crate::chip::clocks::clock_on;
use crate::chip::{StartError, adc, pins};
use crate::terminals::{Contacts, Port};

/// Pins of the analog inputs, of the contacts, and of the outputs.
const INPUTS: &[Option<Pin>] = SELECTED.terminals.pins.split_at(ANALOG).0;
const OTHERS: &[Option<Pin>] = SELECTED.terminals.pins.split_at(ANALOG).1;
const CONTACT: &[Option<Pin>] = OTHERS.split_at(CONTACTS).0;
const OUTPUTS: &[Option<Pin>] = OTHERS.split_at(CONTACTS).1;
const CLOSED_AT: Level = SELECTED.terminals.closed_at;

// They begin when the signal of channel 6 has fallen, and end before the currents are sampled at the top, with three pulses as well.
const _: () = {
    let slow = ANALOG as u32 * (board::REFERENCE_SAMPLING.ticks() + board::CONVERSION.ticks());
    assert!(2 * board::UPPER_SAMPLE_AT + slow < board::PWM_TOP as u32 / 3);
};

/// The pins of the terminals.
pub struct Pins {
    converters: (pac::ADC3, pac::ADC4),
    codes: [Option<u16>; ANALOG],
}

/// The inputs of ADC3 (0) or ADC4 (1), in the order in which it converts them: each with its channel.
fn inputs(converter: u8) -> impl Iterator<Item = (usize, u8)> {
    INPUTS.iter().enumerate().filter_map(move |(input, pin)| {
        let (reached, channel) = (*pin)?.adc34()?;
        (reached == converter).then_some((input, channel))
    })
}

impl Pins {
    /// Sets pins and ADCs up. An input whose ADC does not start has no ADC counts.
    pub fn new(
        three: pac::ADC3,
        four: pac::ADC4,
        common: &pac::ADC345_COMMON,
        rcc: &mut Rcc,
    ) -> Self {
        let open = if CLOSED_AT == Level::Low { Level::High } else { Level::Low };
        CONTACT.iter().flatten().for_each(|pin| pins::pulled_input(*pin, open));
        OUTPUTS.iter().flatten().for_each(|pin| pins::output(*pin, Level::Low));
        INPUTS.iter().flatten().for_each(|pin| pins::analog(*pin));
        let port = Self { converters: (three, four), codes: [None; ANALOG] };
        if let Err(why) = port.start(common, rcc) {
            defmt::error!("reference and motor sensor have no ADC: {=str}", why);
        }
        port
    }

    fn converters(&self) -> [(u8, &RegisterBlock); 2] {
        [(0, &*self.converters.0), (1, &*self.converters.1)]
    }

    fn start(&self, common: &pac::ADC345_COMMON, rcc: &mut Rcc) -> Result<(), StartError> {
        clock_on!(rcc.ahb2enr(), adc345en, "ADC345")?;
        common.ccr().write(|w| w.ckmode().sync_div4());
        for (converter, adc) in self.converters() {
            let Some(last) = inputs(converter).count().checked_sub(1) else { continue };
            adc::power_up(adc)?;
            for (_, channel) in inputs(converter) {
                adc.smpr1().modify(|_, w| w.smp(channel).set(board::REFERENCE_SAMPLING.code));
            }
            adc.cfgr().modify(|_, w| w.jqdis().set_bit());
            // The signal of channel 6 falls behind 0, see `board::UPPER_SAMPLE_AT`.
            adc.jsqr().write(|w| {
                for (rank, (_, channel)) in (0..).zip(inputs(converter)) {
                    // SAFETY: five bits, an existing channel.
                    unsafe { w.jsq(rank).bits(channel) };
                }
                w.jl().set(last as u8).jextsel().tim1_trgo2().jexten().falling_edge()
            });
            adc.cr().modify(|_, w| w.jadstart().start_conversion());
        }
        Ok(())
    }

    /// Takes the results of the last conversions; there are none if no sequence has ended since the last call.
    fn take_codes(&mut self) {
        let mut codes = [None; ANALOG];
        for (converter, adc) in self.converters() {
            let ended = adc.isr().read().jeos().bit();
            adc.isr().write(|w| w.jeos().clear());
            for (rank, (input, _)) in inputs(converter).enumerate() {
                codes[input] = ended.then(|| adc.jdr(rank).read().jdata().bits());
            }
        }
        self.codes = codes;
    }
}

impl Port for Pins {
    fn look(&mut self) -> Contacts {
        self.take_codes();
        let high = CLOSED_AT == Level::High;
        let closed = |pin: &Option<Pin>| pin.is_some_and(|pin| pins::is_high(pin) == high);
        let inputs = CONTACT.iter().enumerate();
        Contacts(inputs.fold(0, |bits, (n, pin)| bits | u8::from(closed(pin)) << n))
    }

    fn codes(&self) -> [Option<u16>; ANALOG] {
        self.codes
    }

    fn show(&mut self, outputs: [bool; 3]) {
        for (pin, active) in OUTPUTS.iter().zip(outputs) {
            let level = if active { Level::High } else { Level::Low };
            pin.iter().for_each(|pin| pins::set(*pin, level));
        }
    }
}
