//! Everything around the core: time, registers, events.
//!
//! Time is counted in ticks of 170 MHz, the clock of core and timers once the firmware has started
//! its PLL.

use crate::memory;
use crate::periph::Effect;
use crate::periph::adc::Adc;
use crate::periph::analog::{Comparators, Dacs};
use crate::periph::debug::Debug;
use crate::periph::encoder::EncoderTimer;
use crate::periph::flash::Flash;
use crate::periph::gpio::Gpio;
use crate::periph::iwdg::Iwdg;
use crate::periph::lpuart::Lpuart;
use crate::periph::pwr::Pwr;
use crate::periph::rcc::Rcc;
use crate::periph::syscfg::{Exti, Syscfg};
use crate::periph::tim1::Tim1;
use crate::scs::{self, Scs};

/// Ticks per second.
pub const TICKS_PER_S: u64 = 170_000_000;
/// No event.
pub const NEVER: u64 = u64::MAX;
/// Longest time that the core runs on without being looked at, ticks.
const PATIENCE: u64 = 2 * 28_334;

/// Position of the converters' interrupt in the vector table, from the first peripheral.
pub const IRQ_ADC1_2: u16 = 18;
const IRQ_LPUART: u16 = 91;

/// Why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came.
    Power,
    /// The reset pin.
    Pin,
    /// The firmware asked for it.
    Software,
    /// The independent watchdog.
    Watchdog,
}

/// An access that the model does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Where.
    pub address: u32,
    /// What was to be written, if it was a write.
    pub written: Option<u32>,
    /// Last known place of the core: the instruction, in CCM the block.
    pub at: u32,
}

/// Where a block of the control interrupt began, and its cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Address of its first instruction.
    pub address: u32,
    /// Bytes.
    pub size: u32,
    /// Cycles with its last branch not taken.
    pub cycles: u32,
    /// Whether that branch was taken.
    pub taken: bool,
}

/// A function of the main loop whose calls are counted as if its memory had no wait states.
#[derive(Clone, Debug)]
pub struct Watched {
    /// Where it begins and ends.
    pub range: (u32, u32),
    /// Estimated cycles of each call, interrupts not counted.
    pub calls: Vec<u32>,
    /// The blocks of the longest.
    pub longest: Vec<Block>,
    /// Those of the present one.
    present: Vec<Block>,
}

impl Watched {
    /// A function in the flash, at an address, with its size in bytes.
    pub fn new((address, size): (u32, u32)) -> Self {
        let range = (address, address + size);
        Self { range, calls: Vec::new(), longest: Vec::new(), present: Vec::new() }
    }

    /// Whether a block is its own.
    #[inline]
    pub fn has(&self, address: u32) -> bool {
        (self.range.0..self.range.1).contains(&address)
    }

    /// A block of the flash is about to be executed; `cycles` of one of its own.
    fn block(&mut self, address: u32, size: u32, cycles: u32) {
        if let Some(last) = self.present.last_mut() {
            last.taken = last.address + last.size != address;
        }
        if address == self.range.0 {
            self.present.clear();
        } else if self.present.is_empty() {
            return;
        }
        if self.has(address) {
            self.present.push(Block { address, size, cycles, taken: false });
            return;
        }
        let spent = crate::cost::of(&self.present);
        if self.calls.iter().all(|call| *call < spent) {
            self.longest.clone_from(&self.present);
        }
        self.calls.push(spent);
        self.present.clear();
    }
}

/// The chip but for its core and memories.
#[derive(Clone, Debug)]
pub struct Chip {
    /// Time, ticks.
    pub now: u64,
    /// Time up to which the core may run.
    pub deadline: u64,
    /// The core has just been let go.
    pub first: bool,
    /// Something to be done before the core goes on.
    pub attention: bool,
    /// The first access nobody knows.
    pub unknown: Option<Unknown>,
    /// A reset that is due.
    pub reset: Option<Reset>,
    /// Where the core was last seen.
    pub at: u32,
    /// Accesses to registers since power-on.
    pub accesses: u64,
    /// Instructions of the flash since power-on.
    pub instructions: u64,
    /// Blocks executed in CCM since they were taken, while asked for.
    pub blocks: Vec<Block>,
    /// Whether blocks are kept.
    pub keep_blocks: bool,
    /// Blocks and accesses up to the compare value of a leg that was written last.
    pub compared: (usize, u64),
    /// A function of the main loop whose calls are counted, if there is one.
    pub watched: Option<Watched>,
    /// Whether registers that are not known read as 0.
    pub forgiving: bool,
    last_block: Option<(u32, u32)>,
    /// Core-private registers.
    pub scs: Scs,
    /// Clocks.
    pub rcc: Rcc,
    /// Supply.
    pub pwr: Pwr,
    /// Flash.
    pub flash: Flash,
    /// Ports A to G.
    pub gpio: [Gpio; 7],
    /// System configuration.
    pub syscfg: Syscfg,
    /// Interrupts of pins and comparators.
    pub exti: Exti,
    /// Timer of the power stage.
    pub tim1: Tim1,
    /// Timer of the encoder.
    pub tim2: EncoderTimer,
    /// Converters.
    pub adc: Adc,
    /// Comparators.
    pub comp: Comparators,
    /// Reference voltages of the comparators.
    pub dac: Dacs,
    /// Console.
    pub lpuart: Lpuart,
    /// Watchdog.
    pub iwdg: Iwdg,
    /// Debug support.
    pub debug: Debug,
}

impl Chip {
    /// A chip after power-on, whose flash is erased.
    pub fn new() -> Self {
        Self {
            now: 0,
            deadline: 0,
            first: false,
            attention: false,
            unknown: None,
            reset: None,
            at: 0,
            accesses: 0,
            instructions: 0,
            blocks: Vec::new(),
            keep_blocks: false,
            compared: (0, 0),
            watched: None,
            forgiving: false,
            last_block: None,
            scs: Scs::default(),
            rcc: Rcc::new(Reset::Power),
            pwr: Pwr::default(),
            flash: Flash::new(),
            gpio: std::array::from_fn(Gpio::new),
            syscfg: Syscfg::default(),
            exti: Exti::default(),
            tim1: Tim1::default(),
            tim2: EncoderTimer::default(),
            adc: Adc::default(),
            comp: Comparators::default(),
            dac: Dacs::default(),
            lpuart: Lpuart::default(),
            iwdg: Iwdg::default(),
            debug: Debug::default(),
        }
    }

    /// After a reset: registers at their values, flash contents and the world outside as before.
    pub fn reset(&mut self, cause: Reset) {
        let fresh = Self::new();
        let old = std::mem::replace(self, fresh);
        self.now = old.now;
        self.accesses = old.accesses;
        self.instructions = old.instructions;
        self.keep_blocks = old.keep_blocks;
        self.watched = old.watched;
        self.forgiving = old.forgiving;
        let mut flags = old.rcc.reset_flags();
        if cause == Reset::Power {
            flags = 0;
        }
        self.rcc = Rcc::new(cause);
        self.rcc.add_reset_flags(flags);
        self.rcc.crystal_lives = old.rcc.crystal_lives;
        self.flash = old.flash.after_reset();
        self.tim1.fault_pin_high = old.tim1.fault_pin_high;
        self.tim1.drop_update = old.tim1.drop_update;
        self.tim2.set_position(old.tim2.position());
        self.adc.inputs = old.adc.inputs;
        self.adc.lose_triggers = old.adc.lose_triggers;
        self.lpuart.wire = old.lpuart.wire;
    }

    /// Whether the core is to stop before the block that begins here; never before the first of a run, so
    /// that each run gets on.
    #[inline]
    pub fn stops_here(&mut self) -> bool {
        !std::mem::take(&mut self.first) && self.wants_attention()
    }

    /// Whether the core is to stop.
    #[inline]
    pub fn wants_attention(&self) -> bool {
        self.attention || self.now >= self.deadline
    }

    /// Instructions from the flash are about to be executed.
    #[inline]
    pub fn instructions(&mut self, count: u64) {
        self.now += self.rcc.ticks_per_cycle() * count;
        self.instructions += count;
        self.last_block = None;
    }

    /// A block in the flash is about to be executed, of this size and cost if it is watched.
    #[inline]
    pub fn watch(&mut self, address: u32, size: u32, cycles: u32) {
        let in_main = self.scs.running() == scs::THREAD;
        if let (Some(watched), true) = (&mut self.watched, in_main) {
            watched.block(address, size, cycles);
        }
    }

    /// A block in CCM is about to be executed.
    #[inline]
    pub fn block(&mut self, address: u32, size: u32, cycles: u32) {
        let taken = self.last_block.is_some_and(|(_, end)| end != address);
        if taken {
            self.now += u64::from(crate::cost::TAKEN);
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

    /// Blocks since the last call.
    pub fn begin_interrupt(&mut self) {
        self.blocks.clear();
        self.compared = (0, self.accesses);
        self.last_block = None;
    }

    /// Reads a register, `size` bytes.
    pub fn read(&mut self, address: u32, size: u8) -> u32 {
        self.accesses += 1;
        let value = if let Some(word) = bit_band(address) {
            self.peek(word.0).map(|value| value >> word.1 & 1)
        } else {
            let value = self.read_word(address & !3);
            value.map(|value| value >> (8 * (address & 3)))
        };
        match value {
            Some(value) if size >= 4 => value,
            Some(value) => value & ((1 << (8 * size)) - 1),
            None => self.is_unknown(address, None),
        }
    }

    /// Writes a register, `size` bytes.
    pub fn write(&mut self, address: u32, size: u8, value: u32) {
        self.accesses += 1;
        let done = if let Some((word, bit)) = bit_band(address) {
            self.peek(word).and_then(|old| {
                let new = old & !(1 << bit) | (value & 1) << bit;
                self.write_word(word, new)
            })
        } else if size < 4 {
            let shift = 8 * (address & 3);
            let mask = ((1_u32 << (8 * size)) - 1) << shift;
            let word = address & !3;
            self.peek(word)
                .and_then(|old| self.write_word(word, old & !mask | value << shift & mask))
        } else {
            self.write_word(address, value)
        };
        if COMPARES.contains(&address) {
            self.compared = (self.blocks.len(), self.accesses);
        }
        if done.is_none() {
            self.is_unknown(address, Some(value));
        }
    }

    fn is_unknown(&mut self, address: u32, written: Option<u32>) -> u32 {
        if self.forgiving {
            return 0;
        }
        self.unknown.get_or_insert(Unknown { address, written, at: self.at });
        self.attention = true;
        0
    }

    /// What a read gives, without what a read does.
    fn peek(&mut self, address: u32) -> Option<u32> {
        match address & !0x3ff {
            IWDG | LPUART1 => Some(0),
            _ if (0xe000_e400..0xe000_e4f0).contains(&address) => self.scs.read(address, self.now),
            _ => self.read_word(address),
        }
    }

    fn read_word(&mut self, address: u32) -> Option<u32> {
        let offset = address & 0x3ff;
        let now = self.now;
        if address >= 0xe000_0000 {
            return match address & !0xfff {
                0xe004_2000 => self.debug.read(offset),
                _ => self.scs.read(address, now),
            };
        }
        if (memory::BANK_2..memory::FLASH + memory::FLASH_SIZE).contains(&address) {
            let (value, torn) = self.flash.load(address);
            if torn {
                if self.syscfg.flash_error_breaks() {
                    self.tim1.system_break();
                }
                self.scs.pend(scs::NMI);
                self.attention = true;
            }
            return Some(value);
        }
        match address & !0x3ff {
            TIM1 => self.tim1.read(offset, now),
            ADC1 => self.adc.read(offset),
            TIM2 => self.tim2.read(offset),
            RCC => self.rcc.read(offset),
            PWR => self.pwr.read(offset),
            FLASH_REGISTERS => self.flash.read(offset, now),
            LPUART1 => {
                let value = self.lpuart.read(offset);
                self.update_lines();
                value
            }
            IWDG => self.iwdg.read(offset, now),
            SYSCFG => match offset {
                0x200..0x220 => self.comp.read(offset - 0x200),
                _ => self.syscfg.read(offset),
            },
            EXTI => self.exti.read(offset),
            GPIO_FIRST..=GPIO_LAST => self.gpio[port(address)].read(offset),
            DAC1 => self.dac.read(0, offset),
            DAC3 => self.dac.read(1, offset),
            _ => None,
        }
    }

    fn write_word(&mut self, address: u32, value: u32) -> Option<()> {
        let offset = address & 0x3ff;
        let now = self.now;
        if address >= 0xe000_0000 {
            let effect = match address & !0xfff {
                0xe004_2000 => return self.debug.write(offset, value),
                _ => self.scs.write(address, value, now)?,
            };
            return self.follow(effect);
        }
        if (memory::BANK_2..memory::FLASH + memory::FLASH_SIZE).contains(&address) {
            let effect = self.flash.store(address, value, now)?;
            return self.follow(effect);
        }
        let effect = match address & !0x3ff {
            TIM1 => self.tim1.write(offset, value, now)?,
            ADC1 => self.adc.write(offset, value)?,
            TIM2 => self.tim2.write(offset, value)?,
            RCC => self.rcc.write(offset, value, now)?,
            PWR => self.pwr.write(offset, value)?,
            FLASH_REGISTERS => self.flash.write(offset, value, now)?,
            LPUART1 => self.lpuart.write(offset, value, now)?,
            IWDG => self.iwdg.write(offset, value, now)?,
            SYSCFG => match offset {
                0x200..0x220 => self.comp.write(offset - 0x200, value)?,
                _ => self.syscfg.write(offset, value)?,
            },
            EXTI => self.exti.write(offset, value)?,
            GPIO_FIRST..=GPIO_LAST => self.gpio[port(address)].write(offset, value)?,
            DAC1 => self.dac.write(0, offset, value)?,
            DAC3 => self.dac.write(1, offset, value)?,
            _ => return None,
        };
        self.follow(effect)
    }

    fn follow(&mut self, effect: Effect) -> Option<()> {
        match effect {
            Effect::None => {}
            Effect::Look => {
                self.update_lines();
                self.attention = true;
            }
            Effect::Reset => {
                self.reset = Some(Reset::Software);
                self.attention = true;
            }
            Effect::Nmi => {
                self.scs.pend(scs::NMI);
                self.attention = true;
            }
        }
        Some(())
    }

    /// The core locks up: to the break of TIM1, if the firmware wants that.
    pub fn lock_up(&mut self) {
        if self.syscfg.lock_up_breaks() {
            self.tim1.system_break();
        }
    }

    /// Interrupt requests that are levels.
    pub fn update_lines(&mut self) {
        let adc = self.adc.requests();
        self.scs.set_line(IRQ_ADC1_2, adc);
        let serial = self.lpuart.requests();
        self.scs.set_line(IRQ_LPUART, serial);
    }

    /// Time of the next event.
    pub fn next_event(&self) -> u64 {
        [
            self.tim1.next_event(),
            self.adc.next_event(),
            self.lpuart.next_event(),
            self.iwdg.next_event(),
            self.scs.systick.next_event(),
            self.rcc.next_event(),
            self.now.saturating_add(PATIENCE),
        ]
        .into_iter()
        .min()
        .unwrap_or(NEVER)
    }

    /// Whether the pins of the gates are the timer's.
    pub fn gates_connected(&self) -> bool {
        let [a, b, ..] = &self.gpio;
        let timer = Some(u32::from(crate::board::PWM_AF));
        [7, 8, 9, 10].iter().all(|pin| a.alternate(*pin) == timer)
            && [0, 1].iter().all(|pin| b.alternate(*pin) == timer)
    }

    /// The comparators see the analog signals: comparator 1 has PA1 at its positive input, which is the
    /// dc link here, comparator 3 PA0 or PC1.
    pub fn compare(&mut self, current_a: u16, current_b: u16, dc_link: u16) {
        self.comp.inputs[0] = dc_link;
        self.comp.inputs[2] = if self.comp.input_of(2) == 0 { current_a } else { current_b };
        for n in [0, 2] {
            // INMSEL 4 is DAC3, 5 is DAC1, channel 1 of either; the others are not modelled.
            self.comp.references[n] = match self.comp.reference_of(n) {
                4 => self.dac.code(1, 1),
                5 => self.dac.code(0, 1),
                _ => u16::MAX,
            };
        }
        self.tim1.set_comparators(std::array::from_fn(|n| self.comp.output(n)));
    }

    /// Lets happen what is due by now, up to the top of the PWM counter.
    pub fn catch_up(&mut self) -> Happened {
        let mut happened = Happened::default();
        let now = self.now;
        self.attention = false;
        while self.tim1.next_event() <= now {
            let event = self.tim1.happen();
            if let Some(at) = event.trigger {
                self.adc.trigger(at);
            }
            if event.crest {
                happened.crest = Some(event.at);
                return happened; // the world outside moves on first
            }
        }
        if self.rcc.happen(now) {
            self.tim1.system_break();
            self.scs.pend(scs::NMI);
        }
        self.adc.happen(now);
        self.lpuart.happen(now);
        if self.iwdg.expired(now) {
            self.reset = Some(Reset::Watchdog);
        }
        if self.scs.systick.happen(now) {
            self.scs.pend(scs::SYSTICK);
        }
        self.update_lines();
        happened
    }
}

impl Default for Chip {
    fn default() -> Self {
        Self::new()
    }
}

/// What [`Chip::catch_up`] has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Happened {
    /// The counter of TIM1 was at its top then; nothing that comes later has happened yet.
    pub crest: Option<u64>,
}

const TIM2: u32 = 0x4000_0000;
const IWDG: u32 = 0x4000_3000;
const PWR: u32 = 0x4000_7000;
const LPUART1: u32 = 0x4000_8000;
const SYSCFG: u32 = 0x4001_0000;
const EXTI: u32 = 0x4001_0400;
const TIM1: u32 = 0x4001_2c00;
/// Compare values of the three legs.
const COMPARES: std::ops::Range<u32> = TIM1 + 0x34..TIM1 + 0x40;
const RCC: u32 = 0x4002_1000;
const FLASH_REGISTERS: u32 = 0x4002_2000;
const GPIO_FIRST: u32 = 0x4800_0000;
const GPIO_LAST: u32 = 0x4800_1bff;
const ADC1: u32 = 0x5000_0000;
const DAC1: u32 = 0x5000_0800;
const DAC3: u32 = 0x5000_1000;

fn port(address: u32) -> usize {
    ((address - GPIO_FIRST) >> 10) as usize
}

/// The word and bit behind an address of the alias.
fn bit_band(address: u32) -> Option<(u32, u32)> {
    let offset = address.checked_sub(memory::BIT_BAND).filter(|offset| *offset < 0x60_0000)?;
    Some((memory::PERIPHERALS + (offset >> 7 << 2), offset >> 2 & 31))
}
