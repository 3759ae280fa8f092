//! The flash pages of settings and history: the last of the second bank.

/// Size of the flash, bytes.
const FLASH_BYTES: u32 = 512 * 1024;
const FLASH_ADDRESS: u32 = 0x0800_0000;
/// Size of a page with two banks, and with one, bytes (RM0440, flash module organization).
const PAGE_BYTES: (u32, u32) = (2048, 4096);
/// Space for one set of settings, bytes: a page of the smaller kind.
pub const SETTINGS_SLOT_BYTES: u32 = PAGE_BYTES.0;
/// Slots that the firmware writes: two sets of settings, and two pages of the history before them.
pub const STORED_SLOTS: usize = 4;
// In the second bank: the code in the first bank runs on while the second bank is written.
const _: () = assert!(settings_offset(2) >= FLASH_BYTES / 2);

/// Offset of a slot from the beginning of the flash: the last pages of the larger kind, so that they stay in place when
/// the option bit DBANK changes.
const fn settings_offset(slot: usize) -> u32 {
    // The two sets of settings have kept the places that earlier firmware gave them.
    let from_end = [2, 1, 4, 3][slot % STORED_SLOTS];
    FLASH_BYTES - from_end * PAGE_BYTES.1
}

/// Address of a double word of a slot; always inside it.
pub const fn settings_address(slot: usize, word: usize) -> u32 {
    let words = SETTINGS_SLOT_BYTES / 8;
    FLASH_ADDRESS + settings_offset(slot) + 8 * (word as u32 % words)
}

/// The fields BKER (second bank) and PNB (page in the bank) of FLASH_CR for a slot.
pub const fn settings_page(slot: usize, dual_bank: bool) -> (bool, u8) {
    if dual_bank {
        (true, ((settings_offset(slot) - FLASH_BYTES / 2) / PAGE_BYTES.0) as u8)
    } else {
        (false, (settings_offset(slot) / PAGE_BYTES.1) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An erasure of any other page would destroy the firmware.
    #[test]
    fn the_stored_pages_are_the_last_with_one_bank_and_with_two() {
        let pages = |dual| [0, 1, 2, 3].map(|slot| settings_page(slot, dual));
        assert_eq!(pages(true), [(true, 124), (true, 126), (true, 120), (true, 122)]);
        assert_eq!(pages(false), [(false, 126), (false, 127), (false, 124), (false, 125)]);
        let ends = [(0, 0), (0, 255), (1, 0), (1, 255)].map(|(s, w)| settings_address(s, w));
        assert_eq!(ends, [0x0807_e000, 0x0807_e7f8, 0x0807_f000, 0x0807_f7f8]);
    }
}
