//! TIM1 in centre-aligned mode, with three legs (RM0440, section 28).
//!
//! The counter is not stepped: its value follows from time. Events are its two ends and the rising edge of OC4REF on
//! the way up and both edges of OC6REF around 0, which are the trigger outputs 1 and 2 to the ADCs; alternatively the
//! update is output 1.

mod outputs;

pub use outputs::{Output, Wave};

use super::{Effect, NEVER, Store, bits, offsets};
use crate::rules::{Rule, Rules};

offsets! {
    CR1 = 0x00, CR2 = 0x04, SR = 0x10, EGR = 0x14, CCMR1 = 0x18, CCMR2 = 0x1c, CCER = 0x20, CNT = 0x24, PSC = 0x28, ARR = 0x2c,
    RCR = 0x30, CCR1 = 0x34, CCR4 = 0x40, BDTR = 0x44, CCR6 = 0x4c, CCMR3 = 0x50, AF1 = 0x60
}

// SR, BDTR.
bits! { UIF = 0, BIF = 7, SBIF = 13 }
bits! { OSSI = 10, OSSR = 11, BKE = 12, BKP = 13, MOE = 15 }

/// An event and its time.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// A rising edge of a trigger output, 0 or 1; 2 is the falling edge of output 1.
    Trigger(u64, usize),
    /// The counter is at its top.
    Crest(u64),
    /// The counter is at 0.
    Valley(u64),
}

defaults! {
    /// The timer.
    #[derive(Clone, Debug)]
    pub struct Tim1 {
        store: Store = Store::of("TIM1"),
        /// The counter while it does not run.
        held: u32,
        /// Time at which the counter was last at 0, on its way up.
        from: u64,
        top: u32 = 0xffff,
        active: [u32; 4],
        repetitions: u32,
        status: u32,
        /// Next end of the count, and whether it is the top.
        next_end: u64 = NEVER,
        at_top_next: bool = true,
        /// Time of the next edge of each kind.
        trigger_at: [u64; 3] = [NEVER; 3],
        /// Level of the break pin; `None` is uncertain.
        break_pin: Option<bool> = Some(true),
        /// Outputs of the comparators.
        comparators: [bool; 7],
        /// LOCK of the first write to BDTR.
        first_lock: Option<u32>,
        /// Time at which a debugger has stopped the counter.
        frozen: Option<u64>,
        /// Number of updates to be left out: compare values are not taken over, no flag is set.
        pub drop_update: u32,
    }
}

impl Tim1 {
    fn counting(&self) -> bool {
        self.store.get(CR1) & 1 != 0
    }

    /// Returns the counter, and whether it counts down.
    fn count(&self, now: u64) -> (u32, bool) {
        if !self.counting() {
            return (self.held, false);
        }
        let now = self.frozen.unwrap_or(now);
        let phase = ((now.saturating_sub(self.from)) % u64::from(2 * self.top)) as u32;
        if phase < self.top { (phase, false) } else { (2 * self.top - phase, true) }
    }

    /// Stops the counter because a debugger halts the core; the outputs go off as if MOE had been reset (RM0440, TIM1, debug mode).
    pub fn freeze(&mut self, now: u64) {
        self.frozen.get_or_insert(now);
    }

    /// Lets the counter continue.
    pub fn thaw(&mut self, now: u64) {
        let Some(since) = self.frozen.take() else { return };
        let stood = now - since;
        self.from += stood;
        for at in self.trigger_at.iter_mut().chain([&mut self.next_end]) {
            *at = at.saturating_add(stood);
        }
    }

    /// Makes an update come at the next end of the count, regardless of the repetition counter.
    pub fn extra_update(&mut self) {
        self.repetitions = 0;
    }

    /// Returns the compare values in force.
    pub fn in_force(&self) -> [u32; 3] {
        [self.active[0], self.active[1], self.active[2]]
    }

    /// Returns the compare values written last.
    pub fn written(&self) -> [u32; 3] {
        std::array::from_fn(|leg| self.store.get(CCR1 + 4 * leg as u32))
    }

    /// Whether the outputs are on.
    pub fn outputs_on(&self) -> bool {
        self.frozen.is_none() && self.main_output()
    }

    /// Returns the bit MOE.
    pub fn main_output(&self) -> bool {
        self.store.get(BDTR) & MOE != 0
    }

    /// Returns whether the outputs CH1, CH1N, CH2 to CH3N are enabled, and whether the break pin is.
    pub fn uses_pins(&self) -> ([bool; 6], bool) {
        let ccer = self.store.get(CCER);
        let pin = self.store.get(BDTR) & BKE != 0 && self.store.get(AF1) & 1 != 0;
        (std::array::from_fn(|n| ccer >> (2 * n) & 1 != 0), pin)
    }

    /// Whether a break has occurred and was not cleared.
    pub fn broken(&self) -> bool {
        self.status & (BIF | SBIF) != 0
    }

    /// Returns the time of the next event.
    pub fn next_event(&self) -> u64 {
        if self.frozen.is_some() {
            NEVER
        } else {
            self.trigger_at.into_iter().fold(self.next_end, u64::min)
        }
    }

    /// Processes the next event.
    pub fn happen(&mut self) -> Event {
        let first = self.trigger_at.into_iter().enumerate().min_by_key(|(_, at)| *at);
        if let Some((output, at)) = first.filter(|(_, at)| *at <= self.next_end) {
            self.trigger_at[output] = NEVER;
            return Event::Trigger(at, output);
        }
        let crest = self.at_top_next;
        self.at_top_next = !crest;
        if !crest {
            self.from = self.next_end;
        }
        let end = self.next_end;
        if self.repetitions == 0 {
            self.update(true);
        } else {
            self.repetitions -= 1;
        }
        self.next_end = end + u64::from(self.top);
        if crest {
            let after = self.rises_after(1, self.store.get(CCR6));
            self.trigger_at[1] = after.map_or(NEVER, |ticks| self.next_end - ticks);
            return Event::Crest(end);
        }
        self.plan_trigger();
        Event::Valley(end)
    }

    /// Plans the edges on the way up, where the counter reaches a compare value: OC4REF rises, OC6REF falls.
    fn plan_trigger(&mut self) {
        let after =
            [self.rises_after(0, self.active[3]), self.rises_after(1, self.store.get(CCR6))];
        let [rises, falls] = after.map(|ticks| ticks.map_or(NEVER, |ticks| self.from + ticks));
        (self.trigger_at[0], self.trigger_at[2]) = (rises, falls);
    }

    /// Returns the ticks between the counter at 0 and the edge of a trigger output at this compare value; none if there is no edge.
    fn rises_after(&self, output: usize, compare: u32) -> Option<u64> {
        // Channel 4 in PWM mode 2 as output 1, channel 6 in mode 1 as output 2.
        let (mode, wanted) = [(CCMR2, 7), (CCMR3, 6)][output];
        let rises = self.store.get(mode) >> 12 & 7 == wanted && (1..=self.top).contains(&compare);
        let selected = [(4, 7, 7), (20, 0xf, 9)][output];
        let is_trigger = self.store.get(CR2) >> selected.0 & selected.1 == selected.2;
        (rises && is_trigger).then_some(u64::from(compare))
    }

    fn update(&mut self, flag: bool) {
        if self.drop_update > 0 {
            self.drop_update -= 1;
            return;
        }
        self.top = self.store.get(ARR).max(1);
        self.active = std::array::from_fn(|channel| self.store.get(CCR1 + 4 * channel as u32));
        self.repetitions = self.store.get(RCR);
        if flag {
            self.status |= UIF;
        }
        if self.store.get(CR2) >> 4 & 7 == 2 {
            self.trigger_at[0] = self.next_end;
        }
    }

    fn preloads(&self, channel: usize) -> bool {
        let register = self.store.get([CCMR1, CCMR2][channel / 2]);
        register >> (3 + 8 * (channel % 2)) & 1 != 0
    }

    /// Processes a fault inside the chip: clock, supply, memory, lock-up.
    pub fn system_break(&mut self) {
        self.pull_break(SBIF);
    }

    /// Sets the outputs of the comparators.
    pub fn set_comparators(&mut self, outputs: [bool; 7]) {
        self.comparators = outputs;
        self.update_break();
    }

    /// Sets the level of the break pin; `None` is uncertain, and is assumed to be the level that breaks.
    pub fn set_break_pin(&mut self, level: Option<bool>) {
        self.break_pin = level;
        self.update_break();
    }

    /// Updates the break request: the enabled sources, each with its own polarity, go through one OR gate, and BKP is
    /// the polarity after it (section 28.3.16, overview of the break circuit).
    fn update_break(&mut self) {
        let (af1, bdtr) = (self.store.get(AF1), self.store.get(BDTR));
        let bit = |n: usize| af1 >> n & 1 != 0;
        let pin = bit(0) && self.break_pin.map_or(bdtr & BKP != 0, |high| high != bit(9));
        // BKCMP1E is bit 1, BKCMP1P bit 10; comparators 5 to 7 have no polarity.
        let comparator =
            (0..7).any(|n| bit(1 + n) && self.comparators[n] != (n < 4 && bit(10 + n)));
        if (pin || comparator) == (bdtr & BKP != 0) {
            self.pull_break(BIF);
        }
    }

    fn pull_break(&mut self, flag: u32) {
        let bdtr = self.store.get(BDTR);
        if bdtr & BKE != 0 {
            self.status |= flag;
            self.store.write(BDTR, bdtr & !MOE);
        }
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        let (count, down) = self.count(now);
        Some(match offset {
            CR1 => self.store.get(CR1) & !(1 << 4) | u32::from(down) << 4,
            CNT => count,
            SR => self.status,
            _ => return self.store.read(offset),
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Rules) -> Option<Effect> {
        let now = rules.now;
        let old = self.store.read(offset)?;
        match offset {
            SR => {
                self.status &= value;
                self.update_break();
                return Some(Effect::Look);
            }
            EGR => {
                if value & 1 != 0 {
                    self.held = 0;
                    self.update(self.store.get(CR1) & 4 == 0);
                    if self.counting() {
                        self.start(now);
                    }
                }
                if value & 1 << 7 != 0 {
                    self.pull_break(BIF);
                }
                return Some(Effect::Look);
            }
            BDTR => {
                let lock = value >> 8 & 3;
                let first = *self.first_lock.get_or_insert(lock);
                rules.require(lock == first, Rule::LockOnce, || {
                    format!("TIM1_BDTR: LOCK {lock} after {first} was written first")
                });
                self.store.write(BDTR, self.locked(old, value) & !(3 << 8) | first << 8);
                self.update_break();
                return Some(Effect::None);
            }
            // Locked with levels 2 and 3.
            AF1 if self.lock() >= 1 => return Some(Effect::None),
            // OISx and OISxN.
            CR2 if self.lock() >= 1 => {
                let idle = 0x0005_ff00;
                self.store.write(CR2, value & !idle | old & idle);
                return Some(Effect::Look);
            }
            CCER if self.lock() >= 2 => {
                return self.store.write(CCER, value & !0xaaaa | old & 0xaaaa);
            }
            CCMR1 | CCMR2 if self.lock() >= 3 => return Some(Effect::None),
            PSC if value != 0 => return None,
            CR1 if value & 1 != 0 && value >> 5 & 3 == 0 => return None,
            _ => {}
        }
        self.store.write(offset, value)?;
        match offset {
            CR1 if value & !old & 1 != 0 => self.start(now),
            CR1 if old & !value & 1 != 0 => {
                self.held = self.count(now).0;
                self.next_end = NEVER;
                self.trigger_at = [NEVER; 3];
            }
            ARR if self.store.get(CR1) & 1 << 7 == 0 => self.top = value.max(1),
            CCR1..=CCR4 => {
                let channel = ((offset - CCR1) / 4) as usize;
                if !self.preloads(channel) {
                    self.active[channel] = value;
                }
                return Some(Effect::None);
            }
            _ => {}
        }
        Some(Effect::Look)
    }

    fn start(&mut self, now: u64) {
        self.from = now - u64::from(self.held.min(self.top));
        self.next_end = self.from + u64::from(self.top);
        self.at_top_next = true;
        self.plan_trigger();
    }

    fn lock(&self) -> u32 {
        self.store.get(BDTR) >> 8 & 3
    }

    fn locked(&self, old: u32, new: u32) -> u32 {
        // Dead time, break enable, polarity and filters, automatic output; then OSSR and OSSI.
        let first = 0x0fff_f0ff & !MOE;
        let kept = [0, first, first | OSSR | OSSI, first | OSSR | OSSI][self.lock() as usize];
        old & kept | new & !kept
    }
}
