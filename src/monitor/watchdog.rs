//! The rule by which the watchdog is fed.

use crate::board::{self, PERIOD_TICKS};

/// Least number of core cycles over which the rate of the control interrupt is judged: 12 control periods, 2 ms.
pub const WINDOW_CYCLES: u32 = 12 * PERIOD_TICKS;
// The tolerance of a tenth covers one interrupt more or less, depending on the instant of the count.
const _: () = assert!(WINDOW_CYCLES / 10 > PERIOD_TICKS);
// A wrong rate is detected within half the time of the watchdog.
const _: () = assert!(WINDOW_CYCLES / board::CYCLES_PER_US * 2 < board::WATCHDOG_US);

/// Result of the rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Do not feed now: the control interrupt is late.
    Wait,
    /// Feed the watchdog.
    Feed,
    /// Never feed it again: the control interrupt missed a deadline or does not come at its rate.
    Refuse {
        /// Control periods in the window.
        periods: u32,
        /// Core cycles in the window.
        cycles: u32,
    },
}

/// The rule, evaluated in each pass of the main loop and around long operations in it. It allows feeding if the control interrupt comes,
/// to within one period, and no deadline was missed. Over each window the rate must be right within a tenth.
#[derive(Clone, Copy, Debug)]
pub struct FeedRule {
    cycles: u32,
    periods: u32,
    refused: bool,
}

impl FeedRule {
    /// A rule that begins at these counts of core cycles and control periods, both wrapping.
    pub const fn new(cycles: u32, periods: u32) -> Self {
        Self { cycles, periods, refused: false }
    }

    /// Restarts the window at these counts; a refusal stays.
    pub const fn restart(&mut self, cycles: u32, periods: u32) {
        (self.cycles, self.periods) = (cycles, periods);
    }

    /// The verdict at these counts; `missed` is whether a deadline was ever missed. A refusal stays.
    pub fn judge(&mut self, cycles: u32, periods: u32, missed: bool) -> Verdict {
        let elapsed = cycles.wrapping_sub(self.cycles);
        let came = periods.wrapping_sub(self.periods);
        let off = (u64::from(came) * u64::from(PERIOD_TICKS)).abs_diff(u64::from(elapsed));
        let is_whole = elapsed >= WINDOW_CYCLES;
        self.refused |= missed || (is_whole && off * 10 > u64::from(elapsed));
        if self.refused {
            return Verdict::Refuse { periods: came, cycles: elapsed };
        }
        if is_whole {
            self.restart(cycles, periods);
        }
        let comes = is_whole || off <= u64::from(PERIOD_TICKS);
        if comes { Verdict::Feed } else { Verdict::Wait }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn it_is_fed_when_all_is_well() {
        let mut rule = FeedRule::new(u32::MAX - 5, u32::MAX);
        for period in 0..1200_u32 {
            let cycles = (u32::MAX - 5).wrapping_add(period.wrapping_mul(PERIOD_TICKS) + 700);
            let verdict = rule.judge(cycles, u32::MAX.wrapping_add(period), false);
            assert_eq!(verdict, Verdict::Feed, "{period}");
        }
    }

    /// A late interrupt stops the feeding within a window, and for good at its end.
    #[test]
    fn it_waits_for_an_interrupt_that_is_late() {
        let mut rule = FeedRule::new(0, 0);
        assert_eq!(rule.judge(3 * PERIOD_TICKS, 2, false), Verdict::Feed);
        assert_eq!(rule.judge(5 * PERIOD_TICKS, 3, false), Verdict::Wait);
        assert_eq!(rule.judge(6 * PERIOD_TICKS, 6, false), Verdict::Feed);
        assert_eq!(rule.judge(8 * PERIOD_TICKS, 6, false), Verdict::Wait);
        assert!(matches!(rule.judge(12 * PERIOD_TICKS, 6, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn a_missed_deadline_ends_it_at_once_and_for_good() {
        let mut rule = FeedRule::new(0, 0);
        assert!(matches!(rule.judge(10, 0, true), Verdict::Refuse { .. }));
        assert!(matches!(rule.judge(WINDOW_CYCLES, 12, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn a_pause_that_was_meant_is_not_counted_but_heals_nothing() {
        let mut rule = FeedRule::new(0, 0);
        rule.restart(50 * WINDOW_CYCLES, 3);
        assert_eq!(rule.judge(51 * WINDOW_CYCLES, 15, false), Verdict::Feed);
        assert!(matches!(rule.judge(51 * WINDOW_CYCLES, 15, true), Verdict::Refuse { .. }));
        rule.restart(60 * WINDOW_CYCLES, 15);
        assert!(matches!(rule.judge(61 * WINDOW_CYCLES, 27, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn an_interrupt_that_does_not_come_ends_it() {
        let mut rule = FeedRule::new(0, 0);
        assert_eq!(rule.judge(WINDOW_CYCLES - 1, 0, false), Verdict::Wait);
        let cycles = WINDOW_CYCLES;
        assert_eq!(rule.judge(cycles, 0, false), Verdict::Refuse { periods: 0, cycles });
    }

    proptest! {
        #[test]
        fn a_tenth_more_or_less_is_the_limit(periods in 0_u32..40_000, cycles in WINDOW_CYCLES..1_000_000_000) {
            let ratio = f64::from(periods) * f64::from(PERIOD_TICKS) / f64::from(cycles);
            prop_assume!((ratio - 0.9).abs() > 1e-6 && (ratio - 1.1).abs() > 1e-6);
            let fed = FeedRule::new(7, 9).judge(cycles + 7, periods + 9, false) == Verdict::Feed;
            prop_assert_eq!(fed, (0.9..1.1).contains(&ratio));
        }
    }
}
