//! The time of the main loop.

use induction_drive::board;
use induction_drive::chip::time;

/// Milliseconds from the time base, which wraps every 25 s; it must be updated more often.
pub struct Clock {
    /// Time base at that time.
    last: u32,
    /// Time since the start, wrapping.
    pub ms: u32,
}

impl Clock {
    /// A clock that begins now.
    pub fn new() -> Self {
        Self { last: time::now(), ms: 0 }
    }

    /// Reads the time base.
    pub fn update(&mut self) {
        let per_ms = board::CYCLES_PER_US * 1000;
        let passed = time::now().wrapping_sub(self.last) / per_ms;
        self.last = self.last.wrapping_add(passed * per_ms);
        self.ms = self.ms.wrapping_add(passed);
    }
}
