//! The contents of the flash after losses of power.

use anyhow::Result;
use induction_drive::settings::keys;
use virtual_board::Image;

use crate::campaign;

/// Power fails in every operation of the flash of a `save`, an erasure and the double words of the record, to each of
/// the two slots: the old or the new set is valid, and the firmware starts.
#[test]
fn no_operation_of_a_save_loses_both_sets() -> Result<()> {
    let operations = campaign::every_operation_of_save(Image::built()?)?;
    // A save erases the slot, writes two double words as its head, and one for each setting; nothing was learned. The
    // first save of a minute also writes one entry to the history, because a setting of a protection was changed.
    let save = 3 + keys::COUNT as u64;
    assert_eq!(operations, [save + 1, save]);
    Ok(())
}
