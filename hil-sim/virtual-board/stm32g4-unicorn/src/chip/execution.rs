//! The execution of code: its time, and the stored blocks.

use super::{Chip, Circuit};
use crate::cost::{self, Block};
use crate::{memory::Region, periph::plain, scs};

/// A function of the main loop whose calls are counted as if its memory had no wait states.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Its region in the flash.
    pub function: Region,
    /// Estimated cycles of each call, without interrupts.
    pub calls: Vec<u32>,
    /// The blocks of the longest call.
    pub longest: Vec<Block>,
    /// The blocks of the present call, including those of its callees; none outside a call.
    present: Vec<Block>,
    /// End of the last block before the present call: the return address.
    returns_to: u32,
}

impl Watched {
    /// Counts the calls of a function in the flash.
    pub fn new(function: Region) -> Self {
        Self { function, ..Self::default() }
    }

    /// Processes a block of the flash that is about to be executed, perhaps outside a call.
    fn block(&mut self, address: u32, size: u32, cycles: u32) {
        if address != self.function.address && self.present.is_empty() {
            self.returns_to = address + size;
            return;
        }
        if let Some(last) = self.present.last_mut() {
            last.taken = last.address + last.size != address;
        }
        if address != self.returns_to {
            self.present.push(Block { address, size, cycles, taken: false });
            return;
        }
        let spent = cost::of(&self.present);
        if self.calls.iter().all(|call| *call < spent) {
            self.longest.clone_from(&self.present);
        }
        self.calls.push(spent);
        self.present.clear();
        self.returns_to = address + size;
    }
}

impl<C: Circuit> Chip<C> {
    /// Whether the core must stop before the block that begins here; never before the first block of a run, so that
    /// each run makes progress.
    #[inline]
    pub fn stops_here(&mut self) -> bool {
        !std::mem::take(&mut self.first) && self.wants_attention()
    }

    /// Whether the core must stop.
    #[inline]
    pub fn wants_attention(&self) -> bool {
        self.attention || self.now >= self.deadline
    }

    /// Processes a fetch or a read of some bytes of the flash: reports an error of their check code. Returns whether
    /// the core waits before it continues.
    #[inline]
    pub fn fetch(&mut self, address: u32, size: u32) -> bool {
        if self.flash.has_bad_code() && self.flash.is_bad(address, size) {
            self.flash_error();
        }
        let waits = self.flash.delays(address, self.now);
        if waits {
            self.stalled_until = self.flash.busy_until;
            self.attention = true;
        }
        waits
    }

    /// Processes a double word of the flash that its check code cannot correct.
    pub(super) fn flash_error(&mut self) {
        if self.syscfg.get(plain::CFGR2) & plain::ECCL != 0 {
            self.system_break();
        }
        self.scs.pend(scs::NMI);
        self.attention = true;
    }

    /// Processes instructions from the flash that are about to be executed.
    #[inline]
    pub fn instructions(&mut self, count: u64) {
        self.now += self.rcc.ticks_per_cycle * count * self.flash_cycles;
        self.instructions += count;
        self.last_block = None;
    }

    /// Number of instructions from the flash that begin before the next event.
    pub fn instructions_before_event(&self) -> u64 {
        let ticks = self.rcc.ticks_per_cycle * self.flash_cycles;
        if self.attention { 0 } else { self.deadline.saturating_sub(self.now) / ticks }
    }

    /// Processes a block in the flash of this size and cost that is about to be executed.
    #[inline]
    pub fn watch(&mut self, address: u32, size: u32, cycles: u32) {
        let in_main = self.scs.running() == scs::THREAD;
        if let (Some(watched), true) = (&mut self.watched, in_main) {
            watched.block(address, size, cycles);
        }
    }

    /// Processes a block in CCM, or in the flash while a counted interrupt runs, that is about to be executed.
    #[inline]
    pub fn block(&mut self, address: u32, size: u32, cycles: u32) {
        let taken = self.last_block.is_some_and(|(_, end)| end != address);
        if taken {
            self.now += u64::from(cost::TAKEN);
        }
        self.now += u64::from(cycles);
        self.last_block = Some((address, address + size));
        if self.keep_blocks {
            if taken && let Some(block) = self.blocks.last_mut() {
                block.taken = true;
            }
            self.blocks.push(Block { address, size, cycles, taken: false });
        }
    }

    /// Begins an interrupt whose cycles are counted: blocks are stored from now on.
    pub fn begin_counted(&mut self) {
        self.in_counted = self.keep_blocks;
        self.blocks.clear();
        self.compared = (0, self.accesses);
        self.last_block = None;
    }
}
