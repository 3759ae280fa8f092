//! The log: defmt frames from the up-buffer of RTT in RAM.

use anyhow::{Context, Result, anyhow};
use defmt_decoder::{DecodeError, Table};

use crate::{image::Image, power_stage::watch::GateWatch};
use stm32g4_unicorn::Cpu;
use stm32g4_unicorn::memory::{self, Region};

/// Offset of up-buffer 0 in the control block: after its ID and two counts.
const BUFFER: u32 = 0x18;

/// Reads and decodes the log.
pub struct Log {
    table: Table,
    control_block: u32,
    bytes: Vec<u8>,
}

impl Log {
    /// Returns the log of an image, if it has one.
    ///
    /// # Errors
    /// The log cannot be decoded.
    pub fn find(image: &Image) -> Result<Option<Self>> {
        let Ok(Region { address: control_block, .. }) = image.symbol("_SEGGER_RTT") else {
            return Ok(None);
        };
        let table = Table::parse(&image.bytes).map_err(|e| anyhow!("{e}"))?;
        let table = table.context("the image has no defmt log")?;
        Ok(Some(Self { table, control_block, bytes: Vec::new() }))
    }

    /// Discards the beginning of a frame.
    pub fn forget(&mut self) {
        self.bytes.clear();
    }

    /// Returns the firmware's log since the last call.
    ///
    /// # Errors
    /// The log cannot be decoded.
    pub fn take(&mut self, cpu: &mut Cpu<GateWatch>) -> Result<Vec<String>> {
        let at = self.control_block + BUFFER;
        let words = [1, 2, 3, 4].map(|n| cpu.word(at + 4 * n));
        let [Some(buffer), Some(size), Some(written), Some(mut next)] = words else {
            return Ok(Vec::new());
        };
        if size == 0 || size > memory::RAM_SIZE || next >= size || written >= size {
            return Ok(Vec::new()); // not set up yet, or damaged
        }
        while next != written {
            let end = if written > next { written } else { size };
            let mut part = vec![0; (end - next) as usize];
            if !cpu.read(buffer + next, &mut part) {
                break;
            }
            self.bytes.extend(part);
            next = end % size;
        }
        cpu.write(at + 16, &next.to_le_bytes());
        self.decode()
    }

    fn decode(&mut self) -> Result<Vec<String>> {
        let mut lines = Vec::new();
        // A frame ends with a zero; the rest is the beginning of a frame that is still being written.
        let whole = self.bytes.iter().rposition(|byte| *byte == 0).map_or(0, |end| end + 1);
        let mut decoder = self.table.new_stream_decoder();
        decoder.received(&self.bytes[..whole]);
        self.bytes.drain(..whole);
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(frame.display(false).to_string()),
                Err(DecodeError::UnexpectedEof) => return Ok(lines),
                Err(DecodeError::Malformed) => lines.push("(malformed)".into()),
            }
        }
    }
}
