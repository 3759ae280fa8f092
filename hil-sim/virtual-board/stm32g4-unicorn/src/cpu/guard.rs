//! The guard of the memory protection: accesses to the page of RAM that contains it go through the model, which turns
//! accesses to the guard into faults.

use std::cell::RefCell;
use std::rc::Rc;

use unicorn_engine::Unicorn;
use unicorn_engine::unicorn_const::{Permission, uc_error};

use super::{Chip, Circuit, Cpu};
use crate::memory::{GUARD_PAGE, Region};

/// The page whose accesses go through the model.
pub(super) struct Guard {
    page: u32,
    bytes: Rc<RefCell<Vec<u8>>>,
}

/// Whether the core may access an address; if not, the core stops there.
fn allowed<C: Circuit>(uc: &mut Unicorn<Chip<C>>, address: u32) -> bool {
    let chip = uc.get_data_mut();
    if !(chip.core_runs && chip.scs.denies(address)) {
        return true;
    }
    chip.guard_hit.get_or_insert(address);
    uc.emu_stop().ok();
    false
}

impl<C: Circuit> Cpu<C> {
    /// Follows the registers of the memory protection.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn follow_guard(&mut self) -> Result<(), uc_error> {
        let wanted =
            self.chip().scs.mpu.guard().map(|Region { address, .. }| address & !(GUARD_PAGE - 1));
        if wanted == self.guard.as_ref().map(|guard| guard.page) {
            return Ok(());
        }
        let size = GUARD_PAGE as usize;
        if let Some(Guard { page, bytes }) = self.guard.take() {
            self.uc.mem_unmap(u64::from(page), size)?;
            self.uc.mem_map(u64::from(page), size, Permission::ALL)?;
            self.uc.mem_write(u64::from(page), &bytes.borrow())?;
        }
        let Some(page) = wanted else { return Ok(()) };
        let bytes = Rc::new(RefCell::new(self.uc.mem_read_as_vec(u64::from(page), size)?));
        let (read, written) = (Rc::clone(&bytes), Rc::clone(&bytes));
        self.uc.mem_unmap(u64::from(page), size)?;
        self.uc.mmio_map(
            u64::from(page),
            size,
            Some(move |uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize| {
                let mut value = [0; 8];
                if allowed(uc, page + offset as u32) {
                    let at = offset as usize;
                    value[..size].copy_from_slice(&read.borrow()[at..at + size]);
                }
                u64::from_le_bytes(value)
            }),
            Some(move |uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize, value: u64| {
                if allowed(uc, page + offset as u32) {
                    let at = offset as usize;
                    written.borrow_mut()[at..at + size]
                        .copy_from_slice(&value.to_le_bytes()[..size]);
                }
            }),
        )?;
        self.guard = Some(Guard { page, bytes });
        Ok(())
    }

    /// Whether the guard denies any of these bytes.
    pub(super) fn denies(&self, address: u32, size: u32) -> bool {
        let scs = &self.chip().scs;
        (address..address.saturating_add(size)).step_by(4).any(|address| scs.denies(address))
    }
}
