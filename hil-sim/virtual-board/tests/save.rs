//! The power goes while the settings are saved.

use anyhow::Result;
use induction_drive::settings::keys;
use virtual_board::{Image, campaign};

/// In every operation of the flash that a `save` takes, an erasure and the double words of the record, to each
/// of the two slots: the old or the new set counts, and the firmware starts.
#[test]
fn no_operation_of_a_save_loses_both_sets() -> Result<()> {
    let operations = campaign::every_operation_of_save(Image::built()?)?;
    // An erasure, the two words of the head, and one a key: nothing was learned.
    assert_eq!(operations, [3 + keys::COUNT as u64; 2]);
    println!("{operations:?} operations");
    Ok(())
}
