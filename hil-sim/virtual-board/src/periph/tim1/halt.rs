//! The timer while a debugger halts the core (RM0440, TIM1, debug mode).

use super::Tim1;

impl Tim1 {
    /// A debugger halts the core: the counter stops, and the outputs go off as if MOE was reset.
    pub fn freeze(&mut self, now: u64) {
        self.frozen.get_or_insert(now);
    }

    /// The counter goes on.
    pub fn thaw(&mut self, now: u64) {
        let Some(since) = self.frozen.take() else { return };
        let stood = now - since;
        self.from += stood;
        for at in self.trigger_at.iter_mut().chain([&mut self.next_end]) {
            *at = at.saturating_add(stood);
        }
    }
}
