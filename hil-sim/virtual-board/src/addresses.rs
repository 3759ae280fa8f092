//! The addresses that the firmware publishes in one table. The symbol of that table is everything that the virtual
//! board knows of the firmware's data. `src/task/control/addresses.rs` writes the table and documents it.

use anyhow::{Context, Result, ensure};

use crate::image::Image;
use stm32g4_unicorn::memory::Region;

/// Name of the table.
const SYMBOL: &str = "INDUCTION_DRIVE_ADDRESSES";
/// Version of the layout that this crate reads.
const VERSION: u32 = 4;

/// The table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Addresses {
    /// All data of the control interrupt.
    pub control: Region,
    /// The drive's coefficients.
    pub coefficients: Region,
    /// The part of the drive's state that changes while it regulates.
    pub state: Region,
    /// A pointer to the mailbox of requests.
    pub orders: u32,
    /// Offset in the mailbox of a byte that is not 0 while a request waits.
    pub order_waits: u32,
    /// The telemetry of the drive.
    pub telemetry: u32,
    /// The word with its phase.
    pub phase: u32,
}

impl Addresses {
    /// Returns the table of an image, if it has one.
    ///
    /// # Errors
    /// The table is of another version.
    pub fn find(image: &Image) -> Result<Option<Self>> {
        if image.symbol(SYMBOL).is_err() {
            return Ok(None);
        }
        let words = image.contents(SYMBOL)?;
        let version = words.first();
        ensure!(version == Some(&VERSION), "{SYMBOL} has version {version:?}, not {VERSION}");
        let table: [u32; 11] = words.try_into().ok().context("a table of another size")?;
        let region = |at: usize| Region { address: table[at], size: table[at + 1] };
        Ok(Some(Self {
            control: region(1),
            coefficients: region(3),
            state: region(5),
            orders: table[7],
            order_waits: table[8],
            telemetry: table[9],
            phase: table[10],
        }))
    }
}
