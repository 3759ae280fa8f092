//! The rule by which the watchdog is fed.

use crate::board;

/// Core cycles from one feeding to the next, at least: 12 control periods, 2 ms.
const FEED_CYCLES: u32 = 12 * PERIOD_CYCLES;
const PERIOD_CYCLES: u32 = 2 * board::PWM_TOP as u32;
// The tolerance of a tenth covers one interrupt more or less, which depends on the instant of the count.
const _: () = assert!(FEED_CYCLES / 10 > PERIOD_CYCLES);
// Fed at half its time: the main loop may be late by the same time.
const _: () = assert!(FEED_CYCLES / board::CYCLES_PER_US * 2 < board::WATCHDOG_US);

/// Result of the rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing yet.
    Wait,
    /// Feed the watchdog.
    Feed,
    /// Never feed it again: the control interrupt missed a deadline or does not come at its rate.
    Refuse {
        /// Control periods since the last feeding.
        periods: u32,
        /// Core cycles since then.
        cycles: u32,
    },
}

/// The rule, evaluated at the end of each pass of the main loop. It allows feeding only if, since the last feeding, the
/// control interrupt came at its rate within a tenth, and no deadline was missed.
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

    /// Begins anew at these counts; a refusal stays.
    pub const fn restart(&mut self, cycles: u32, periods: u32) {
        (self.cycles, self.periods) = (cycles, periods);
    }

    /// The verdict at these counts; `missed` is whether a deadline was ever missed. A refusal stays.
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn it_is_fed_when_all_is_well_and_not_too_often() {
        let mut rule = FeedRule::new(u32::MAX - 5, u32::MAX);
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
        let mut rule = FeedRule::new(0, 0);
        assert!(matches!(rule.judge(10, 0, true), Verdict::Refuse { .. }));
        assert!(matches!(rule.judge(FEED_CYCLES, 12, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn a_pause_that_was_meant_is_not_counted_but_heals_nothing() {
        let mut rule = FeedRule::new(0, 0);
        rule.restart(50 * FEED_CYCLES, 3);
        assert_eq!(rule.judge(51 * FEED_CYCLES, 15, false), Verdict::Feed);
        assert!(matches!(rule.judge(51 * FEED_CYCLES, 15, true), Verdict::Refuse { .. }));
        rule.restart(60 * FEED_CYCLES, 15);
        assert!(matches!(rule.judge(61 * FEED_CYCLES, 27, false), Verdict::Refuse { .. }));
    }

    #[test]
    fn an_interrupt_that_does_not_come_ends_it() {
        let mut rule = FeedRule::new(0, 0);
        assert_eq!(rule.judge(FEED_CYCLES - 1, 0, false), Verdict::Wait);
        let cycles = FEED_CYCLES;
        assert_eq!(rule.judge(cycles, 0, false), Verdict::Refuse { periods: 0, cycles });
    }

    proptest! {
        #[test]
        fn a_tenth_more_or_less_is_the_limit(periods in 0_u32..40_000, cycles in FEED_CYCLES..1_000_000_000) {
            let ratio = f64::from(periods) * f64::from(PERIOD_CYCLES) / f64::from(cycles);
            prop_assume!((ratio - 0.9).abs() > 1e-6 && (ratio - 1.1).abs() > 1e-6);
            let fed = FeedRule::new(7, 9).judge(cycles + 7, periods + 9, false) == Verdict::Feed;
            prop_assert_eq!(fed, (0.9..1.1).contains(&ratio));
        }
    }
}
