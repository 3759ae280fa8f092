//! Compares the registers of a real board, read through its debug probe, with those of the virtual board. `cargo xtask
//! bench-dump` runs this.

use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use virtual_board::{Image, PowerStage};

use crate::common::dump;

#[allow(dead_code, reason = "only names and offsets of the registers are compared here")]
#[path = "../stm32g4-unicorn/tests/registers/svd.rs"]
mod svd;

/// Parses name, address, value, and bits to compare from a line of the virtual board.
fn register(line: &str) -> Result<(&str, u32, u32, u32)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [name, address, value, mask] = words[..] else { bail!("not a register: {line}") };
    let number = |word| u32::from_str_radix(word, 16).with_context(|| format!("in {line}"));
    Ok((name, number(address)?, number(value)?, number(mask)?))
}

/// Parses the word that `probe-rs read b32` prints.
fn word(output: &str) -> Result<u32> {
    let word = output.split_whitespace().next_back().context("probe-rs printed nothing")?;
    let digits = word.trim_start_matches("0x");
    u32::from_str_radix(digits, 16).with_context(|| format!("probe-rs printed {output:?}"))
}

/// Returns the difference of a register, if there is one.
fn difference(line: &str, found: u32) -> Result<Option<String>> {
    let (name, _, value, mask) = register(line)?;
    let bits = (found ^ value) & mask;
    let list: Vec<_> =
        (0..32).filter(|bit| bits >> bit & 1 == 1).map(|bit| bit.to_string()).collect();
    let found = found & mask;
    let text =
        || format!("{name}: {found:#010x}, virtual board {value:#010x}, bits {}", list.join(" "));
    Ok((bits != 0).then(text))
}

/// Reads without halting the core. The variables are `BOARD`, its name, and `CHIP`, its name for probe-rs.
#[test]
#[ignore = "needs a board at a debug probe; cargo xtask bench-dump runs it"]
fn every_register_of_the_board_is_that_of_the_virtual_board() -> Result<()> {
    let [board, chip] = ["BOARD", "CHIP"].map(|name| std::env::var(name).context(name));
    let (mut differences, chip) = (Vec::new(), chip?);
    for line in dump::lines(Image::built()?, PowerStage::named(&board?)?)? {
        let (name, address, ..) = register(&line)?;
        let address = format!("{address:#x}");
        let output = Command::new("probe-rs")
            .args(["read", "--chip", &chip, "b32", &address, "1"])
            .output()?;
        ensure!(output.status.success(), "probe-rs: {}", String::from_utf8_lossy(&output.stderr));
        let found = word(&String::from_utf8_lossy(&output.stdout))?;
        let text = difference(&line, found)?;
        println!("{}", text.as_deref().unwrap_or(&format!("{name}: as on the virtual board")));
        differences.extend(text);
    }
    ensure!(
        differences.is_empty(),
        "{} registers differ; do not connect the power stage",
        differences.len()
    );
    Ok(())
}

#[test]
fn a_difference_names_the_bits_and_the_mask_hides_others() {
    let line = "TIM1_BDTR 40012c44 00043f9e fffffcff";
    assert_eq!(difference(line, word("0x00043f9e \n").unwrap()).unwrap(), None);
    assert_eq!(difference(line, 0x0004_3f9e ^ 0x300).unwrap(), None);
    let text = difference(line, 0x0004_3f9e ^ 0x1800).unwrap().unwrap();
    assert!(text.starts_with("TIM1_BDTR: ") && text.ends_with("bits 11 12"), "{text}");
    assert!(word("").is_err() && word("error").is_err() && register("A B C X").is_err());
}

/// The registers that are compared with those of a real board have the names and addresses of the access crate.
#[test]
fn compared_registers_are_those_of_the_access_crate() -> Result<()> {
    // The crate uses other names: C1CSR, APB1L_FZ, APB2_FZ; the memory protection belongs to the core.
    let elsewhere = ["COMP1_", "DBGMCU_", "MPU_"];
    let compared = dump::registers()?;
    for (name, address, _) in &compared {
        let Some((_, register)) = name.split_once('_') else { panic!("{name}") };
        if elsewhere.iter().any(|first| name.starts_with(first)) {
            continue;
        }
        let mut found = false;
        for (module, _, base) in svd::BLOCKS {
            let offset = address.wrapping_sub(base);
            found |= svd::registers(module)?.iter().any(|known| {
                // CCMR1 has two names in the crate, for inputs and for outputs.
                let name = known.name.trim_end_matches("_output");
                known.offset == offset && name.eq_ignore_ascii_case(register)
            });
        }
        assert!(found, "{name} at {address:#x}");
    }
    assert!(compared.len() > 60, "{}", compared.len());
    Ok(())
}
