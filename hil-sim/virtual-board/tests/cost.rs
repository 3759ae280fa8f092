//! Cycles of single instructions, and the limits of the control interrupt.

use std::collections::BTreeMap;

use virtual_board::cost::{instructions, waits};
use virtual_board::cycles::{Row, check};

fn cycles(code: &[u16]) -> Vec<u32> {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    instructions(&bytes).map(|instruction| instruction.cycles).collect()
}

#[test]
fn the_table_of_the_manual() {
    // ldr r0,[r1]; ldr r2,[r3]; str r0,[r1]; adds r0,r0,r1
    assert_eq!(cycles(&[0x6808, 0x681a, 0x6008, 0x1840]), [2, 1, 1, 1]);
    // push {r4-r7,lr}; pop {r4-r7,pc}
    assert_eq!(cycles(&[0xb5f0, 0xbdf0]), [6, 6]);
    // vmul.f32 s0,s0,s1; vadd.f32 s2,s0,s1 (waits); vdiv.f32 s4,s2,s3 (waits); vsqrt.f32 s0,s1
    assert_eq!(
        cycles(&[0xee20, 0x0a20, 0xee30, 0x1a20, 0xee81, 0x2a21, 0xeeb1, 0x0ae0]),
        [1, 2, 15, 14]
    );
    // vmla.f32 s0,s1,s2; vldr s0,[r0]; vstr s0,[r0]; vmrs; udiv r0,r1,r2
    assert_eq!(
        cycles(&[0xee00, 0x0a81, 0xed90, 0x0a00, 0xed80, 0x0a00, 0xeef1, 0xfa10, 0xfbb1, 0xf0f2]),
        [3, 2, 2, 1, 6]
    );
    // vpush {s16-s19}; ldrd r0,r1,[r2]; bl
    assert_eq!(cycles(&[0xed2d, 0x8a04, 0xe9d2, 0x0100, 0xf000, 0xf800]), [5, 3, 1]);
}

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

#[test]
fn code_in_the_flash_waits_for_each_line_of_eight_bytes() {
    assert_eq!(waits(0x0800_0000, 8), 4);
    assert_eq!(waits(0x0800_0006, 4), 8);
    assert_eq!(waits(0x0800_0000, 24), 12);
}
