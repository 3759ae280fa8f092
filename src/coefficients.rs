//! Coefficients that were designed on a computer, for an image without the design.
//!
//! `cargo sim coefficients` writes the file, a debug probe writes it into the flash at [`ADDRESS`], and the image reads it at its start:
//!
//! | bytes | contents |
//! |---|---|
//! | 0 to 7 | [`MARK`] |
//! | 8 to 11 | number of bytes of the body, little-endian |
//! | 12 to 15 | CRC-32 of the body, little-endian |
//! | from 16 on | the body: [`Designed`] in the format of postcard |
//!
//! The format of postcard has no names, so a body of another version reads as nonsense: the version comes first and must be the same.

use crc::{CRC_32_ISO_HDLC, Crc};
use drive_core::Coefficients;
use drive_core::flux::FilterLoop;
use drive_settings::{Carrier, value::Words as _};
use serde::{Deserialize, Serialize};

use crate::board::{self, Protection, Timer};
use crate::boards::Board;
use crate::settings::FirmwareSettings;

/// Address in the flash: the middle of the second bank, which the small image does not reach.
pub const ADDRESS: u32 = 0x0806_0000;
/// Most bytes of a file.
pub const LONGEST: usize = 8 * 1024;
/// First bytes of a file.
pub const MARK: [u8; 8] = *b"indcoef1";
/// Version of the values: that of the package.
const VERSION: &str = env!("CARGO_PKG_VERSION");
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// All that the image needs to run a motor.
#[derive(Deserialize, Serialize)]
pub struct Designed<'a> {
    version: &'a str,
    board: &'a str,
    /// Fields of [`Timer`].
    timer: (u8, f32, u8),
    /// Levels of the protection that works without the control step.
    pub protection: Protection,
    /// Speed reference of a start, rpm.
    pub rpm: f32,
    /// Pairs of poles, for the log.
    pub pole_pairs: u8,
    /// Coefficients of the drive.
    pub coefficients: Coefficients<FilterLoop>,
}

/// Reason why a file is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unusable {
    /// There is no file.
    Missing,
    /// The check sum is wrong.
    Damaged,
    /// Another version of the package designed them.
    Version,
    /// They are for another board.
    Board,
}

impl Unusable {
    /// The reason in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Missing => {
                "no coefficients: write those of `cargo sim coefficients` to the flash"
            }
            Self::Damaged => "the coefficients are damaged: write them to the flash again",
            Self::Version => "the coefficients are of another version: design them with this one",
            Self::Board => "the coefficients are for another board",
        }
    }
}

impl<'a> Designed<'a> {
    /// Designs the coefficients for these settings and this speed reference, rpm.
    ///
    /// # Errors
    /// A value out of range, or a design rule that cannot be met.
    pub fn new(
        settings: &FirmwareSettings,
        rpm: f32,
    ) -> Result<Self, drive_settings::SettingsError> {
        settings.check()?;
        let timer = Timer::of(&settings.drive.inverter);
        let mut drive = settings.drive;
        drive.inverter.dead_time_s = timer.dead_time_s;
        let mut coefficients = drive.build_for_loop()?;
        if let Some(learned) = &settings.learned {
            coefficients.take(learned);
        }
        // The image has no V/f control.
        coefficients.volts_per_hertz = None;
        Ok(Self {
            version: VERSION,
            board: settings.board.name,
            timer: (timer.dead_time_code, timer.dead_time_s, timer.switching_khz.place() as u8),
            protection: board::protection(settings.board, &drive),
            rpm,
            pole_pairs: drive.motor.pole_pairs,
            coefficients,
        })
    }

    /// Values of the timer of the power stage.
    pub fn timer(&self) -> Timer {
        let (dead_time_code, dead_time_s, carrier) = self.timer;
        Timer { dead_time_code, dead_time_s, switching_khz: Carrier::at(carrier.into()) }
    }

    /// Returns the contents of a file; `None` if they do not fit.
    pub fn write<'b>(&self, file: &'b mut [u8; LONGEST]) -> Option<&'b [u8]> {
        let (head, body) = file.split_at_mut(16);
        let length = postcard::to_slice(self, body).ok()?.len();
        head[..8].copy_from_slice(&MARK);
        head[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        head[12..].copy_from_slice(&CRC.checksum(&body[..length]).to_le_bytes());
        Some(&file[..16 + length])
    }

    /// Reads a file for this board.
    ///
    /// # Errors
    /// See [`Unusable`].
    pub fn read(file: &'a [u8], board: &Board) -> Result<Self, Unusable> {
        let (mark, rest) = file.split_first_chunk().ok_or(Unusable::Missing)?;
        if *mark != MARK {
            return Err(Unusable::Missing);
        }
        let (length, rest) = rest.split_first_chunk().ok_or(Unusable::Damaged)?;
        let (check, rest) = rest.split_first_chunk().ok_or(Unusable::Damaged)?;
        let body = rest.get(..u32::from_le_bytes(*length) as usize).ok_or(Unusable::Damaged)?;
        if CRC.checksum(body) != u32::from_le_bytes(*check) {
            return Err(Unusable::Damaged);
        }
        // Read first, because the rest of another version may be anything.
        let (version, _) =
            postcard::take_from_bytes::<&str>(body).map_err(|_| Unusable::Damaged)?;
        if version != VERSION {
            return Err(Unusable::Version);
        }
        let read: Self = postcard::from_bytes(body).map_err(|_| Unusable::Damaged)?;
        if read.board == board.name { Ok(read) } else { Err(Unusable::Board) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boards;

    /// A file gives the coefficients that were written, to the bit, and only to its board and version.
    #[test]
    fn a_file_is_read_by_its_board_and_version_only() {
        let mut settings = FirmwareSettings::of_the_board();
        settings.drive.injection.synchronous.allow_unlearned = true;
        let designed = Designed::new(&settings, 600.0).unwrap();
        let mut place = [0; LONGEST];
        let file = designed.write(&mut place).unwrap().to_vec();
        let read = Designed::read(&file, boards::SELECTED).unwrap();
        assert_eq!(read.coefficients, designed.coefficients);
        assert_eq!((read.timer(), read.rpm), (designed.timer(), 600.0));
        let refused = |file: &[u8], board| Designed::read(file, board).err();
        let other = boards::ALL.iter().find(|board| board.name != settings.board.name).unwrap();
        assert_eq!(refused(&file, other), Some(Unusable::Board));
        assert_eq!(refused(&[0xff; 64], boards::SELECTED), Some(Unusable::Missing));
        for at in 8..file.len() {
            let mut flipped = file.clone();
            flipped[at] ^= 4;
            assert_eq!(refused(&flipped, boards::SELECTED), Some(Unusable::Damaged), "byte {at}");
        }
        let older = Designed { version: "0.1.9", ..designed };
        let file = older.write(&mut place).unwrap();
        assert_eq!(refused(file, boards::SELECTED), Some(Unusable::Version));
    }
}
