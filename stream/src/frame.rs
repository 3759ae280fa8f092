//! One frame.

use crc::{CRC_16_IBM_3740, Crc, NoTable};
use heapless::Vec;
use thiserror::Error;

/// Most signals in a frame.
pub const MOST_SIGNALS: usize = 8;
/// Bytes before the values: sequence number and control period.
const HEAD: usize = 2 + 4;
/// Bytes of the checksum.
const CHECK: usize = 2;
/// Bytes that COBS adds to contents of less than 255 bytes, and the two delimiters.
const AROUND: usize = 1 + 2;
/// Bytes of the longest frame on the wire.
pub const LONGEST: usize = wire_bytes(MOST_SIGNALS);

/// Computed without a table, which would take half a kilobyte of the firmware.
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_3740);

/// Bytes on the wire of a frame with this number of signals.
pub const fn wire_bytes(signals: usize) -> usize {
    HEAD + 4 * signals + CHECK + AROUND
}

/// Values of signals at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Sequence number: one more for each sample that was due; wraps.
    pub sequence: u16,
    /// Control periods since the start of the firmware; wraps.
    pub period: u32,
    /// The values, one to [`MOST_SIGNALS`].
    pub values: Vec<f32, MOST_SIGNALS>,
}

/// Reason why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Damage {
    /// The bytes are not a COBS block.
    #[error("not a COBS block")]
    Cobs,
    /// The length is not that of a frame.
    #[error("{0} bytes: no frame has this length")]
    Length(usize),
    /// The checksum differs.
    #[error("checksum {found:04x} where the contents have {computed:04x}")]
    Check {
        /// As received.
        found: u16,
        /// Computed over the contents received.
        computed: u16,
    },
}

impl Frame {
    /// Writes the frame with its delimiters; the number of bytes is [`wire_bytes`] of its values.
    pub fn write(&self, to: &mut [u8; LONGEST]) -> usize {
        let mut contents = [0; HEAD + 4 * MOST_SIGNALS + CHECK];
        let mut length = 0;
        let mut put = |bytes: &[u8]| {
            if let Some(place) = contents.get_mut(length..length + bytes.len()) {
                place.copy_from_slice(bytes);
                length += bytes.len();
            }
        };
        put(&self.sequence.to_le_bytes());
        put(&self.period.to_le_bytes());
        self.values.iter().for_each(|value| put(&value.to_le_bytes()));
        let check = CRC.checksum(contents.get(..length).unwrap_or_default());
        if let Some(place) = contents.get_mut(length..length + CHECK) {
            place.copy_from_slice(&check.to_le_bytes());
            length += CHECK;
        }
        *to = [0; LONGEST];
        // There is space: the contents are shorter than a block of COBS.
        let source = contents.get(..length).unwrap_or_default();
        let block = to.get_mut(1..).map_or(0, |to| cobs::try_encode(source, to).unwrap_or(0));
        (block + 2).min(LONGEST)
    }

    /// The frame of the bytes between two delimiters.
    ///
    /// # Errors
    /// The bytes are no whole frame.
    pub fn read(block: &[u8]) -> Result<Self, Damage> {
        let mut contents = [0; LONGEST];
        if block.len() > LONGEST - 2 {
            return Err(Damage::Length(block.len()));
        }
        let report = cobs::decode(block, &mut contents).map_err(|_| Damage::Cobs)?;
        let contents = contents.get(..report.frame_size()).unwrap_or_default();
        let length = contents.len();
        let values = length.checked_sub(HEAD + CHECK).filter(|rest| *rest > 0 && rest % 4 == 0);
        let (Some(_), Some((rest, check))) = (values, contents.split_last_chunk()) else {
            return Err(Damage::Length(length));
        };
        let (found, computed) = (u16::from_le_bytes(*check), CRC.checksum(rest));
        if found != computed {
            return Err(Damage::Check { found, computed });
        }
        let (Some((sequence, rest)), length) = (rest.split_first_chunk(), Damage::Length(length))
        else {
            return Err(Damage::Length(length));
        };
        let (period, rest) = rest.split_first_chunk().ok_or(length)?;
        let (values, _) = rest.as_chunks();
        Ok(Self {
            sequence: u16::from_le_bytes(*sequence),
            period: u32::from_le_bytes(*period),
            values: values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
        })
    }
}
