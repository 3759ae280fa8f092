//! The converters: ADC1 and ADC2 sample both phase currents at the same instant, then dc link and
//! heat sink, started by TIM1 once per period. The end of the sequence raises the control interrupt.

use cortex_m::asm;
use stm32g4xx_hal::gpio::{Analog, PA0, PA1, PC1, PC2};
use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::adc1::RegisterBlock;
use stm32g4xx_hal::rcc::Rcc;

use induction_drive::board;

/// The pins of the converters.
pub struct Pins {
    /// Current a.
    pub current_a: PA0<Analog>,
    /// Current b.
    pub current_b: PC1<Analog>,
    /// Dc link.
    pub dc_link: PA1<Analog>,
    /// Heat sink.
    pub heat_sink: PC2<Analog>,
}

/// A step that a converter did not finish in time.
#[derive(Clone, Copy, defmt::Format)]
pub enum AdcTimeout {
    /// Its calibration.
    Calibration,
    /// Its start.
    Enabling,
}

/// Codes of one period.
#[derive(Clone, Copy)]
pub struct Codes {
    /// Current a.
    pub current_a: u16,
    /// Current b.
    pub current_b: u16,
    /// Dc link.
    pub dc_link: u16,
    /// Heat sink.
    pub heat_sink: u16,
}

/// Events of the converters.
#[derive(Clone, Copy)]
pub struct AdcEvents {
    /// A current was outside its window since the last call.
    pub over_current: bool,
    /// The sequence of ADC1 has ended. An interrupt without it comes from an analog watchdog.
    pub ended: bool,
    /// The sequences of both have ended.
    pub complete: bool,
}

/// Both converters.
pub struct Adc {
    one: pac::ADC1,
    two: pac::ADC2,
}

impl Adc {
    /// Sets both converters up, with the windows of their analog watchdogs; they wait for the trigger.
    ///
    /// # Errors
    /// A converter did not finish a step in time.
    pub fn new(
        one: pac::ADC1,
        two: pac::ADC2,
        common: &pac::ADC12_COMMON,
        pins: Pins,
        rcc: &mut Rcc,
        protection: &board::Protection,
    ) -> Result<Self, AdcTimeout> {
        pins.current_a.into_analog();
        pins.current_b.into_analog();
        pins.dc_link.into_analog();
        pins.heat_sink.into_analog();

        rcc.ahb2enr().modify(|_, w| w.adc12en().enabled());
        // See board::ADC_CLOCK_DIVIDER.
        common.ccr().write(|w| w.ckmode().sync_div4());
        prepare(&one, board::ADC1_CHANNELS, protection.window_a)?;
        prepare(&two, board::ADC2_CHANNELS, protection.window_b)?;
        // Both sequences take the same time, so one interrupt at their end is enough. The analog watchdogs
        // interrupt earlier, when the current is converted.
        one.ier().write(|w| w.jeosie().enabled().awd1ie().enabled());
        two.ier().write(|w| w.awd1ie().enabled());
        for converter in [&*one, &*two] {
            converter.cr().modify(|_, w| w.jadstart().start_conversion());
        }
        Ok(Self { one, two })
    }

    /// The events of both converters; clears those of the analog watchdogs.
    pub fn take_events(&mut self) -> AdcEvents {
        let (one, two) = (self.one.isr().read(), self.two.isr().read());
        let over_current = one.awd1().bit() || two.awd1().bit();
        if over_current {
            self.one.isr().write(|w| w.awd1().clear());
            self.two.isr().write(|w| w.awd1().clear());
        }
        let ended = one.jeos().bit();
        AdcEvents { over_current, ended, complete: ended && two.jeos().bit() }
    }

    /// The codes of the sequence that has just ended; clears the interrupt request.
    pub fn read(&mut self) -> Codes {
        // Before the data are read: a sequence that ends from here on raises a new request.
        self.one.isr().write(|w| w.jeoc().clear().jeos().clear());
        self.two.isr().write(|w| w.jeoc().clear().jeos().clear());
        Codes {
            current_a: self.one.jdr1().read().jdata().bits(),
            current_b: self.two.jdr1().read().jdata().bits(),
            dc_link: self.one.jdr2().read().jdata().bits(),
            heat_sink: self.two.jdr2().read().jdata().bits(),
        }
    }
}

/// Sets a converter up: power, calibration, sequence, in the order of RM0440.
fn prepare(
    adc: &RegisterBlock,
    (current, slow): (u8, u8),
    (low, high): (u16, u16),
) -> Result<(), AdcTimeout> {
    adc.cr().modify(|_, w| w.deeppwd().disabled());
    adc.cr().modify(|_, w| w.advregen().enabled());
    asm::delay(board::ADC_REGULATOR_START_US * board::CYCLES_PER_US);

    adc.cr().modify(|_, w| w.adcaldif().single_ended().adcal().start_calibration());
    wait_for(|| !adc.cr().read().adcal().bit()).ok_or(AdcTimeout::Calibration)?;
    // At least four converter clocks between the calibration and the next step.
    asm::delay(8 * board::ADC_CLOCK_DIVIDER);

    adc.isr().write(|w| w.adrdy().clear());
    adc.cr().modify(|_, w| w.aden().enabled());
    wait_for(|| adc.isr().read().adrdy().bit()).ok_or(AdcTimeout::Enabling)?;

    for (channel, time) in [(current, board::CURRENT_SAMPLING), (slow, board::SLOW_SAMPLING)] {
        // Channels 0 to 9: all that are used.
        adc.smpr1().modify(|_, w| w.smp(channel).set(time.code));
    }
    // The analog watchdog interrupts at the first code outside the window.
    // SAFETY: twelve bits each, from codes of twelve bits.
    adc.tr1().write(|w| unsafe { w.lt1().bits(low).ht1().bits(high) });
    // It checks the current alone. No queue of sequences: the one below never changes.
    // SAFETY: five bits, an existing channel.
    adc.cfgr().modify(|_, w| unsafe {
        w.awd1ch().bits(current).awd1sgl().set_bit().jawd1en().set_bit().jqdis().set_bit()
    });
    adc.jsqr().write(|w| {
        // SAFETY: five bits each, existing channels.
        unsafe { w.jsq1().bits(current).jsq2().bits(slow) };
        // Length 2, coded as 1; trigger: rising edge of trigger output 2 of TIM1.
        w.jl().set(1).jextsel().tim1_trgo2().jexten().rising_edge()
    });
    Ok(())
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
