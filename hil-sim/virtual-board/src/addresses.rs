//! The addresses that the firmware publishes in one table: its symbol is all that the virtual board knows of the
//! firmware's data. `src/task/control/addresses.rs` writes the table and documents it.

use anyhow::{Context, Result, bail};

use crate::image::Image;
use crate::memory::Region;

/// Name of the table.
const SYMBOL: &str = "INDUCTION_DRIVE_ADDRESSES";
/// Version of its layout that this crate reads.
const VERSION: u32 = 2;

/// The table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Addresses {
    /// All data of the control interrupt.
    pub control: Region,
    /// The drive's coefficients.
    pub coefficients: Region,
    /// The state of the drive that changes while it regulates.
    pub state: Region,
    /// A pointer to the mailbox of orders.
    pub orders: u32,
    /// Offset in it of a byte that is 1 while an order waits.
    pub order_waits: u32,
    /// Estimated flux angle, a fraction of an electrical turn.
    pub phi: u32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: u32,
    /// Filtered reference on the quadrature axis, A.
    pub reference_q: u32,
    /// Current on the quadrature axis, A.
    pub current_q: u32,
    /// Dc-link voltage, V.
    pub dc_link: u32,
}

impl Addresses {
    /// The table of an image that has one.
    ///
    /// # Errors
    /// It is of another version.
    pub fn find(image: &Image) -> Result<Option<Self>> {
        if image.symbol(SYMBOL).is_err() {
            return Ok(None);
        }
        let words = image.contents(SYMBOL)?;
        if words.first() != Some(&VERSION) {
            bail!("{SYMBOL} has version {:?}, not {VERSION}", words.first());
        }
        let table: [u32; 14] = words.try_into().ok().context("a table of another size")?;
        let region = |at: usize| Region { address: table[at], size: table[at + 1] };
        Ok(Some(Self {
            control: region(1),
            coefficients: region(3),
            state: region(5),
            orders: table[7],
            order_waits: table[8],
            phi: table[9],
            rotor_freq: table[10],
            reference_q: table[11],
            current_q: table[12],
            dc_link: table[13],
        }))
    }
}
