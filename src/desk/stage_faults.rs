//! Faults of the power stage. A master must not clear them without limit, because each start into a short circuit stresses the switches.

use crate::link::Status;

/// Three faults within this time block the next clear, for this time from the last one, ms.
const WINDOW_MS: u32 = 10_000;

/// The times of the last faults of the power stage.
#[derive(Default)]
pub struct StageFaults {
    /// Whether the latched fault has been counted.
    counted: bool,
    /// Periods of the last report before the fault was cleared: that report still shows the fault.
    stale: Option<u32>,
    /// Ages of the last three faults, ms, the newest first; ages above the window are dropped.
    ages: [Option<u32>; 3],
    seen_ms: u32,
}

impl StageFaults {
    /// Counts the latched fault once; returns whether one is latched. Called in each pass of the main loop; `now_ms` wraps.
    pub fn watch(&mut self, status: &Status, now_ms: u32) -> bool {
        let passed = now_ms.wrapping_sub(core::mem::replace(&mut self.seen_ms, now_ms));
        for age in &mut self.ages {
            *age = age.map(|age| age.saturating_add(passed)).filter(|age| *age < WINDOW_MS);
        }
        if self.stale == Some(status.periods) {
            return false;
        }
        let fault = status.state.fault();
        let counts = fault.is_some_and(|fault| fault.is_of_the_power_stage());
        if counts && !self.counted {
            self.ages.rotate_right(1);
            self.ages[0] = Some(0);
        }
        (self.counted, self.stale) = (counts, None);
        fault.is_some()
    }

    /// Passes if the fault may be cleared now; call [`watch`](Self::watch) first.
    ///
    /// # Errors
    /// The seconds until the fault may be cleared.
    pub fn may_clear(&self) -> Result<(), u32> {
        match self.ages {
            [Some(newest), _, Some(_)] => Err((WINDOW_MS - newest).div_ceil(1000)),
            _ => Ok(()),
        }
    }

    /// The fault was cleared; this is the last report before that.
    pub fn cleared(&mut self, status: &Status) {
        (self.counted, self.stale) = (false, Some(status.periods));
    }
}
