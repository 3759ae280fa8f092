//! The watchdog, and work that takes longer than it allows.

use core::sync::atomic::Ordering;

use crate::task::control;
use induction_drive::chip::time;
use induction_drive::chip::watchdog::Watchdog;
use induction_drive::monitor::watchdog::FeedRule;

/// The watchdog and the rule by which it is fed, if it runs.
pub type Guard = Option<(Watchdog, FeedRule)>;

/// Does long work with the time of the watchdog extended, and restarts the feed rule after it. If the flash has one bank, the core and
/// the control with it wait while the flash is written.
pub fn extended<R>(guard: &mut Guard, work: impl FnOnce() -> R) -> R {
    match guard {
        Some((watchdog, rule)) => {
            let result = watchdog.extended(work);
            rule.restart(time::now(), control::PERIODS.load(Ordering::Relaxed));
            result
        }
        None => work(),
    }
}
