//! The last faults since the start.

use drive_core::State;
use heapless::Deque;

/// Number of faults that are kept.
pub const KEPT: usize = 8;

/// The last faults.
#[derive(Default)]
pub struct FaultLog {
    /// Code and time since the start, s; the newest first.
    entries: Deque<(u8, u32), KEPT>,
    faulty: bool,
}

impl FaultLog {
    /// Notes a fault when the state changes to one, `seconds` after the start.
    pub fn watch(&mut self, state: State, seconds: u32) {
        let was = core::mem::replace(&mut self.faulty, state.fault().is_some());
        if let Some(fault) = state.fault()
            && !was
        {
            if self.entries.is_full() {
                self.entries.pop_back();
            }
            // The list has enough space.
            let _ = self.entries.push_front((fault.code(), seconds));
        }
    }

    /// Code and time of the fault with this number, 0 the newest; zeros if there is none.
    pub fn get(&self, number: usize) -> (u8, u32) {
        self.entries.iter().nth(number).copied().unwrap_or_default()
    }
}
