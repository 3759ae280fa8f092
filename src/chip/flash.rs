//! The flash pages of settings and history: reading that tolerates torn double words, erasing, programming.
//!
//! Erasing and programming follow RM0440 (FLASH main memory erase and programming sequences). With two
//! banks the code, in the first, continues while the second is written; with one, the core waits for
//! an erasure (22 ms), so the outputs must be off.
//!
//! Own code replaces `stm32g4xx_hal::flash` (0.1.0), which suits neither the second bank nor torn data: it never sets the bank (BKER),
//! waits without a limit, checks one error flag of an erasure, accepts a double word of which one half reads back, leaves the data cache
//! as it is, and reads without regard to errors that the flash cannot correct.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::asm;
use stm32g4xx_hal::pac;

use super::time;
use crate::board;
use crate::store::{Flash, FlashError};

/// The pages of the settings.
pub struct Pages {
    registers: pac::FLASH,
    dual_bank: bool,
}

/// Whether a double word of the settings, which may be torn, is being read.
static READING: AtomicBool = AtomicBool::new(false);
/// Whether that double word was torn.
static TORN: AtomicBool = AtomicBool::new(false);

/// The two keys that unlock the flash (RM0440, FLASH_KEYR).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// All error flags and the end flag of FLASH_SR; written back they are cleared.
const STATUS_FLAGS: u32 = 0xc3fb;
/// The end flag among them.
const STATUS_END: u32 = 1;

/// Clears an uncorrectable error of the flash if it belongs to a read of the settings; `false` if it does not. For the
/// non-maskable interrupt.
///
/// An error in the code that reads the settings would be taken for an error of the settings. But the code is fetched again later, and
/// then the error is raised again.
pub fn forgive_torn() -> bool {
    // SAFETY: FLASH exists for as long as the chip does; only its error flags are touched.
    let registers = unsafe { &*pac::FLASH::ptr() };
    let errors = registers.eccr().read();
    let torn = errors.eccd().bit() || errors.eccd2().bit();
    if !(torn && READING.load(Ordering::Relaxed)) {
        return false;
    }
    registers.eccr().modify(|_, w| w.eccd().set_bit().eccd2().set_bit());
    TORN.store(true, Ordering::Relaxed);
    true
}

impl Pages {
    /// The pages, through the registers of the flash.
    pub fn new(registers: pac::FLASH) -> Self {
        let dual_bank = registers.optr().read().dbank().is_dual_bank_mode();
        Self { registers, dual_bank }
    }

    /// Does `work` with the flash unlocked; returns its status.
    fn unlocked(&mut self, work: impl FnOnce(&mut Self) -> u32) -> u32 {
        if self.registers.cr().read().lock().bit() {
            for key in KEYS {
                // SAFETY: the keys of the reference manual.
                self.registers.keyr().write(|w| unsafe { w.bits(key) });
            }
        }
        // SAFETY: flags only; written as 1 they are cleared.
        self.registers.sr().write(|w| unsafe { w.bits(STATUS_FLAGS) });
        // The data cache is off during the work: the control interrupt reads the flash meanwhile, and the cache would return wrong data
        // (`stm32g4xx_hal_flash.c` switches it off for the same reason).
        self.registers.acr().modify(|_, w| w.dcen().clear_bit());
        let status = work(self);
        self.registers.cr().modify(|_, w| w.per().clear_bit().pg().clear_bit());
        self.registers.cr().modify(|_, w| w.lock().set_bit());
        // Neither cache follows changes of the flash. Each can be cleared only while it is off.
        self.registers.acr().modify(|_, w| w.icen().clear_bit());
        self.registers.acr().modify(|_, w| w.icrst().set_bit().dcrst().set_bit());
        self.registers.acr().modify(|_, w| w.icrst().clear_bit().dcrst().clear_bit());
        self.registers.acr().modify(|_, w| w.icen().set_bit().dcen().set_bit());
        status
    }

    /// Waits for the end of the operation; returns its error flags, or all bits if it does not end.
    fn finished(&self) -> u32 {
        let began = time::now();
        while self.registers.sr().read().bsy().bit() {
            let us = time::now().wrapping_sub(began) / board::CYCLES_PER_US;
            if us > board::FLASH_TIMEOUT_US {
                return u32::MAX;
            }
        }
        self.registers.sr().read().bits() & STATUS_FLAGS & !STATUS_END
    }
}

impl Flash for Pages {
    fn read(&mut self, slot: usize, word: usize) -> Option<u64> {
        let address = board::settings_address(slot, word) as *const u32;
        TORN.store(false, Ordering::Relaxed);
        READING.store(true, Ordering::SeqCst);
        // SAFETY: an aligned address in the pages of the settings, which nothing else uses; volatile, because they
        // change unknown to the compiler.
        let (low, high) = unsafe { (address.read_volatile(), address.add(1).read_volatile()) };
        // The interrupt comes before the next line.
        asm::dsb();
        asm::isb();
        forgive_torn();
        READING.store(false, Ordering::SeqCst);
        let torn = TORN.load(Ordering::Relaxed);
        (!torn).then_some(u64::from(low) | u64::from(high) << 32)
    }

    fn erase(&mut self, slot: usize) -> Result<(), FlashError> {
        let (second_bank, page) = board::settings_page(slot, self.dual_bank);
        let status = self.unlocked(|pages| {
            pages.registers.cr().modify(|_, w| {
                // SAFETY: seven bits; `board` keeps the page inside.
                unsafe { w.pnb().bits(page) };
                w.per().set_bit().bker().bit(second_bank)
            });
            pages.registers.cr().modify(|_, w| w.strt().set_bit());
            pages.finished()
        });
        if status == 0 { Ok(()) } else { Err(FlashError::Erase(status)) }
    }

    fn program(&mut self, slot: usize, word: usize, value: u64) -> Result<(), FlashError> {
        let address = board::settings_address(slot, word) as *mut u32;
        let status = self.unlocked(|pages| {
            pages.registers.cr().modify(|_, w| w.pg().set_bit());
            // SAFETY: as in `read`. Both halves of one double word, the lower first: the second write
            // begins the programming.
            unsafe {
                address.write_volatile(value as u32);
                asm::isb();
                address.add(1).write_volatile((value >> 32) as u32);
            }
            asm::dsb();
            pages.finished()
        });
        if status == 0 { Ok(()) } else { Err(FlashError::Program(status)) }
    }
}
