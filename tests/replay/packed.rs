//! Samples as differences between consecutive samples, column by column, deflated.

use std::io::{Read as _, Write as _};

use drive_core::{Hardware, Sample};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

/// Columns of a sample.
const COLUMNS: usize = 7;

fn columns(s: &Sample) -> [u32; COLUMNS] {
    let codes = [s.current_a, s.current_b, s.current_c, s.dc_link, s.heat_sink].map(u32::from);
    let [a, b, c, dc_link, heat_sink] = codes;
    [a, b, c, dc_link, heat_sink, s.encoder, s.hardware.bits().into()]
}

fn sample([a, b, c, dc_link, heat_sink, encoder, hardware]: [u32; COLUMNS]) -> Sample {
    let [current_a, current_b, current_c, dc_link, heat_sink] =
        [a, b, c, dc_link, heat_sink].map(|code| code as u16);
    let hardware = Hardware::from_bits_truncate(hardware as u8);
    Sample { current_a, current_b, current_c, dc_link, heat_sink, encoder, hardware }
}

/// The samples as bytes: each column's differences, their low bytes before their higher ones.
pub fn pack(samples: &[Sample]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    for column in 0..COLUMNS {
        let mut before = 0_u32;
        let differences: Vec<_> = samples
            .iter()
            .map(|sample| {
                let now = columns(sample)[column];
                now.wrapping_sub(std::mem::replace(&mut before, now)).to_le_bytes()
            })
            .collect();
        for byte in 0..4 {
            let plane: Vec<_> = differences.iter().map(|bytes| bytes[byte]).collect();
            encoder.write_all(&plane).unwrap();
        }
    }
    encoder.finish().unwrap()
}

/// The samples in `bytes`.
pub fn unpack(bytes: &[u8]) -> Vec<Sample> {
    let mut planes = Vec::new();
    DeflateDecoder::new(bytes).read_to_end(&mut planes).unwrap();
    let count = planes.len() / (4 * COLUMNS);
    let mut now = [0_u32; COLUMNS];
    let next = |n: usize| {
        for (column, value) in now.iter_mut().enumerate() {
            let bytes = [0, 1, 2, 3].map(|byte| planes[(4 * column + byte) * count + n]);
            *value = value.wrapping_add(u32::from_le_bytes(bytes));
        }
        sample(now)
    };
    (0..count).map(next).collect()
}
