//! The ADCs. ADC1 and ADC2 sample the currents a and b at the same instant, then current c if the board measures it, then dc link and
//! heat sink. TIM1 starts them once per period. The end of ADC2's sequence raises the control interrupt; ADC1 goes on with the chip's own
//! reference.
//!
//! Sensors in the lines can be sampled in the upper zero vector as well, where all high sides are on: each ADC does a regular conversion
//! half a period before the sequence. The counts of a current are then the sum of both conversions.

use cortex_m::asm;
use drive_core::Sample;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::adc1::RegisterBlock;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::{StartError, pins};
use crate::board;
use crate::boards::{Currents, SELECTED};

/// Events of the ADCs.
#[derive(Clone, Copy)]
pub struct AdcEvents {
    /// A current was outside its window since the last call.
    pub over_current: bool,
    /// The sequence of ADC2 has ended. An interrupt without it comes from an analog watchdog.
    pub ended: bool,
    /// All conversions that the counts need have taken place.
    pub complete: bool,
}

/// Flags of the register ISR: end of a regular and of an injected conversion, of the injected sequence, analog watchdog.
const EOC: u32 = 1 << 2;
const JEOC: u32 = 1 << 5;
const JEOS: u32 = 1 << 6;
const AWD1: u32 = 1 << 7;

/// The channel of the chip's own reference at ADC1.
const OWN_REFERENCE: u8 = 18;

/// Both ADCs.
pub struct Adc {
    one: pac::ADC1,
    two: pac::ADC2,
    /// Flags without which a conversion is missing; with [`EOC`] the currents are converted in the upper zero vector, too.
    needed: u32,
}

impl Adc {
    /// Sets both ADCs up, with the windows of their analog watchdogs; they wait for the trigger.
    ///
    /// # Errors
    /// An ADC did not finish a step in time.
    pub fn new(
        one: pac::ADC1,
        two: pac::ADC2,
        common: &pac::ADC12_COMMON,
        rcc: &mut Rcc,
        protection: &board::Protection,
    ) -> Result<Self, StartError> {
        let Currents { a, b, shunts } = SELECTED.currents;
        let c = shunts.map(|shunts| shunts.c);
        let (dc_link, heat_sink) = (SELECTED.dc_link.pin, SELECTED.heat_sink);
        for pin in [a.pin, b.pin, dc_link, heat_sink].into_iter().chain(c.map(|c| c.pin)) {
            pins::analog(pin);
        }

        clock_on!(rcc.ahb2enr(), adc12en, "ADC12")?;
        // See board::ADC_CLOCK_DIVIDER.
        common.ccr().write(|w| w.ckmode().sync_div4().vrefen().enabled());
        if !common.ccr().read().ckmode().is_sync_div4() {
            return Err("the ADCs have no clock");
        }
        // `boards` has checked that each pin reaches its ADC. Channel 0 is not one of them.
        let channels = |first: Option<u8>, slow: Option<u8>, last| {
            [first, c.and_then(|c| c.pin.adc1()), slow, last].map(|channel| channel.unwrap_or(0))
        };
        let own = Some(OWN_REFERENCE);
        prepare(&one, channels(a.pin.adc1(), dc_link.adc1(), own), protection.window_a)?;
        prepare(&two, channels(b.pin.adc2(), heat_sink.adc2(), None), protection.window_b)?;
        one.smpr2().write(|w| w.smp18().set(board::REFERENCE_SAMPLING.code));
        // Up to dc link and heat sink both sequences take the same time, so one interrupt, of the shorter, is enough. The analog
        // watchdogs interrupt earlier, when the current is converted.
        one.ier().write(|w| w.awd1ie().enabled());
        two.ier().write(|w| w.jeosie().enabled().awd1ie().enabled());
        for converter in [&*one, &*two] {
            converter.cr().modify(|_, w| w.jadstart().start_conversion());
        }
        Ok(Self { one, two, needed: JEOC })
    }

    /// Sets whether the currents are converted in the upper zero vector, too, from the next one on.
    #[inline(always)] // the control interrupt calls it, and nothing in the CCM may call into the flash
    pub fn convert_both(&mut self, both: bool) {
        if both == (self.needed & EOC != 0) {
            return;
        }
        self.needed ^= EOC;
        for converter in [&*self.one, &*self.two] {
            converter.cr().modify(|_, w| {
                if both { w.adstart().start_conversion() } else { w.adstp().stop_conversion() }
            });
        }
    }

    /// The events of both converters; clears those of the analog watchdogs.
    #[inline] // into the control interrupt
    pub fn take_events(&mut self) -> AdcEvents {
        let (one, two) = (self.one.isr().read().bits(), self.two.isr().read().bits());
        let over_current = (one | two) & AWD1 != 0;
        if over_current {
            self.one.isr().write(|w| w.awd1().clear());
            self.two.isr().write(|w| w.awd1().clear());
        }
        let complete = one & two & self.needed == self.needed;
        AdcEvents { over_current, ended: two & JEOS != 0, complete }
    }

    /// Reads the ADC counts of the period: currents a, b and c (0 if the board does not measure it), dc link, heat sink. Clears the
    /// interrupt request. With both zero vectors the counts of a and b are sums.
    pub fn read(&mut self) -> Sample {
        // Cleared before the data are read: a sequence that ends after this line raises a new request.
        self.two.isr().write(|w| w.jeoc().clear().jeos().clear());
        let data = |rank| {
            let (one, two) = (self.one.jdr(rank).read().jdata(), self.two.jdr(rank).read().jdata());
            (one.bits(), two.bits())
        };
        let (mut current_a, mut current_b) = data(0);
        if self.needed & EOC != 0 {
            // Each read clears the EOC of its ADC.
            current_a = current_a.wrapping_add(self.one.dr().read().rdata().bits());
            current_b = current_b.wrapping_add(self.two.dr().read().rdata().bits());
        }
        let third = SELECTED.currents.shunts.is_some();
        let current_c = if third { self.one.jdr(1).read().jdata().bits() } else { 0 };
        let (dc_link, heat_sink) = data(if third { 2 } else { 1 });
        Sample { current_a, current_b, current_c, dc_link, heat_sink, ..Sample::default() }
    }

    /// Ends the period: the chip's own reference has been converted, and the next sequence of ADC1 can be told from this one.
    pub fn close(&mut self) {
        self.one.isr().write(|w| w.jeoc().clear());
    }
}

/// Powers an ADC, calibrates and enables it.
///
/// # Errors
/// The ADC did not finish a step in time.
pub fn power_up(adc: &RegisterBlock) -> Result<(), StartError> {
    adc.cr().modify(|_, w| w.deeppwd().disabled());
    adc.cr().modify(|_, w| w.advregen().enabled());
    asm::delay(board::ADC_REGULATOR_START_US * board::CYCLES_PER_US);

    adc.cr().modify(|_, w| w.adcaldif().single_ended().adcal().start_calibration());
    wait_for(|| !adc.cr().read().adcal().bit()).ok_or("an ADC does not calibrate")?;
    // At least four ADC clocks between the calibration and the next step.
    asm::delay(8 * board::ADC_CLOCK_DIVIDER);

    adc.isr().write(|w| w.adrdy().clear());
    // Set again until the ADC is ready: the logic of the calibration may still clear the bit (`stm32g4xx_hal_adc.c`).
    wait_for(|| {
        adc.cr().modify(|_, w| w.aden().enabled());
        adc.isr().read().adrdy().bit()
    })
    .ok_or("an ADC does not start")
}

/// Sets an ADC up: power, calibration, sequence, in the order of RM0440. The channels (0: none) are its own current, current c, its slow
/// signal, and the chip's own reference. Both ADCs convert current c, so that both sequences take the same time up to the slow signal.
fn prepare(
    adc: &RegisterBlock,
    channels: [u8; 4],
    (low, high): (u16, u16),
) -> Result<(), StartError> {
    power_up(adc)?;
    let (current, ranks) = (channels[0], || channels.into_iter().filter(|channel| *channel != 0));
    let times = [board::CURRENT_SAMPLING, board::CURRENT_SAMPLING, board::SLOW_SAMPLING];
    for (channel, time) in channels.into_iter().zip(times).filter(|(channel, _)| *channel != 0) {
        // Channels 1 to 9: all that a board can have.
        adc.smpr1().modify(|_, w| w.smp(channel).set(time.code));
    }
    // The first conversion after the calibration may be wrong (ES0430, 2.7.7 and 2.7.8): a regular one, thrown away.
    // SAFETY: five bits, an existing channel; a sequence of one.
    adc.sqr1().write(|w| unsafe { w.sq1().bits(current) });
    adc.cr().modify(|_, w| w.adstart().start_conversion());
    wait_for(|| adc.isr().read().eoc().bit()).ok_or("an ADC does not start")?;
    // Its EOC flag stays set, for the first period.
    adc.isr().write(|w| w.eosmp().clear().eos().clear());

    // The analog watchdog interrupts at the first count outside the window.
    // SAFETY: twelve bits each, from codes of twelve bits.
    adc.tr1().write(|w| unsafe { w.lt1().bits(low).ht1().bits(high) });
    // The watchdog checks the current only. No queue of sequences: the sequence below never changes. The regular conversion is one of the
    // current again, at the rising edge of trigger output 2 of TIM1; with several edges in a period the last conversion counts.
    // SAFETY: five bits, an existing channel.
    adc.cfgr().modify(|_, w| unsafe {
        w.awd1ch().bits(current).awd1sgl().set_bit().awd1en().set_bit().jawd1en().set_bit();
        w.jqdis().set_bit().ovrmod().set_bit().extsel().tim1_trgo2().exten().rising_edge()
    });
    adc.jsqr().write(|w| {
        for (rank, channel) in (0..4).zip(ranks()) {
            // SAFETY: five bits, an existing channel.
            unsafe { w.jsq(rank).bits(channel) };
        }
        // Coded less one. Trigger: rising edge of trigger output 1 of TIM1.
        w.jl().set(ranks().count() as u8 - 1).jextsel().tim1_trgo().jexten().rising_edge()
    });
    Ok(())
}

/// ADC counts of the chip's own reference, now and in the factory. For the main loop.
pub fn own_reference() -> (u16, u16) {
    // Its rank is after the dc link.
    let rank = if SELECTED.currents.shunts.is_some() { 3 } else { 2 };
    let factory = board::REFERENCE_CALIBRATION as *const u16;
    // SAFETY: the ADC always exists, and only a result is read; read-only memory of the chip, aligned.
    unsafe { ((*pac::ADC1::ptr()).jdr(rank).read().jdata().bits(), factory.read_volatile()) }
}

/// Waits until `done`, for [`board::ADC_TIMEOUT_US`] at most.
fn wait_for(done: impl Fn() -> bool) -> Option<()> {
    for _ in 0..board::ADC_TIMEOUT_US {
        if done() {
            return Some(());
        }
        asm::delay(board::CYCLES_PER_US);
    }
    None
}
