//! The rules of the chip that a program can break without an access fault: the silicon would drop, delay or do
//! something wrong without an error. A broken rule is recorded with its place and time, and can fail the
//! run.

use thiserror::Error;

/// Defines the rules, each with its meaning and its source.
macro_rules! rules {
    ($($(#[$meaning:meta])* $rule:ident: $source:literal,)*) => {
        /// A rule; [`Rule::source`] gives the document that states it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Rule {
            $($(#[$meaning])* $rule,)*
        }

        impl Rule {
            /// Returns the document that states the rule.
            pub fn source(self) -> &'static str {
                match self {
                    $(Self::$rule => $source,)*
                }
            }
        }
    };
}

rules! {
    /// A register of a peripheral whose clock is off in RCC is accessed: writes are lost, reads give the reset value.
    ClockGate: "RM0440, RCC, peripheral clock enable registers",
    /// The first access to a peripheral comes less than two cycles after its clock was switched on. This is counted
    /// only if the core stops at every instruction ([`Counting::every_instruction`](crate::Counting)).
    EnableDelay: "RM0440, RCC, delay after a clock enable; ST's LL_AHB2_GRP1_EnableClock reads back",
    /// The system clock is above the limit of the core's voltage range.
    VoltageRange: "RM0440, PWR, dynamic voltage scaling; stm32g4xx_hal_pwr_ex.c",
    /// The flash has too few wait states for the clock.
    Latency: "RM0440, FLASH, wait states by clock and voltage range",
    /// The bus clock rises from 80 MHz or less to more in one step, without a microsecond at half of it.
    ClockStep: "RM0440, RCC, system clock selection: AHB/2 for 1 us above 80 MHz",
    /// `TIM1_BDTR` is written with another `LOCK` than the first time: it keeps the first.
    LockOnce: "RM0440, TIMx_BDTR.LOCK; stm32g4xx_ll_tim.h: once after the reset",
    /// The flash is erased or programmed with its data cache on.
    DataCache: "stm32g4xx_hal_flash.c and _flash_ex.c switch DCEN off first",
    /// An ADC is started without a clock: `CKMODE` 0 and nothing in `CCIPR.ADC12SEL`.
    AdcClock: "RM0440, ADC clocks: CKMODE 0 takes the clock of CCIPR.ADC12SEL",
    /// An ADC is used before its regulator, its calibration or its start-up allows it.
    AdcEarly: "RM0440, ADC regulator, calibration, on-off control; DS12288, tADCVREG_STUP",
    /// `ADC_JSQR` is written while injected conversions run, with the queue off: the write is lost.
    JsqrStarted: "RM0440, ADC_JSQR and queue of context, JQDIS = 1",
    /// The trigger of an injected sequence comes in the middle of a regular conversion: channel 0 may be converted instead.
    AdcDisturbed: "ES0430, ADC channel 0 converted instead of the required channel",
    /// ADC3 or ADC4 converts while ADC1 or ADC2 samples a current: its noise is in the result.
    AdcBeside: "ES0430, 2.7.9",
    /// The chip's internal reference is sampled for less than 4 us.
    OwnReference: "DS12288, ts_vrefint",
    /// A register of the watchdog is written while its last value is still being transferred: the write is lost.
    IwdgBusy: "RM0440, IWDG_SR; stm32g4xx_hal_iwdg.c: six prescaled clocks",
    /// A pin is not in the mode, or not at the alternate function, that its use requires.
    PinMode: "DS12288, pins and alternate functions; RM0440, GPIOx_MODER",
    /// After a halt by a debugger that stopped TIM1, the outputs came back without an action of the program, and it did
    /// not switch them off.
    ResumedOutputs: "RM0440, TIM1 debug mode: outputs off as if MOE was reset, MOE unchanged",
    /// A byte is sent on the RS-485 line while the pin that enables the driver is not high: nothing is transmitted.
    BusDriver: "TIA-485 transceivers: DE is high from the first start bit to the last stop bit",
    /// The supply monitor is locked while it is off, so that it cannot be switched on any more.
    SupplyMonitor: "RM0440, SYSCFG_CFGR2.PVDL locks PVDE and PVDLS",
    /// The mode of a DAC is written before its first data, or while it is on.
    DacMode: "RM0440, DAC_MCR.MODE; errata of sibling chips: a data register first",
    /// A comparator uses the level of a DAC that was never read as ready.
    DacReady: "RM0440, DAC_SR.DAC1RDY; DS12288, tWAKEUP",
}

/// A rule that was broken.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{rule:?}: {text} ({}) at {at:#010x}, {:.3} ms", rule.source(), *now as f64 / 170e3)]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// Register, value and limit.
    pub text: String,
    /// Program counter: the instruction, or the first of its block.
    pub at: u32,
    /// Time, ticks.
    pub now: u64,
    /// Number of occurrences; place and time are those of the first.
    pub count: u64,
}

/// The violations so far.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    violations: Vec<Violation>,
    reported: usize,
    /// Last known position of the core.
    pub at: u32,
    /// Time, ticks.
    pub now: u64,
    /// Whether time is not known at every instruction.
    pub coarse: bool,
    /// Whether violations are only recorded and do not end a run.
    pub collecting: bool,
}

impl Rules {
    /// Records a violation; a repeated text is only counted.
    pub fn note(&mut self, rule: Rule, text: impl Into<String>) {
        let (text, at, now) = (text.into(), self.at, self.now);
        let known = self.violations.iter_mut().find(|v| v.rule == rule && v.text == text);
        match known {
            Some(violation) => violation.count += 1,
            None => self.violations.push(Violation { rule, text, at, now, count: 1 }),
        }
    }

    /// Records a violation unless `kept`.
    pub fn require(&mut self, kept: bool, rule: Rule, text: impl FnOnce() -> String) -> bool {
        if !kept {
            self.note(rule, text());
        }
        kept
    }

    /// Returns all violations, in order.
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Returns the first violation that was not reported yet, unless they are only recorded.
    pub fn fatal(&mut self) -> Option<&Violation> {
        if self.collecting {
            return None;
        }
        let first = self.violations.get(self.reported)?;
        self.reported = self.violations.len();
        Some(first)
    }
}
