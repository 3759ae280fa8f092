//! The table by which the firmware knows the pins of its peripherals, made of the data of `stm32-metapac`.

use std::fs;

use anyhow::{Context, Result, ensure};
use stm32_metapac::metadata::METADATA;

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../src/boards/reach.in");
const HEAD: &str = "// The pins that each peripheral reaches, of the ports A to C of the STM32G474RE: alternate functions, channels of the ADCs up to 9,
// inputs of the comparators. `WRITE_DOCS=1 cargo test --release --test image reach` in `hil-sim/virtual-board` writes this file from the
// data of `stm32-metapac` 21; without WRITE_DOCS it compares them.
";
/// Signals with an alternate function.
const SIGNALS: &str = "TIM1_CH1 TIM1_CH1N TIM1_CH2 TIM1_CH2N TIM1_CH3 TIM1_CH3N TIM1_BKIN TIM2_CH1 TIM2_CH2 TIM8_CH1 \
    LPUART1_TX LPUART1_RX USART3_TX USART3_RX";
/// Analog inputs: name in the table, peripherals, and the name of their signals before the number.
const ANALOG: [(&str, &[&str], &str); 4] = [
    ("ADC1", &["ADC1"], "IN"),
    ("ADC2", &["ADC2"], "IN"),
    ("ADC34", &["ADC3", "ADC4"], "IN"),
    ("COMP13", &["COMP1", "COMP3"], "INP"),
];
/// The last channel of an ADC whose sampling time the firmware sets.
const LAST_CHANNEL: u8 = 9;

/// A pin, and the number for a signal of this name with this alternate function.
type Place = (char, u8, u8);

/// The pins of a peripheral for whose signals there is a number.
fn places(peripheral: &str, number: impl Fn(&str, Option<u8>) -> Option<u8>) -> Result<Vec<Place>> {
    let known = METADATA.peripherals.iter().find(|known| known.name == peripheral);
    let place = |name: &str| {
        let (port, place) = name.strip_prefix('P')?.split_at_checked(1)?;
        let port = port.to_lowercase().chars().next().filter(|port| ('a'..='c').contains(port))?;
        Some((port, place.parse().ok()?))
    };
    let pins = known.with_context(|| format!("no {peripheral}"))?.pins.iter();
    let found = pins.filter_map(|pin| {
        let (port, place) = place(pin.pin)?;
        Some((port, place, number(pin.signal, pin.af)?))
    });
    Ok(found.collect())
}

#[test]
fn the_pins_of_the_firmware_are_those_of_the_chip_data() -> Result<()> {
    let mut table = HEAD.to_owned();
    let mut write = |name: &str, kind: &str, mut pins: Vec<(char, u8, String)>| {
        pins.sort();
        let pins = pins.iter().map(|(port, place, number)| format!("(p{port}({place}), {number})"));
        let pins = pins.collect::<Vec<_>>().join(", ");
        table += &format!("/// Pins of {name}.\npub const {name}: &[{kind}] = &[{pins}];\n");
    };
    for name in SIGNALS.split_whitespace() {
        let (peripheral, signal) = name.split_once('_').context("no signal")?;
        let pins = places(peripheral, |known, af| af.filter(|_| known == signal))?;
        let pins = pins.into_iter().map(|(port, place, af)| (port, place, af.to_string()));
        write(name, "Reach", pins.collect());
    }
    for (name, peripherals, prefix) in ANALOG {
        let mut all = Vec::new();
        for (n, peripheral) in peripherals.iter().enumerate() {
            let number = |known: &str, _| known.strip_prefix(prefix)?.parse().ok();
            let pins = places(peripheral, |known, af| {
                number(known, af).filter(|number| *number <= LAST_CHANNEL)
            })?;
            let shown = |number| match peripherals {
                [_] => format!("{number}"),
                _ => format!("({n}, {number})"),
            };
            all.extend(pins.into_iter().map(|(port, place, number)| (port, place, shown(number))));
        }
        write(name, if peripherals.len() > 1 { "ReachOfTwo" } else { "Reach" }, all);
    }
    if std::env::var_os("WRITE_DOCS").is_some() {
        fs::write(TABLE, &table)?;
    }
    ensure!(fs::read_to_string(TABLE)? == table, "src/boards/reach.in differs from stm32-metapac");
    Ok(())
}
