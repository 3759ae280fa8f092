//! `cargo xtask bench-dump`: the registers of a real board, through its debug probe, beside those of the virtual one.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use crate::{board, run};

/// A register and its value after the start on the virtual board.
#[derive(Debug, PartialEq)]
struct Register {
    name: String,
    address: u32,
    value: u32,
    /// The bits to compare.
    mask: u32,
}

/// A line of `virtual-board dump`.
fn register(line: &str) -> Result<Register> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [name, address, value, mask] = words[..] else { bail!("not a register: {line}") };
    let number = |word| u32::from_str_radix(word, 16).with_context(|| format!("in {line}"));
    let (address, value, mask) = (number(address)?, number(value)?, number(mask)?);
    Ok(Register { name: name.to_owned(), address, value, mask })
}

/// The word that `probe-rs read b32` prints.
fn word(output: &str) -> Result<u32> {
    let word = output.split_whitespace().next_back().context("probe-rs printed nothing")?;
    let digits = word.trim_start_matches("0x");
    u32::from_str_radix(digits, 16).with_context(|| format!("probe-rs printed {output:?}"))
}

/// The difference of a register, if there is one.
fn difference(expected: &Register, found: u32) -> Option<String> {
    let bits = (found ^ expected.value) & expected.mask;
    (bits != 0).then(|| {
        let Register { name, value, mask, .. } = expected;
        let list: Vec<String> =
            (0..32).filter(|bit| bits >> bit & 1 == 1).map(|bit| bit.to_string()).collect();
        let found = found & mask;
        format!("{name}: {found:#010x}, virtual board {value:#010x}, bits {}", list.join(" "))
    })
}

/// Reads every register of the board at the probe, without halting its core, and compares them with those of the virtual
/// board with the same image.
pub fn dump(elf: &Path, name: &str, chip: &str) -> Result<()> {
    run::probe_rs()?;
    let text = run::said(board::program("dump", elf)?.args(["--board", name]))?;
    let mut differences = 0;
    for line in text.lines() {
        let expected = register(line)?;
        let mut read = run::command("probe-rs");
        read.args(["read", "--chip", chip, "b32", &format!("{:#x}", expected.address), "1"]);
        match difference(&expected, word(&run::said(&mut read)?)?) {
            None => println!("{}: as on the virtual board", expected.name),
            Some(text) => {
                differences += 1;
                println!("{text}");
            }
        }
    }
    ensure!(differences == 0, "{differences} registers differ; do not connect the power stage");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bdtr() -> Register {
        register("TIM1_BDTR 40012c44 00043f9e ffffffff").unwrap()
    }

    #[test]
    fn lines_of_the_virtual_board_are_read_and_others_refused() {
        let expected = Register {
            name: "TIM1_BDTR".into(),
            address: 0x4001_2c44,
            value: 0x0004_3f9e,
            mask: u32::MAX,
        };
        assert_eq!(bdtr(), expected);
        for line in ["", "TIM1_BDTR", "TIM1_BDTR 40012c44 00043f9e", "A B C X"] {
            assert!(register(line).is_err(), "{line}");
        }
    }

    #[test]
    fn words_of_probe_rs_are_read() {
        assert_eq!(word("00043f9e \n").unwrap(), 0x0004_3f9e);
        assert_eq!(word("0x00043f9e").unwrap(), 0x0004_3f9e);
        assert!(word("").is_err() && word("error").is_err());
    }

    #[test]
    fn a_difference_names_the_bits_and_the_mask_hides_others() {
        let expected = bdtr();
        assert_eq!(difference(&expected, expected.value), None);
        let text = difference(&expected, expected.value ^ 0x300).unwrap();
        assert!(text.starts_with("TIM1_BDTR: ") && text.ends_with("bits 8 9"), "{text}");
        let hidden = Register { mask: !0x300, ..expected };
        assert_eq!(difference(&hidden, hidden.value ^ 0x300), None);
    }
}
