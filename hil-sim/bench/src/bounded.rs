//! Reading of the user's files up to a largest size: a device file would never end.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest configuration, motor, passport, scenario or recorded console, MiB.
pub const TEXT_MIB: u64 = 16;
/// Largest table of numbers, MiB: three minutes of seven columns at 6000 rows a second.
pub const TABLE_MIB: u64 = 64;
/// Largest file of `--resume`, MiB.
pub const RUNS_MIB: u64 = 256;

/// Reads to the end, or fails after this many MiB.
///
/// # Errors
/// The errors of the reader, and an error that names the largest size.
pub fn read(from: impl Read, most_mib: u64) -> io::Result<Vec<u8>> {
    let (mut bytes, most) = (Vec::new(), most_mib << 20);
    from.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 <= most {
        return Ok(bytes);
    }
    Err(io::Error::other(format!(
        "longer than {most_mib} MiB; allowed: up to {most_mib} MiB. Is it the right file?"
    )))
}

/// Returns the bytes of a file.
///
/// # Errors
/// As [`read`].
pub fn bytes(path: &Path, most_mib: u64) -> io::Result<Vec<u8>> {
    read(File::open(path)?, most_mib)
}

/// Returns the text of a file of at most [`TEXT_MIB`].
///
/// # Errors
/// As [`read`]; also if the text is not UTF-8.
pub fn text(path: &Path) -> io::Result<String> {
    String::from_utf8(bytes(path, TEXT_MIB)?).map_err(io::Error::other)
}
