//! The converters: ADC1 and ADC2 sample the currents a and b at the same instant, then current c if the board measures it,
//! then dc link and heat sink, started by TIM1 once per period. The end of the sequence raises the control interrupt.

use cortex_m::asm;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::adc1::RegisterBlock;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::{StartError, pins};
use induction_drive::board;
use induction_drive::boards::SELECTED;

/// Codes of one period.
#[derive(Clone, Copy)]
pub struct Codes {
    /// Current a.
    pub current_a: u16,
    /// Current b.
    pub current_b: u16,
    /// Current c; 0 if the board does not measure it.
    pub current_c: u16,
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

/// The channel of the chip's own reference at ADC1.
const OWN_REFERENCE: u8 = 18;

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
        rcc: &mut Rcc,
        protection: &board::Protection,
    ) -> Result<Self, StartError> {
        let [a, b] = SELECTED.currents.a_and_b();
        let c = SELECTED.currents.c();
        let (dc_link, heat_sink) = (SELECTED.dc_link.pin, SELECTED.heat_sink);
        for pin in [a.pin, b.pin, dc_link, heat_sink].into_iter().chain(c.map(|c| c.pin)) {
            pins::analog(pin);
        }

        clock_on!(rcc.ahb2enr(), adc12en, "ADC12")?;
        // See board::ADC_CLOCK_DIVIDER.
        common.ccr().write(|w| w.ckmode().sync_div4().vrefen().enabled());
        if !common.ccr().read().ckmode().is_sync_div4() {
            return Err("the converters have no clock");
        }
        // `boards` has checked that each pin reaches its converter. Channel 0 is not one of them.
        let channels = |first: Option<u8>, slow: Option<u8>| {
            [first, c.and_then(|c| c.pin.adc1()), slow].map(|channel| channel.unwrap_or(0))
        };
        prepare(&one, channels(a.pin.adc1(), dc_link.adc1()), protection.window_a)?;
        prepare(&two, channels(b.pin.adc2(), heat_sink.adc2()), protection.window_b)?;
        // For `own_reference`.
        one.smpr2().write(|w| w.smp18().set(board::REFERENCE_SAMPLING.code));
        // SAFETY: five bits, an existing channel; a sequence of one.
        one.sqr1().write(|w| unsafe { w.sq1().bits(OWN_REFERENCE) });
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
        let (current_a, current_b) =
            (self.one.jdr1().read().jdata().bits(), self.two.jdr1().read().jdata().bits());
        let (one, two) = (self.one.jdr2().read().jdata(), self.two.jdr2().read().jdata());
        if SELECTED.currents.c().is_none() {
            let (dc_link, heat_sink) = (one.bits(), two.bits());
            return Codes { current_a, current_b, current_c: 0, dc_link, heat_sink };
        }
        Codes {
            current_a,
            current_b,
            current_c: one.bits(),
            dc_link: self.one.jdr3().read().jdata().bits(),
            heat_sink: self.two.jdr3().read().jdata().bits(),
        }
    }
}

/// Sets a converter up: power, calibration, sequence, in the order of RM0440. The channels are those of its own current, of
/// current c (0: none), and of its slow signal. Both converters convert current c, so that both sequences take the same time.
fn prepare(
    adc: &RegisterBlock,
    [current, third, slow]: [u8; 3],
    (low, high): (u16, u16),
) -> Result<(), StartError> {
    adc.cr().modify(|_, w| w.deeppwd().disabled());
    adc.cr().modify(|_, w| w.advregen().enabled());
    asm::delay(board::ADC_REGULATOR_START_US * board::CYCLES_PER_US);

    adc.cr().modify(|_, w| w.adcaldif().single_ended().adcal().start_calibration());
    wait_for(|| !adc.cr().read().adcal().bit()).ok_or("a converter does not calibrate")?;
    // At least four converter clocks between the calibration and the next step.
    asm::delay(8 * board::ADC_CLOCK_DIVIDER);

    adc.isr().write(|w| w.adrdy().clear());
    // Again until it is ready: the logic of the calibration may still clear the bit (`stm32g4xx_hal_adc.c`).
    wait_for(|| {
        adc.cr().modify(|_, w| w.aden().enabled());
        adc.isr().read().adrdy().bit()
    })
    .ok_or("a converter does not start")?;

    let times = [
        (current, board::CURRENT_SAMPLING),
        (third, board::CURRENT_SAMPLING),
        (slow, board::SLOW_SAMPLING),
    ];
    for (channel, time) in times.into_iter().filter(|(channel, _)| *channel != 0) {
        // Channels 1 to 9: all that a board can have.
        adc.smpr1().modify(|_, w| w.smp(channel).set(time.code));
    }
    // The first conversion after the calibration may be wrong (ES0430, 2.7.7 and 2.7.8): a regular one, thrown away.
    // SAFETY: five bits, an existing channel; a sequence of one.
    adc.sqr1().write(|w| unsafe { w.sq1().bits(current) });
    adc.cr().modify(|_, w| w.adstart().start_conversion());
    wait_for(|| adc.isr().read().eoc().bit()).ok_or("a converter does not start")?;
    adc.isr().write(|w| w.eosmp().clear().eoc().clear().eos().clear());

    // The analog watchdog interrupts at the first code outside the window.
    // SAFETY: twelve bits each, from codes of twelve bits.
    adc.tr1().write(|w| unsafe { w.lt1().bits(low).ht1().bits(high) });
    // It checks the current alone. No queue of sequences: the one below never changes.
    // SAFETY: five bits, an existing channel.
    adc.cfgr().modify(|_, w| unsafe {
        w.awd1ch().bits(current).awd1sgl().set_bit().jawd1en().set_bit().jqdis().set_bit()
    });
    adc.jsqr().write(|w| {
        // Lengths are coded less one.
        // SAFETY: five bits each, existing channels.
        unsafe {
            w.jsq1().bits(current);
            if third == 0 {
                w.jsq2().bits(slow).jl().set(1);
            } else {
                w.jsq2().bits(third).jsq3().bits(slow).jl().set(2);
            }
        }
        // Trigger: rising edge of trigger output 2 of TIM1.
        w.jextsel().tim1_trgo2().jexten().rising_edge()
    });
    Ok(())
}

/// The code of the chip's own reference, and the one that it had in the factory; `None` if it is not converted. For the main
/// loop: a regular conversion, which begins behind a sequence of the control and ends long before the next one. An injected
/// trigger in the middle of a regular conversion may convert channel 0 (ES0430, 2.7.8).
pub fn own_reference() -> Option<(u16, u16)> {
    // SAFETY: both always exist. TIM1 is only read, and the control interrupt has nothing to do with regular conversions.
    let (adc, timer) = unsafe { (&*pac::ADC1::ptr(), &*pac::TIM1::ptr()) };
    let behind = u32::from(board::PWM_TOP) - board::SAMPLES_READY_TICKS;
    wait_for(|| {
        timer.cr1().read().dir().is_down() && u32::from(timer.cnt().read().cnt().bits()) < behind
    })?;
    adc.cr().modify(|_, w| w.adstart().start_conversion());
    wait_for(|| adc.isr().read().eoc().bit())?;
    let factory = board::REFERENCE_CALIBRATION as *const u16;
    // SAFETY: read-only memory of the chip, aligned.
    Some((adc.dr().read().rdata().bits(), unsafe { factory.read_volatile() }))
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
