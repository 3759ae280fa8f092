//! Memory protection (ARMv7-M, B3.5): the registers, and regions in RAM that must not be accessed.

use crate::memory::{self, Region};

const TYPE: u32 = 0xe000_ed90;
const CTRL: u32 = 0xe000_ed94;
const RNR: u32 = 0xe000_ed98;
const RBAR: u32 = 0xe000_ed9c;
/// Number of regions.
const REGIONS: usize = 8;

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct Mpu {
    control: u32,
    number: usize,
    /// RBAR and RASR.
    regions: [(u32, u32); REGIONS],
}

impl Mpu {
    /// Reads a register.
    pub fn read(&self, address: u32) -> Option<u32> {
        let (base, attributes) = self.regions[self.number];
        Some(match address {
            TYPE => (REGIONS as u32) << 8,
            CTRL => self.control,
            RNR => self.number as u32,
            // RBAR and RASR have three aliases each.
            _ if (address - RBAR).is_multiple_of(8) => base | self.number as u32,
            _ => attributes,
        })
    }

    /// Writes a register.
    pub fn write(&mut self, address: u32, value: u32) -> Option<()> {
        match address {
            TYPE => {}
            CTRL => self.control = value & 7,
            RNR => self.number = (value as usize).min(REGIONS - 1),
            _ if (address - RBAR).is_multiple_of(8) => {
                // VALID: the write contains the number of the region.
                if value & 1 << 4 != 0 {
                    self.number = (value as usize & 15).min(REGIONS - 1);
                }
                self.regions[self.number].0 = value & !0x1f;
            }
            _ => self.regions[self.number].1 = value & 0x1707_ff3f,
        }
        Some(())
    }

    /// Whether the protection applies in hard faults and NMI as well.
    pub fn holds_in_faults(&self) -> bool {
        self.control & 2 != 0
    }

    /// Returns the region in RAM that must not be accessed (AP 0), if there is one. Other regions are not enforced.
    pub fn guard(&self) -> Option<Region> {
        if self.control & 1 == 0 {
            return None;
        }
        self.regions.iter().find_map(|(base, attributes)| {
            let on = attributes & 1 != 0 && attributes >> 24 & 7 == 0;
            let size = 2_u32.checked_shl(attributes >> 1 & 31).unwrap_or(0);
            let in_ram = (memory::RAM..memory::CCM_ALIAS).contains(base);
            (on && in_ram && size <= memory::GUARD_PAGE).then_some(Region { address: *base, size })
        })
    }
}
