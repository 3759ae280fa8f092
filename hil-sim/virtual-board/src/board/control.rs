//! The control interrupt as observed from outside: its inputs, its outputs and its cycles.

use drive_core::{Compare, Hardware, Sample};

use super::Board;
use crate::addresses::Addresses;
use stm32g4_unicorn::cost::{self, Block};

/// One control interrupt as observed from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// Time of its beginning, ticks.
    pub began: u64,
    /// Its input from the ADCs and the encoder.
    pub sample: Sample,
    /// Compare values that it wrote, and whether the outputs were on after it.
    pub compare: Compare,
    /// Whether it took a request from the console.
    pub took_order: bool,
    /// Estimated cycles, with entry, exit and bus, if they are counted.
    pub cycles: u32,
    /// Number of these cycles before the last compare value is written.
    pub to_compares: u32,
}

/// The running control interrupt.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningInterrupt {
    began: u64,
    sample: Sample,
    /// Whether the outputs were on.
    enabled: bool,
    ended: bool,
    had_order: bool,
    accesses: u64,
}

/// The longest path through the control interrupt.
#[derive(Clone, Debug, Default)]
pub struct LongestPath {
    /// Estimated cycles.
    pub cycles: u32,
    /// Accesses to registers.
    pub accesses: u32,
    /// The blocks executed.
    pub blocks: Vec<Block>,
}

impl Board {
    /// Whether a request waits for the control interrupt.
    fn has_order(&self) -> bool {
        let Some(Addresses { orders, order_waits, .. }) = self.addresses else { return false };
        let mailbox = self.cpu.word(orders);
        mailbox
            .and_then(|mailbox| self.cpu.byte(mailbox.wrapping_add(order_waits)))
            .is_some_and(|byte| byte != 0)
    }

    pub(super) fn begin_control(&mut self) {
        let had_order = self.has_order();
        let chip = self.cpu.chip_mut();
        chip.begin_counted();
        let mut hardware = Hardware::empty();
        hardware.set(Hardware::ANALOG_WATCHDOG, chip.adc.over_current());
        hardware.set(Hardware::BREAK, chip.tim1.broken());
        let (ended, complete) = chip.adc.ended();
        hardware.set(Hardware::CONVERTER_OVERRUN, ended && !complete);
        // With the drive off, the firmware switches it on again.
        let chopper_off = !chip.tim8.main_output() && chip.tim1.main_output();
        hardware.set(Hardware::CHOPPER_OFF, chopper_off);
        let [(one, upper_a), (two, upper_b)] = chip.adc.data();
        // With three shunts both ADCs convert the third current as their second channel.
        let has_shunts = chip.circuit.stage.shunts.is_some();
        let (current_c, slow) = if has_shunts { (one[1], 2) } else { (0, 1) };
        let sample = Sample {
            current_a: one[0] + upper_a,
            current_b: two[0] + upper_b,
            current_c,
            dc_link: one[slow],
            heat_sink: two[slow],
            encoder: chip.tim2.count(),
            hardware,
        };
        let (began, accesses) = (chip.now, chip.accesses);
        if let Some(at) = self.progress.pended.take() {
            self.latest_start = self.latest_start.max(began - at);
        }
        let enabled = chip.tim1.outputs_on();
        self.progress.entered =
            Some(RunningInterrupt { began, sample, enabled, ended, had_order, accesses });
    }

    pub(super) fn end_control(&mut self) {
        let Some(entered) = self.progress.entered.take() else { return };
        let took_order = entered.had_order && !self.has_order();
        let chip = self.cpu.chip_mut();
        chip.in_counted = false;
        let (compared, up_to) = chip.compared;
        let way = |blocks: &[Block], accesses: u64| {
            let accesses = (accesses - entered.accesses) as u32;
            (cost::of(blocks) + cost::ENTRY + accesses * cost::BUS, accesses)
        };
        let (cycles, accesses) = way(&chip.blocks, chip.accesses);
        let cycles = cycles + cost::EXIT;
        let (to_compares, accesses_before) = way(&chip.blocks[..compared], up_to);
        let note = |longest: &mut LongestPath, cycles, accesses, blocks: &[Block]| {
            if cycles > longest.cycles && !blocks.is_empty() {
                *longest = LongestPath { cycles, accesses, blocks: blocks.to_vec() };
            }
        };
        note(&mut self.longest, cycles, accesses, &chip.blocks);
        note(&mut self.longest_to_compares, to_compares, accesses_before, &chip.blocks[..compared]);
        if entered.ended {
            let [a, b, c] = chip.tim1.written().map(|value| value as u16);
            let RunningInterrupt { began, sample, enabled, .. } = entered;
            // A break in the meantime switches off what the interrupt leaves on, and the next sample shows it.
            let broke = chip.tim1.broken() && !sample.hardware.contains(Hardware::BREAK);
            let enabled = chip.tim1.outputs_on() || broke && enabled;
            let compare = Compare { a, b, c, enabled };
            let period = Period { began, sample, compare, took_order, cycles, to_compares };
            self.progress.periods.push_back(period);
        }
    }
}
