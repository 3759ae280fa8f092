//! Cycles of single instructions, and wait states of the flash.

use stm32g4_unicorn::cost::{instructions, waits};

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
fn code_in_the_flash_waits_for_each_line_of_eight_bytes() {
    assert_eq!(waits(0x0800_0000, 8, 4), 4);
    assert_eq!(waits(0x0800_0006, 4, 4), 8);
    assert_eq!(waits(0x0800_0000, 24, 4), 12);
}
