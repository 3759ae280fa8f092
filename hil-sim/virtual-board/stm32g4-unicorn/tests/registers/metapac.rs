//! The data of `stm32-metapac`.

use std::collections::BTreeMap;

use stm32_metapac::metadata::ir::{Array, BitOffset, BlockItemInner, IR};
use stm32_metapac::metadata::{METADATA, Peripheral};
use stm32g4_unicorn::chip::pins::Pin;

fn peripheral(name: &str) -> Option<&'static Peripheral> {
    METADATA.peripherals.iter().find(|peripheral| peripheral.name == name)
}

fn places(array: &Option<Array>) -> Vec<u32> {
    match array {
        None => vec![0],
        Some(Array::Regular(regular)) => (0..regular.len).map(|n| n * regular.stride).collect(),
        Some(Array::Cursed(cursed)) => cursed.offsets.to_vec(),
    }
}

/// Whether two names are the same; names of blocks and registers are written in two ways.
fn same(a: &str, b: &str) -> bool {
    let plain = |name: &str| name.replace('_', "").to_lowercase();
    plain(a) == plain(b)
}

fn mask(ir: &IR, fieldset: &str) -> u32 {
    let Some(set) = ir.fieldsets.iter().find(|set| same(set.name, fieldset)) else { return 0 };
    let inherited = set.extends.map_or(0, |base| mask(ir, base));
    set.fields.iter().fold(inherited, |mask, field| {
        let one = match &field.bit_offset {
            BitOffset::Regular(at) => ((1_u64 << field.bit_size) - 1) << at.offset,
            BitOffset::Cursed(at) => at
                .ranges
                .iter()
                .fold(0, |mask, range| range.clone().fold(mask, |mask, bit| mask | 1 << bit)),
        };
        places(&field.array).into_iter().fold(mask, |mask, by| mask | (one << by) as u32)
    })
}

fn collect(ir: &IR, block: &str, base: u32, into: &mut BTreeMap<u32, u32>) {
    let Some(block) = ir.blocks.iter().find(|known| same(known.name, block)) else { return };
    if let Some(extends) = block.extends {
        collect(ir, extends, base, into);
    }
    for item in block.items {
        for place in places(&item.array) {
            let offset = base + item.byte_offset + place;
            match &item.inner {
                BlockItemInner::Block(inner) => collect(ir, inner.block, offset, into),
                BlockItemInner::Register(register) => {
                    let all = u32::MAX >> (32 - register.bit_size.min(32));
                    *into.entry(offset).or_default() |=
                        register.fieldset.map_or(all, |set| mask(ir, set));
                }
            }
        }
    }
}

/// Returns the fields of the registers of a peripheral, by offset.
pub fn registers(name: &str) -> BTreeMap<u32, u32> {
    let mut all = BTreeMap::new();
    // Each comparator is a separate peripheral.
    let names: Vec<_> = match name {
        "COMP" => (1..=7).map(|n| (format!("COMP{n}"), 4 * (n - 1))).collect(),
        _ => vec![(name.to_owned(), 0)],
    };
    for (name, base) in names {
        if let Some(registers) = peripheral(&name).and_then(|known| known.registers.as_ref()) {
            collect(registers.ir, registers.block, base, &mut all);
        }
    }
    all
}

/// Returns enable register and bit of the clock of a peripheral.
pub fn clock(name: &str) -> Option<(u32, u32)> {
    let enable = peripheral(name)?.rcc.as_ref()?.enable.as_ref()?;
    let rcc = peripheral("RCC")?.registers.as_ref()?;
    let block = rcc.ir.blocks.iter().find(|block| same(block.name, rcc.block))?;
    let register =
        |known: &&stm32_metapac::metadata::ir::BlockItem| same(known.name, enable.register);
    let item = block.items.iter().find(register)?;
    let BlockItemInner::Register(register) = &item.inner else { return None };
    let set = rcc.ir.fieldsets.iter().find(|set| Some(set.name) == register.fieldset)?;
    let field = set.fields.iter().find(|field| same(field.name, enable.field))?;
    let BitOffset::Regular(at) = &field.bit_offset else { return None };
    Some((item.byte_offset, at.offset))
}

fn pin(name: &str) -> Option<Pin> {
    let port = name.as_bytes().get(1)?.checked_sub(b'A')?;
    Some((usize::from(port), name[2..].parse().ok()?))
}

/// Returns the pins of a signal such as `TIM1_CH1N`, with the alternate function of each.
pub fn pins_of(signal: &str) -> Vec<(Pin, u32)> {
    let Some((name, signal)) = signal.split_once('_') else { return Vec::new() };
    let all = peripheral(name).map_or(&[][..], |known| known.pins);
    let mine = all.iter().filter(|known| known.signal == signal);
    mine.filter_map(|known| Some((pin(known.pin)?, u32::from(known.af?)))).collect()
}

/// Returns the pin of a channel of ADC1 to ADC4, counted from 0.
pub fn analog_pin(converter: usize, channel: u32) -> Option<Pin> {
    let known = peripheral(["ADC1", "ADC2", "ADC3", "ADC4"][converter])?;
    let signal = format!("IN{channel}");
    known.pins.iter().find(|known| known.signal == signal).and_then(|known| pin(known.pin))
}
