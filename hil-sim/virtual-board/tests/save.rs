//! The contents of the flash after losses of power.

use crate::common;
use anyhow::Result;
use induction_drive::settings::keys;
use virtual_board::{Image, campaign};

/// Power fails in every operation of the flash of a `save`, an erasure and the double words of the record, to each of
/// the two slots: the old or the new set is valid, and the firmware starts.
#[test]
fn no_operation_of_a_save_loses_both_sets() -> Result<()> {
    let operations = campaign::every_operation_of_save(Image::built()?)?;
    // A save erases the slot, writes two double words as its head, and one for each setting; nothing was learned. The
    // first save of a minute also writes one entry to the history, because a setting of a protection was changed.
    let save = 3 + keys::COUNT as u64;
    assert_eq!(operations, [save + 1, save]);
    println!("{operations:?} operations");
    Ok(())
}

/// A start and a fault are in the history at once. After power-up the fault is there, and the next one before it; a
/// start after the last write is counted again.
#[test]
fn the_history_survives_power_off() -> Result<()> {
    let mut pair = common::regulating(8)?;
    pair.board.set_fault_pin(false);
    pair.run(1200, |_, _| {})?;
    let totals = pair.ask("history")?.lines;
    assert_eq!(totals[0], "powered 0.0 h, with current 0.0 h, starts 1");
    pair.board.set_fault_pin(true);
    let list = |board: &mut virtual_board::Board| -> Result<Vec<String>> {
        common::until_said(board, "last run: ")?;
        // A second in which nothing is written.
        board.run_periods(6000)?;
        Ok(common::ask(board, "history")?.lines)
    };
    let fault = "at 0.0 h, with current 0.0 h: fault 20, the power stage pulled the break input";
    pair.board.unplug();
    let after = list(&mut pair.board)?;
    assert_eq!(after.len(), 3, "{after:#?}");
    assert!(after[0].ends_with("starts 1") && after[1] == fault && after[2] == "ok", "{after:#?}");
    // The first page was begun: an erasure, two totals, the fault, its head.
    assert_eq!(pair.board.chip().flash.operations, 5);
    // Repeated resets write nothing.
    for _ in 0..2 {
        pair.board.reset(virtual_board::periph::Reset::Pin);
        assert_eq!(list(&mut pair.board)?, after);
    }
    assert_eq!(pair.board.chip().flash.operations, 5);
    Ok(())
}
