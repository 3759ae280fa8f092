//! When the watchdog is fed, and the watchdog.

use crate::board;

/// Core cycles from one feeding to the next, at least: 12 control periods, 2 ms.
const FEED_CYCLES: u32 = 12 * PERIOD_CYCLES;
const PERIOD_CYCLES: u32 = 2 * board::PWM_TOP as u32;
// One interrupt more or less, for where in the period one looks, is within the tenth.
const _: () = assert!(FEED_CYCLES / 10 > PERIOD_CYCLES);
// Fed at half its time: the main loop may be late by as much.
const _: () = assert!(FEED_CYCLES / board::CYCLES_PER_US * 2 < board::WATCHDOG_US);

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing yet.
    Wait,
    /// Feed the watchdog.
    Feed,
    /// Never again: the control is not what it should be. Control periods and core cycles since the
    /// last feeding.
    Refuse {
        /// Control periods since the last feeding.
        periods: u32,
        /// Core cycles since then.
        cycles: u32,
    },
}

/// The rule: judged at the end of each pass of the main loop, it lets the watchdog be fed only if,
/// since the last time, the control interrupt came as often as it should, within a tenth, and no
/// deadline was missed.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    cycles: u32,
    periods: u32,
    refused: bool,
}

impl Rule {
    /// From now on, counts of core cycles and control periods, both wrapping.
    pub const fn new(cycles: u32, periods: u32) -> Self {
        Self { cycles, periods, refused: false }
    }

    /// Counts anew from here, but what was refused stays refused.
    pub const fn restart(&mut self, cycles: u32, periods: u32) {
        (self.cycles, self.periods) = (cycles, periods);
    }

    /// Once refused, it stays so.
    pub fn judge(&mut self, cycles: u32, periods: u32, missed: bool) -> Verdict {
        let elapsed = cycles.wrapping_sub(self.cycles);
        let came = periods.wrapping_sub(self.periods);
        if elapsed < FEED_CYCLES && !missed && !self.refused {
            return Verdict::Wait;
        }
        let accounted = u64::from(came) * u64::from(PERIOD_CYCLES);
        if self.refused
            || missed
            || accounted.abs_diff(u64::from(elapsed)) * 10 > u64::from(elapsed)
        {
            self.refused = true;
            return Verdict::Refuse { periods: came, cycles: elapsed };
        }
        *self = Self::new(cycles, periods);
        Verdict::Feed
    }
}

/// The independent watchdog: resets the chip when it is not fed in time. Once started, only a reset
/// stops it.
#[cfg(target_os = "none")]
pub struct Watchdog(stm32g4xx_hal::pac::IWDG);

#[cfg(target_os = "none")]
impl Watchdog {
    /// Starts it, with [`board::WATCHDOG_US`].
    pub fn start(timer: stm32g4xx_hal::pac::IWDG, debug: &stm32g4xx_hal::pac::DBGMCU) -> Self {
        // Halted by a debugger, it stops too.
        debug.apb1l_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        // SAFETY: the key that starts it.
        timer.kr().write(|w| unsafe { w.bits(0xcccc) });
        let watchdog = Self(timer);
        watchdog.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
        watchdog
    }

    /// Feeds it.
    pub fn feed(&mut self) {
        // SAFETY: the key that reloads it.
        self.0.kr().write(|w| unsafe { w.bits(0xaaaa) });
    }

    /// Does what takes long, with the time of the watchdog stretched to a second. For when the outputs
    /// are off and cannot come on before it is done.
    pub fn stretched<R>(&mut self, work: impl FnOnce() -> R) -> R {
        self.set(board::WATCHDOG_LONG_PRESCALER, board::WATCHDOG_LONG_RELOAD);
        let result = work();
        self.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
        result
    }

    fn set(&self, prescaler: u8, reload: u16) {
        // SAFETY: the key that unlocks the two registers.
        self.0.kr().write(|w| unsafe { w.bits(0x5555) });
        // SAFETY: three bits and twelve bits; `board` keeps both inside.
        unsafe {
            self.0.pr().write(|w| w.bits(u16::from(prescaler)));
            self.0.rlr().write(|w| w.bits(reload));
        }
        // Both arrive within six clocks of the watchdog; a clock that does not run is no reason to
        // wait for ever.
        for _ in 0..board::WATCHDOG_SET_US {
            if self.0.sr().read().bits() == 0 {
                break;
            }
            cortex_m::asm::delay(board::CYCLES_PER_US);
        }
        // SAFETY: the key that reloads it.
        self.0.kr().write(|w| unsafe { w.bits(0xaaaa) });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn it_is_fed_when_all_is_well_and_not_too_often() {
        let mut rule = Rule::new(u32::MAX - 5, u32::MAX);
        let mut fed = 0;
        for period in 0..1200_u32 {
            let cycles = (u32::MAX - 5).wrapping_add(period.wrapping_mul(PERIOD_CYCLES) + 700);
            match rule.judge(cycles, u32::MAX.wrapping_add(period), false) {
                Verdict::Feed => fed += 1,
                Verdict::Wait => {}
                refused => panic!("{refused:?}"),
            }
        }
        assert!((99..=100).contains(&fed), "{fed}");
    }

    #[test]
    fn a_missed_deadline_ends_it_at_once_and_for_good() {
        let mut rule = Rule::new(0, 0);
        assert!(matches!(rule.judge(10, 0, true), Verdict::Refuse { .. }));
        assert!(matches!(rule.judge(FEED_CYCLES, 12, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn a_pause_that_was_meant_is_not_counted_but_heals_nothing() {
        let mut rule = Rule::new(0, 0);
        rule.restart(50 * FEED_CYCLES, 3);
        assert_eq!(rule.judge(51 * FEED_CYCLES, 15, false), Verdict::Feed);
        assert!(matches!(rule.judge(51 * FEED_CYCLES, 15, true), Verdict::Refuse { .. }));
        rule.restart(60 * FEED_CYCLES, 15);
        assert!(matches!(rule.judge(61 * FEED_CYCLES, 27, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn an_interrupt_that_does_not_come_ends_it() {
        let mut rule = Rule::new(0, 0);
        assert_eq!(rule.judge(FEED_CYCLES - 1, 0, false), Verdict::Wait);
        let cycles = FEED_CYCLES;
        assert_eq!(rule.judge(cycles, 0, false), Verdict::Refuse { periods: 0, cycles });
    }

    proptest! {
        #[test]
        fn a_tenth_more_or_less_is_the_limit(periods in 0_u32..40_000, cycles in FEED_CYCLES..1_000_000_000) {
            let ratio = f64::from(periods) * f64::from(PERIOD_CYCLES) / f64::from(cycles);
            prop_assume!((ratio - 0.9).abs() > 1e-6 && (ratio - 1.1).abs() > 1e-6);
            let fed = Rule::new(7, 9).judge(cycles + 7, periods + 9, false) == Verdict::Feed;
            prop_assert_eq!(fed, (0.9..1.1).contains(&ratio));
        }
    }
}
