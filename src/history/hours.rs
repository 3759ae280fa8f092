//! Operating hours, starts and faults, counted by the main loop.

use defmt::Display2Format;
use drive_core::State;
use stm32g4xx_hal::pac::FLASH;

use super::History;
use super::ripple::Ripple;
use super::words::RIPPLE;
use crate::chip::flash::Pages;
use crate::chip::memory;
use crate::chip::watchdog::{Guard, extended};
use crate::store::FlashError;

/// Whether the flash has corrected an error since the last call.
fn take_corrected() -> bool {
    // SAFETY: FLASH always exists; only a flag that nothing else uses is read and cleared.
    let errors = unsafe { &*FLASH::ptr() }.eccr();
    let corrected = errors.read().eccc().bit();
    if corrected {
        errors.write(|w| w.eccc().set_bit());
    }
    corrected
}

/// The history, and the values for its next count.
pub struct Hours {
    /// Operating hours, starts and faults.
    pub history: History,
    /// Time up to which the hours are counted, ms.
    counted_ms: u32,
    /// Whether the drive was off in the last report.
    was_off: bool,
    /// Whether the control goes on while the history is written; otherwise the history is not written.
    dual_bank: bool,
    ripple: Ripple,
}

impl Hours {
    /// Continues the history in the flash.
    pub fn load(pages: &mut Pages, dual_bank: bool) -> Self {
        let (history, ripple) = (History::load(pages), Ripple::default());
        Self { history, counted_ms: 0, was_off: true, dual_bank, ripple }
    }

    /// Counts up to this time, ms, and writes when that is due; `dc_link` is the address of the dc link's
    /// voltage, none with the outputs off.
    pub fn count(
        &mut self,
        now_ms: u32,
        dc_link: Option<u32>,
        guard: &mut Guard,
        pages: &mut Pages,
    ) {
        let off = dc_link.is_none();
        self.history.corrected += u32::from(take_corrected());
        if self.ripple.follow(now_ms, dc_link.map(|at| f32::from_bits(memory::word(at)))) {
            self.history.ripples += 1;
            defmt::warn!("{}", RIPPLE);
        }
        self.history.pass(now_ms.wrapping_sub(self.counted_ms), !off);
        self.counted_ms = now_ms;
        if self.history.is_due(off) {
            self.write(guard, pages, History::write);
        }
    }

    /// Notes a new state of the drive: starts and faults.
    pub fn entered(&mut self, state: State, guard: &mut Guard, pages: &mut Pages) {
        let off = state.is_off();
        if self.was_off && !off {
            self.history.started();
        }
        self.was_off = off;
        if let Some(fault) = state.fault() {
            self.write(guard, pages, |history, pages| history.fault(pages, fault.code()));
        }
    }

    /// Notes that the protective setting with this number was changed.
    pub fn changed(&mut self, setting: u16, guard: &mut Guard, pages: &mut Pages) {
        self.write(guard, pages, |history, pages| history.changed(pages, setting));
    }

    fn write(
        &mut self,
        guard: &mut Guard,
        pages: &mut Pages,
        write: impl FnOnce(&mut History, &mut Pages) -> Result<(), FlashError>,
    ) {
        if !self.dual_bank {
            return;
        }
        let history = &mut self.history;
        let guard = if history.is_full() { guard } else { &mut None };
        if let Err(why) = extended(guard, || write(history, pages)) {
            defmt::warn!("the history is not written: {}", Display2Format(&why));
        }
    }
}
