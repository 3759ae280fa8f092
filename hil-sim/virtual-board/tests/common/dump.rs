//! The registers of a board that has started and is off, for the comparison with a real one (`cargo xtask bench-dump`).

use anyhow::{Context, Result};

use virtual_board::{Board, Image, Options, PowerStage};

/// Time after which every start is over, control periods.
const STARTED: u64 = 30_000;

/// Returns the registers of a board some seconds after power-up, one per line: name, address, value, and the bits to
/// compare, all in hexadecimal.
///
/// # Errors
/// A failure of the board.
pub fn lines(image: Image, stage: &'static PowerStage) -> Result<Vec<String>> {
    let mut options = Options::on(stage, &stage.config()?, 1);
    // As on a board that nobody has confirmed: its gates are not connected.
    options.confirmed = false;
    let mut board = Board::new(image, options)?;
    board.run_periods(STARTED)?;
    let chip = board.chip();
    let line = |(name, address, mask): (String, u32, u32)| {
        let value = chip.read(address, 4) & mask;
        format!("{name} {address:08x} {value:08x} {mask:08x}")
    };
    Ok(registers()?.into_iter().map(line).collect())
}

/// Returns name, address and bits to compare of each register.
///
/// # Errors
/// An invalid row of the table.
pub fn registers() -> Result<Vec<(String, u32, u32)>> {
    let mut all = Vec::new();
    let rows = include_str!("dump.txt").lines().filter(|row| !row.starts_with('#'));
    for row in rows {
        let (place, registers) = row.split_once(": ").context(row)?;
        let (peripheral, base) = place.split_once(' ').context(row)?;
        let base = u32::from_str_radix(base, 16)?;
        for register in registers.split(", ") {
            let mut words = register.split(' ');
            let (name, offset) = words.next().zip(words.next()).context(register)?;
            let address = base + u32::from_str_radix(offset, 16)?;
            let mask = words.next().map_or(Ok(u32::MAX), |mask| u32::from_str_radix(mask, 16))?;
            all.push((format!("{peripheral}_{name}"), address, mask));
        }
    }
    Ok(all)
}
