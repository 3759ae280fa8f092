//! The core's own registers: NVIC, SCB, SysTick, cycle counter (ARMv7-M, chapter B3; Cortex-M4 TRM).

mod mpu;

use crate::periph::{Effect, Store};
pub use mpu::Mpu;

/// Exception numbers.
pub const NMI: u16 = 2;
/// See [`NMI`].
pub const HARD_FAULT: u16 = 3;
/// See [`NMI`].
pub const PEND_SV: u16 = 14;
/// See [`NMI`].
pub const SYSTICK: u16 = 15;
/// Number of exceptions, including those of the peripherals.
const EXCEPTIONS: usize = 16 + 102;
/// The priority of a core that runs no exception.
pub const THREAD: i16 = 256;

/// SysTick on the core clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct SysTick {
    control: u32,
    reload: u32,
    expires: u64,
    /// Ticks per cycle of the core.
    pub cycle: u64,
}

impl SysTick {
    /// Returns the ticks from one zero to the next.
    fn period(&self) -> u64 {
        (u64::from(self.reload) + 1) * self.cycle.max(1)
    }

    /// Returns the time at which it next counts to zero.
    pub fn next_event(&self) -> u64 {
        if self.control & 1 != 0 { self.expires } else { u64::MAX }
    }

    /// Counts; returns whether it requests its exception.
    pub fn happen(&mut self, now: u64) -> bool {
        if now < self.next_event() {
            return false;
        }
        self.expires += self.period();
        self.control |= 1 << 16;
        self.control & 2 != 0
    }
}

defaults! {
    /// The registers; by default after a reset, on the internal oscillator.
    #[derive(Clone, Debug)]
    pub struct Scs {
        /// A bit for each exception: pending, enabled, requested by its peripheral.
        pending: u128,
        enabled: u128 = 0xffff,
        line: u128,
        priority: [u8; EXCEPTIONS] = [0; EXCEPTIONS],
        /// Exceptions being served, innermost last.
        pub active: Vec<u16>,
        vtor: u32 = 0x0800_0000,
        grouping: u32,
        /// Reasons of faults.
        pub cfsr: u32,
        /// Reasons of hard faults.
        pub hfsr: u32,
        plain: Store = Store::of("SCS"),
        /// Memory protection.
        pub mpu: Mpu,
        demcr: u32,
        dwt_control: u32,
        /// Difference by which the cycle counter is behind time.
        cycles_from: u64,
        cycles_held: u32,
        /// SysTick.
        pub systick: SysTick = SysTick { cycle: crate::periph::rcc::HSI_TICKS, ..SysTick::default() },
    }
}

impl Scs {
    /// Returns the vector of an exception.
    pub fn vector(&self, exception: u16) -> u32 {
        self.vtor + 4 * u32::from(exception)
    }

    /// Makes an exception pending.
    pub fn pend(&mut self, exception: u16) {
        self.pending |= 1 << exception;
    }

    /// Sets the level of a peripheral's request: the exception is pending while the level is high and it is not being served.
    pub fn set_line(&mut self, irq: u16, high: bool) {
        let exception = irq + 16;
        self.line = self.line & !(1 << exception) | u128::from(high) << exception;
        if high && !self.active.contains(&exception) {
            self.pend(exception);
        }
    }

    fn priority_of(&self, exception: u16) -> i16 {
        match exception {
            1 => -3,
            NMI => -2,
            HARD_FAULT => -1,
            // Four bits are implemented.
            _ => i16::from(self.priority[usize::from(exception)] & 0xf0),
        }
    }

    /// Returns the part of a priority that decides about preemption.
    fn group(&self, priority: i16) -> i16 {
        if priority < 0 { priority } else { priority >> (self.grouping + 1) << (self.grouping + 1) }
    }

    /// Returns the priority at which the core runs, without its masks.
    pub fn running(&self) -> i16 {
        self.active.iter().map(|e| self.group(self.priority_of(*e))).min().unwrap_or(THREAD)
    }

    /// Returns the exception that is due next with these masks.
    pub fn due(&self, primask: u32, basepri: u32) -> Option<u16> {
        let (best, priority) = self.best()?;
        let mut running = self.running();
        if basepri != 0 {
            running = running.min(self.group((basepri & 0xf0) as i16));
        }
        if primask & 1 != 0 {
            running = running.min(0);
        }
        (self.group(priority) < running).then_some(best)
    }

    /// Whether an enabled exception is pending that only a mask blocks; it would wake the core regardless of PRIMASK.
    pub fn wakes(&self) -> bool {
        self.best().is_some_and(|(_, priority)| self.group(priority) < self.running())
    }

    fn best(&self) -> Option<(u16, i16)> {
        let due = self.pending & self.enabled;
        // Usually no exception is due.
        (due.trailing_zeros() as u16..EXCEPTIONS as u16)
            .filter(|n| due >> n & 1 != 0)
            .map(|n| (n, self.priority_of(n)))
            .min_by_key(|(n, priority)| (*priority, *n))
    }

    /// Begins an exception.
    pub fn begin(&mut self, exception: u16) {
        self.pending &= !(1 << exception);
        self.active.push(exception);
    }

    /// Returns from the innermost exception.
    pub fn end(&mut self) -> Option<u16> {
        let exception = self.active.pop()?;
        if self.line >> exception & 1 != 0 {
            self.pend(exception);
        }
        Some(exception)
    }

    /// Returns the cycle counter.
    pub fn cycles(&self, now: u64) -> u32 {
        if self.counting() { now.wrapping_sub(self.cycles_from) as u32 } else { self.cycles_held }
    }

    /// Whether the memory protection now denies every access to an address.
    pub fn denies(&self, address: u32) -> bool {
        let inside = self.mpu.guard().is_some_and(|g| (g.address..g.end()).contains(&address));
        inside && (self.running() >= 0 || self.mpu.holds_in_faults())
    }

    /// Accounts for a stop of the cycle counter for some ticks.
    pub fn stand_still(&mut self, ticks: u64) {
        self.cycles_from = self.cycles_from.wrapping_add(ticks);
    }

    fn counting(&self) -> bool {
        self.dwt_control & 1 != 0 && self.demcr & 1 << 24 != 0
    }

    /// Reads a register; `None` if it is not modelled.
    pub fn read(&self, address: u32, now: u64) -> Option<u32> {
        let bits = |flags: u128| (flags >> (16 + 8 * (address & 0x7f))) as u32;
        Some(match address {
            0xe000_e010 => self.systick.control,
            0xe000_e014 => self.systick.reload,
            0xe000_e018 => {
                let left = self.systick.expires.saturating_sub(now);
                (left / self.systick.cycle.max(1)) as u32 & 0xff_ffff
            }
            0xe000_e100..0xe000_e110 | 0xe000_e180..0xe000_e190 => bits(self.enabled),
            0xe000_e200..0xe000_e210 | 0xe000_e280..0xe000_e290 => bits(self.pending),
            0xe000_e300..0xe000_e310 => {
                let first = 16 + 8 * (address - 0xe000_e300) as u16;
                (0..32).fold(0, |w, n| w | u32::from(self.active.contains(&(first + n))) << n)
            }
            0xe000_e400..0xe000_e468 | 0xe000_ed18..0xe000_ed24 => {
                let four = self.priority.iter().skip(first_priority(address)).take(4);
                four.rev().fold(0, |word, one| word << 8 | u32::from(*one))
            }
            0xe000_ed04 => {
                let active = self.active.last().map_or(0, |e| u32::from(*e));
                let pending = self.best().map_or(0, |(e, _)| u32::from(e));
                let is_pending = |exception: u16| (self.pending >> exception) as u32 & 1;
                active | pending << 12 | is_pending(PEND_SV) << 28 | is_pending(SYSTICK) << 26
            }
            0xe000_ed08 => self.vtor,
            0xe000_ed0c => 0xfa05_0000 | self.grouping << 8,
            0xe000_ed28 => self.cfsr,
            0xe000_ed2c => self.hfsr,
            0xe000_ed90..0xe000_edbc => return self.mpu.read(address),
            0xe000_edfc => self.demcr,
            0xe000_1000 => 0x4000_0000 | self.dwt_control,
            0xe000_1004 => self.cycles(now),
            _ => return self.plain.read(address),
        })
    }

    /// Writes a register; `None` if it is not modelled.
    pub fn write(&mut self, address: u32, value: u32, now: u64) -> Option<Effect> {
        // The upper of two registers clears.
        let set = |flags: &mut u128| {
            let bits = u128::from(value) << (16 + 8 * (address & 0x7f)) & ((1 << EXCEPTIONS) - 1);
            *flags = if address & 0x80 == 0 { *flags | bits } else { *flags & !bits };
        };
        match address {
            0xe000_e010 => {
                let was = self.systick.control;
                self.systick.control = value & 7;
                if value & !was & 1 != 0 {
                    self.systick.expires = now + self.systick.period();
                }
            }
            0xe000_e014 => self.systick.reload = value & 0xff_ffff,
            0xe000_e018 => self.systick.expires = now + self.systick.period(),
            0xe000_e100..0xe000_e110 | 0xe000_e180..0xe000_e190 => set(&mut self.enabled),
            0xe000_e200..0xe000_e210 | 0xe000_e280..0xe000_e290 => set(&mut self.pending),
            0xe000_e400..0xe000_e468 | 0xe000_ed18..0xe000_ed24 => {
                let four = self.priority.iter_mut().skip(first_priority(address));
                four.zip(value.to_le_bytes()).for_each(|(one, new)| *one = new);
            }
            0xe000_ed04 => {
                let bit = |bit: u32, exception: u16| u128::from(value >> bit & 1) << exception;
                self.pending |= bit(31, NMI) | bit(28, PEND_SV) | bit(26, SYSTICK);
                self.pending &= !(bit(27, PEND_SV) | bit(25, SYSTICK));
            }
            0xe000_ed08 => self.vtor = value & !0x1ff,
            // Only with the key.
            0xe000_ed0c if value >> 16 == 0x05fa => {
                self.grouping = value >> 8 & 7;
                if value & 1 << 2 != 0 {
                    return Some(Effect::Reset);
                }
            }
            0xe000_ed28 => self.cfsr &= !value,
            0xe000_ed2c => self.hfsr &= !value,
            0xe000_ed90..0xe000_edbc => {
                self.mpu.write(address, value)?;
                return Some(Effect::Look);
            }
            0xe000_edfc | 0xe000_1000 => {
                let cycles = self.cycles(now);
                if address == 0xe000_edfc {
                    self.demcr = value
                } else {
                    self.dwt_control = value & 1
                }
                self.cycles_held = cycles;
                self.cycles_from = now.wrapping_sub(u64::from(cycles));
                return Some(Effect::None);
            }
            0xe000_1004 => {
                self.cycles_held = value;
                self.cycles_from = now.wrapping_sub(u64::from(value));
                return Some(Effect::None);
            }
            _ => return self.plain.write(address, value),
        }
        Some(Effect::Look)
    }
}

/// Returns the exception whose priority a register holds in its lowest byte.
fn first_priority(address: u32) -> usize {
    let first = if address < 0xe000_ed00 { address - 0xe000_e3f0 } else { address - 0xe000_ed14 };
    first as usize
}
