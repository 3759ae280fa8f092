//! The memory map of the STM32G474RE (RM0440, section 2.2), as far as it is modelled.

/// A piece of memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// First address.
    pub address: u32,
    /// Size, bytes.
    pub size: u32,
}

impl Region {
    /// Returns the first address after it.
    pub fn end(self) -> u32 {
        self.address + self.size
    }
}

/// The kind of memory at an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backing {
    /// Read and executed; written only by its controller.
    Flash,
    /// Read, written and executed.
    Ram,
    /// Reads and writes go to the models of the peripherals.
    Registers,
}

/// First address of the flash.
pub const FLASH: u32 = 0x0800_0000;
/// Flash in both banks, bytes.
pub const FLASH_SIZE: u32 = 512 * 1024;
/// First address after the flash.
pub const FLASH_END: u32 = FLASH + FLASH_SIZE;
/// The second bank.
pub const BANK_2: u32 = FLASH + FLASH_SIZE / 2;
/// The last quarter of the second bank, the only part that a program may write. Its accesses go through the model of the flash, so
/// that half-written words can be distinguished from data. It contains no code.
pub const STORED: u32 = FLASH + FLASH_SIZE / 8 * 7;
/// First address of SRAM1 and SRAM2.
pub const RAM: u32 = 0x2000_0000;
/// SRAM1 and SRAM2, bytes.
pub const RAM_SIZE: u32 = 96 * 1024;
/// CCM SRAM.
pub const CCM: u32 = 0x1000_0000;
/// The other address of CCM SRAM.
pub const CCM_ALIAS: u32 = RAM + RAM_SIZE;
/// CCM SRAM, bytes.
pub const CCM_SIZE: u32 = 32 * 1024;
/// The memories that a loss of power clears: first address, bytes.
pub const VOLATILE: [(u32, u32); 2] = [(RAM, RAM_SIZE), (CCM, CCM_SIZE)];
/// The smallest piece of memory that the emulator maps, bytes.
pub const GUARD_PAGE: u32 = 4096;
/// Address at which single bits of peripheral registers appear as words.
pub const BIT_BAND: u32 = 0x4200_0000;
/// Address of the peripheral registers that have such an alias.
pub const PERIPHERALS: u32 = 0x4000_0000;

/// The system memory, with ST's boot loader.
pub const SYSTEM: u32 = 0x1fff_0000;

/// All regions except the alias of CCM: first address, bytes, kind.
pub const MAP: [(u32, u32, Backing); 11] = [
    (SYSTEM, 0x7000, Backing::Flash),
    (FLASH, STORED - FLASH, Backing::Flash),
    (STORED, FLASH_END - STORED, Backing::Registers),
    (0x1fff_7000, 0x1000, Backing::Registers),
    (RAM, RAM_SIZE, Backing::Ram),
    (CCM, CCM_SIZE, Backing::Ram),
    (PERIPHERALS, 0x3_0000, Backing::Registers),
    (BIT_BAND, 0x60_0000, Backing::Registers),
    (0x4800_0000, 0x2000, Backing::Registers),
    (0x5000_0000, 0x6_1000, Backing::Registers),
    (0xe000_0000, 0x10_0000, Backing::Registers),
];

/// Whether the chip has nothing at an address, so that an access is a fault of the processor. (Registers that exist but
/// are not modelled do not count.)
pub fn is_reserved(address: u32) -> bool {
    let inside = |base: u32, size: u32| (base..base + size).contains(&address);
    let memories = MAP.iter().any(|(base, size, _)| inside(*base, *size));
    // System memory and one-time programmable bytes, option bytes of both banks.
    let system = inside(0x1fff_0000, 0x8000) || inside(0x1fff_f800, 0x100);
    // Peripherals with their alias, external memories, the core's own registers.
    let registers = inside(0x4000_0000, 0x2000_0000) || inside(0x6000_0000, 0x4000_0000);
    !(memories || inside(CCM_ALIAS, CCM_SIZE) || system || registers || address >= 0xe000_0000)
}
