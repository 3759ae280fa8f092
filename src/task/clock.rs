//! The time of the main loop.

use induction_drive::board;
use induction_drive::chip::time;

/// Milliseconds from the time base, which wraps every 25 s; it must be updated more often.
pub struct Clock {
    last: u32,
    cycles: u32,
    /// Time since the start, wrapping.
    pub ms: u32,
}

impl Clock {
    /// A clock that begins now.
    pub fn new() -> Self {
        Self { last: time::now(), cycles: 0, ms: 0 }
    }

    /// Reads the time base.
    pub fn update(&mut self) {
        let now = time::now();
        self.cycles += now.wrapping_sub(self.last);
        self.last = now;
        let per_ms = board::CYCLES_PER_US * 1000;
        self.ms = self.ms.wrapping_add(self.cycles / per_ms);
        self.cycles %= per_ms;
    }
}
