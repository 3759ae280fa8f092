//! IT blocks: the emulator mistakes the instructions after one for a part of it where it looks up a page in it.

use stm32g4_unicorn::cpu::{Counting, Cpu, Register, Stop};
use stm32g4_unicorn::{Chip, memory};

/// `cmp r0, r0`, `ittt eq`, three stores from r2, `subs r3, #1`, `bne` to the first one, `wfi`.
const PROGRAM: [u16; 8] = [0x4280, 0xbf02, 0x6011, 0x6051, 0x6091, 0x3b01, 0xd1f8, 0xbf30];

/// The core stops after each number of instructions, and the first of its stores needs a page that it has not seen.
#[test]
fn code_after_an_it_block_is_not_in_it_wherever_the_core_stops() {
    for every_instruction in [false, true] {
        for instructions in 1..15 {
            let counting = Counting { cycles: true, every_instruction };
            let mut cpu: Cpu = Cpu::new(Chip::default(), counting).unwrap();
            assert!(cpu.write(memory::FLASH, PROGRAM.map(u16::to_le_bytes).as_flattened()));
            cpu.set(Register::PC, memory::FLASH);
            cpu.set(Register::R1, 7);
            cpu.set(Register::R2, memory::RAM);
            cpu.set(Register::R3, 2);
            for (deadline, expected) in
                [(cpu.chip().now + instructions, Stop::Asked), (u64::MAX, Stop::Wait)]
            {
                cpu.chip_mut().deadline = deadline;
                let stop = cpu.run();
                let at = cpu.get(Register::PC) - memory::FLASH;
                assert_eq!(stop, expected, "after {instructions}, at {at}");
            }
            assert_eq!(cpu.get(Register::R3), 0, "after {instructions}");
        }
    }
}
