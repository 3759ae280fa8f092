//! Shared by the fuzz targets.

use std::sync::LazyLock;

use crc::{CRC_32_ISO_HDLC, Crc};
use drive_core::Drive;
use induction_drive::settings::FirmwareSettings;

#[path = "../../src/console/tests/doubles.rs"]
pub mod doubles;

/// The settings of a confirmed board, and a drive with them. (The design takes longer than everything else.)
pub static START: LazyLock<(FirmwareSettings, Drive)> = LazyLock::new(|| {
    let mut settings = FirmwareSettings::of_the_board();
    settings.confirm_board();
    (settings, Drive::new(settings.build().expect("the defaults")))
});

/// The check sum of records, learned values and images.
pub fn sum(bytes: &[u8]) -> u32 {
    Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}

/// One input in a hundred, by its bytes: a drive is designed for it, which takes longer than everything else.
pub fn is_designed(bytes: &[u8]) -> bool {
    let hash = |sum: u32, byte: &u8| sum.wrapping_mul(31).wrapping_add(u32::from(*byte));
    bytes.iter().fold(7, hash).is_multiple_of(100)
}
