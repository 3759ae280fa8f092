//! The limits of the control interrupt.

use std::collections::BTreeMap;

use virtual_board::cycles::{Row, check};

#[test]
fn an_interrupt_above_a_budget_is_refused_by_its_figure() {
    let refused = |cycles, whole, from_flash: bool| {
        let (mut blocks, functions) = (BTreeMap::new(), BTreeMap::new());
        if from_flash {
            blocks.insert("flash", 100);
        }
        let (name, by_turn) = ("x", [0; 10]);
        let row =
            Row { name, instructions: 0, cycles, median: 0, whole, by_turn, blocks, functions };
        check(&[row], 2650, 3700).err().map(|why| why.to_string())
    };
    assert_eq!(refused(2650, 3700, false), None);
    assert!(
        refused(2650, 3701, false).is_some_and(|why| why.contains("3701 cycles, 3700 allowed"))
    );
    assert!(refused(2651, 3700, false).is_some_and(|w| w.contains("2651") && w.contains("2650")));
    // States that run from the flash may take as long as the window watchdog allows.
    let most = induction_drive::board::LONGEST_INTERRUPT_CYCLES;
    assert_eq!(refused(most, most, true), None);
    assert!(refused(most, most + 1, true).is_some_and(|why| why.contains("12001")));
}
