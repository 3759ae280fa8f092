//! The peripherals of a control period together, and the events that they report to the drive.

use drive_core::{Hardware, Output, Sample};

use super::adc::Adc;
use super::dc_link::DcLink;
use super::encoder::Encoder;
use super::pwm::Pwm;
use super::time;
use super::window::Window;
use crate::board;

/// The peripherals of a control period.
pub struct Stage {
    /// The power stage.
    pub pwm: Pwm,
    /// Chopper and precharge relay.
    dc_link: DcLink,
    /// The ADCs.
    pub adc: Adc,
    /// The encoder.
    encoder: Encoder,
    /// The watchdog over the control interrupt.
    window: Window,
    /// Control periods since the start, wrapping.
    pub periods: u32,
    /// Deadline miss of the last period.
    late: Hardware,
    /// Over-current at an analog watchdog since the last period.
    over_current: Hardware,
    /// Time of the start of the last period.
    began: u32,
}

/// A control period that has begun.
pub struct Period {
    /// Events since the last period.
    pub hardware: Hardware,
    /// Ticks from the top of the timer, where the sampling ended, to the start of the interrupt.
    since_top: u32,
}

impl Stage {
    /// Takes the peripherals, which are set up.
    pub fn new(pwm: Pwm, dc_link: DcLink, adc: Adc, encoder: Encoder, window: Window) -> Self {
        let (late, over_current) = (Hardware::empty(), Hardware::empty());
        Self { pwm, dc_link, adc, encoder, window, periods: 0, late, over_current, began: 0 }
    }

    /// Begins a period; `told` are events that the main loop has found, and `watched` says that the window watchdog is to be fed.
    /// `None`: the interrupt came for an over-current, before the conversions have ended. The outputs are off then.
    #[inline(always)] // runs in every period, with its values in registers
    pub fn begin(&mut self, watched: bool, told: Hardware) -> Option<Period> {
        // Over-current comes first: the outputs go off before anything is computed. The analog watchdogs interrupt when the current is
        // converted, before the sequence has ended.
        let converters = self.adc.take_events();
        if converters.over_current {
            self.pwm.trip();
            self.over_current = Hardware::ANALOG_WATCHDOG;
        }
        if !converters.ended {
            return None;
        }

        // Read before the rest of the timer, so that `status` shows the start of the interrupt and not what follows.
        let since_top = self.pwm.since_top();

        // The watchdog is fed at the beginning, where the interrupt comes at equal intervals; an interrupt that hangs does not feed it
        // again.
        if watched {
            self.window.feed();
        }

        // The timer counts down from the top, where the sampling ended and an update came, and was at the top one period before.
        // Otherwise a period was skipped or came late.
        let timer = self.pwm.take_events();
        let now = time::now();
        let since_last = now.wrapping_sub(core::mem::replace(&mut self.began, now));
        // (The first period has waited for the interrupt to be enabled.)
        if self.periods > 0
            && (!timer.updated
                || since_top > u32::from(board::PWM_TOP)
                || since_last > 3 * u32::from(board::PWM_TOP))
        {
            self.late = Hardware::DEADLINE_MISS;
        }
        let mut hardware = self.late | self.over_current | told;
        self.over_current = Hardware::empty();
        if timer.pulled {
            hardware |= Hardware::BREAK;
        }
        if !converters.complete {
            hardware |= Hardware::CONVERTER_OVERRUN;
        }
        Some(Period { hardware, since_top })
    }

    /// Reads the sample of a drive that `was_off` in the last period, and adds the event of a chopper that was switched off.
    #[inline(always)] // runs in every period, with its values in registers
    pub fn sample(&mut self, period: &mut Period, was_off: bool) -> Sample {
        if self.dc_link.is_off() {
            if was_off {
                self.dc_link.restore();
            } else {
                period.hardware |= Hardware::CHOPPER_OFF;
            }
        }
        let read = self.adc.read();
        Sample { encoder: self.encoder.count(), hardware: period.hardware, ..read }
    }

    /// Ends the control of a period: chopper, relay, and the deadline. Returns how late the interrupt started, ticks (0 in the first
    /// period), and whether a deadline was missed with the outputs on; they are off then.
    #[inline(always)] // runs in every period, with its values in registers
    pub fn end(&mut self, period: &Period, was_off: bool, output: &Output) -> (u32, bool) {
        // The timer was at its top again before all compare values were written.
        self.late = Hardware::empty();
        if self.pwm.updated() {
            self.late = Hardware::DEADLINE_MISS;
        }
        // With the outputs off a miss is harmless, and is only reported.
        let missed = (period.hardware | self.late).contains(Hardware::DEADLINE_MISS) && !was_off;
        if missed {
            self.pwm.trip();
        }
        self.dc_link.set(output.chopper, output.relay);
        let latency = period.since_top.saturating_sub(board::SAMPLES_READY_TICKS);
        (if self.periods > 0 { latency } else { 0 }, missed)
    }
}
