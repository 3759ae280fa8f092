//! The source text of the peripheral access crate `stm32g4`, in the version of Cargo.lock.

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use anyhow::{Context, Result, ensure};

/// Module of the access crate, name in `stm32-metapac`, base address. ADC2 is like ADC1.
pub const BLOCKS: [(&str, &str, u32); 25] = [
    ("tim1", "TIM1", 0x4001_2c00),
    ("tim1", "TIM8", 0x4001_3400),
    ("tim2", "TIM2", 0x4000_0000),
    ("tim5", "TIM5", 0x4000_0c00),
    ("tim16", "TIM16", 0x4001_4400),
    ("iwdg", "IWDG", 0x4000_3000),
    ("wwdg", "WWDG", 0x4000_2c00),
    ("pwr", "PWR", 0x4000_7000),
    ("lpuart1", "LPUART1", 0x4000_8000),
    ("usart1", "USART3", 0x4000_4800),
    ("syscfg", "SYSCFG", 0x4001_0000),
    ("comp", "COMP", 0x4001_0200),
    ("exti", "EXTI", 0x4001_0400),
    ("rcc", "RCC", 0x4002_1000),
    ("flash", "FLASH", 0x4002_2000),
    ("gpioa", "GPIOA", 0x4800_0000),
    ("gpiob", "GPIOB", 0x4800_0400),
    ("gpioc", "GPIOC", 0x4800_0800),
    ("gpioc", "GPIOF", 0x4800_1400),
    ("adc1", "ADC1", 0x5000_0000),
    ("adc1", "ADC2", 0x5000_0100),
    ("adc12_common", "ADC12_COMMON", 0x5000_0300),
    ("dac1", "DAC1", 0x5000_0800),
    ("dac1", "DAC3", 0x5000_1000),
    ("dbgmcu", "DBGMCU", 0xe004_2000),
];

/// A register of the crate.
pub struct Register {
    pub name: String,
    pub offset: u32,
    pub reset: u32,
    /// Writable bits of its fields.
    pub fields: u32,
    pub readable: bool,
    pub writable: bool,
}

/// Returns the folder of the chip in the source of the crate.
fn folder() -> Result<&'static PathBuf> {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    if let Some(folder) = FOLDER.get() {
        return Ok(folder);
    }
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let data: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let packages = data["packages"].as_array().context("no packages")?;
    let found = packages.iter().find(|package| package["name"] == "stm32g4");
    let manifest = found.and_then(|package| package["manifest_path"].as_str());
    let manifest = PathBuf::from(manifest.context("no stm32g4 among the packages")?);
    let folder = manifest.parent().context("no folder")?.join("src/stm32g474");
    Ok(FOLDER.get_or_init(|| folder))
}

/// Returns the number at the beginning of a text.
fn number(text: &str) -> Option<u32> {
    let digits: String =
        text.chars().take_while(|c| c.is_ascii_hexdigit() || *c == '_' || *c == 'x').collect();
    let digits = digits.replace('_', "");
    match digits.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16).ok(),
        None => digits.parse().ok(),
    }
}

/// Returns the bits of `Bits 8:9 - ` or `Bit 15 - `.
fn bits(line: &str) -> Option<u32> {
    let rest = line.trim().strip_prefix("///Bit")?.trim_start_matches('s').trim_start();
    let (range, _) = rest.split_once(" - ")?;
    let (low, high) = range.split_once(':').unwrap_or((range, range));
    let (low, high): (u32, u32) = (low.parse().ok()?, high.parse().ok()?);
    Some((u64::MAX >> (63 - (high - low))) as u32).map(|mask| mask << low)
}

fn fields(source: &str) -> u32 {
    let lines: Vec<_> = source.lines().collect();
    lines.windows(3).fold(0, |mask, three| {
        let writes = three[1..].iter().any(|line| line.contains("(&mut self"));
        mask | if writes { bits(three[0]).unwrap_or(0) } else { 0 }
    })
}

/// Returns the registers of a module.
pub fn registers(module: &str) -> Result<Vec<Register>> {
    let folder = folder()?;
    // TIM5 is a copy of TIM2.
    let module = if module == "tim5" { "tim2" } else { module };
    let block = std::fs::read_to_string(folder.join(module).with_extension("rs"))?;
    let mut registers = Vec::new();
    let mut offset = None;
    for line in block.lines().map(str::trim) {
        if let Some(doc) = line.strip_prefix("///0x") {
            offset = number(&format!("0x{doc}"));
        }
        let Some(rest) = line.strip_prefix("pub const fn ") else { continue };
        let (Some((name, rest)), Some(at)) = (rest.split_once("(&self) -> &"), offset.take())
        else {
            continue;
        };
        let file = rest.trim_end_matches(" {").to_lowercase();
        let places = [module, "gpioa"].map(|m| folder.join(m).join(&file).with_extension("rs"));
        let Some(path) = places.iter().find(|path| path.is_file()) else { continue };
        let source = std::fs::read_to_string(path)?;
        let reset = source
            .split_once("RESET_VALUE: u")
            .and_then(|(_, rest)| number(rest.split_once(" = ")?.1));
        registers.push(Register {
            name: name.to_owned(),
            offset: at,
            reset: reset.unwrap_or(0),
            fields: fields(&source),
            readable: source.contains("impl crate::Readable for"),
            writable: source.contains("impl crate::Writable for"),
        });
    }
    ensure!(!registers.is_empty(), "no registers in {module}");
    Ok(registers)
}
