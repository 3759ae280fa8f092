//! The pins of the terminals, and the slow analog inputs at ADC3 and ADC4.
//!
//! The main loop converts one of these inputs each millisecond, without an interrupt and without ADC1 and ADC2. A conversion long after
//! the previous one may be wrong (ES0430, 2.7.7 and 2.7.8), so each is done twice, and the second result counts. All registers of a
//! conversion are written before it, so a flipped bit affects one conversion at most.

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

/// The pins of the terminals.
pub struct Pins {
    three: pac::ADC3,
    four: pac::ADC4,
    codes: [Option<u16>; ANALOG],
    /// The input that is being converted.
    at: usize,
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
        let port = Self { three, four, codes: [None; ANALOG], at: 0 };
        if let Err(why) = port.start(common, rcc) {
            defmt::error!("reference and motor sensor have no ADC: {=str}", why);
        }
        port
    }

    fn start(&self, common: &pac::ADC345_COMMON, rcc: &mut Rcc) -> Result<(), StartError> {
        if INPUTS.iter().all(Option::is_none) {
            return Ok(());
        }
        clock_on!(rcc.ahb2enr(), adc345en, "ADC345")?;
        common.ccr().write(|w| w.ckmode().sync_div4());
        adc::power_up(&self.three)?;
        adc::power_up(&self.four)
    }

    /// Takes the result of the input that was being converted, and begins with the next input.
    fn convert(&mut self) {
        if let Some((adc, _)) = self.converter(self.at) {
            let ended = adc.isr().read().eos().bit();
            self.codes[self.at] = ended.then(|| adc.dr().read().rdata().bits());
        }
        self.at = (self.at + 1) % ANALOG;
        let Some((adc, channel)) = self.converter(self.at) else { return };
        adc.isr().write(|w| w.eos().clear());
        adc.cfgr().write(|w| w.ovrmod().set_bit());
        adc.smpr1().write(|w| w.smp(channel).set(board::REFERENCE_SAMPLING.code));
        // SAFETY: five bits each, an existing channel; the length is coded less one.
        adc.sqr1().write(|w| unsafe { w.l().bits(1).sq1().bits(channel).sq2().bits(channel) });
        adc.cr().modify(|_, w| w.adstart().start_conversion());
    }

    /// ADC and channel of an input, if the board has the input.
    fn converter(&self, input: usize) -> Option<(&RegisterBlock, u8)> {
        let (converter, channel) = INPUTS[input]?.adc34()?;
        Some((if converter == 0 { &*self.three } else { &*self.four }, channel))
    }
}

impl Port for Pins {
    fn look(&mut self) -> Contacts {
        self.convert();
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
