//! The flash of a board whose bench steps were done: its saved settings, with the confirmation.

use anyhow::{Context, Result};
use induction_drive::{board::settings_address, boards, settings::FirmwareSettings, store::codec};

use super::Options;
use stm32g4_unicorn::{memory::STORED, periph::flash::Flash};

/// Returns the settings of a board, with the confirmation.
///
/// # Errors
/// The firmware has no such board.
pub fn settings(options: &Options) -> Result<FirmwareSettings> {
    let name = options.power_stage.name;
    let board = boards::find(name).with_context(|| format!("the firmware has no board {name}"))?;
    let mut settings = FirmwareSettings { drive: options.saved, ..FirmwareSettings::of(board) };
    settings.confirm_board();
    Ok(settings)
}

/// Saves these settings in the flash.
///
/// # Errors
/// As [`settings`].
pub fn save(options: &Options, flash: &mut Flash) -> Result<()> {
    let record = codec::record(&settings(options)?, 0);
    let (contents, torn) = flash.contents();
    let (mut contents, torn) = (contents.to_vec(), torn.to_vec());
    for (word, value) in record.iter().take(codec::length(&record)).enumerate() {
        let at = (settings_address(0, word) - STORED) as usize;
        contents[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
    flash.replace_contents(&contents, &torn);
    Ok(())
}
