//! A circuit follows the pins.

use stm32g4_unicorn::periph::{Reset, gpio::Gpio, gpio::Pad, tim1::Tim1};
use stm32g4_unicorn::{Chip, Circuit};

/// A light-emitting diode at PA5.
#[derive(Default)]
struct Led {
    is_lit: bool,
}

impl Circuit for Led {
    fn follow(&mut self, ports: &[Gpio; 7], _: &Tim1, _: u32, _: u64) {
        self.is_lit = ports[0].pad(5) == Pad::Output(true);
    }
}

#[test]
fn a_circuit_follows_writes_and_resets() {
    let mut chip = Chip::<Led>::default();
    // The clock of the port, then MODER and BSRR.
    for (address, value) in [(0x4002_104c, 1), (0x4800_0000, 1 << 10), (0x4800_0018, 1 << 5)] {
        assert!(!chip.circuit.is_lit);
        chip.write(address, 4, value);
        chip.now += 100;
    }
    assert!(chip.circuit.is_lit);
    chip.reset(Reset::Pin);
    assert!(!chip.circuit.is_lit);
}
