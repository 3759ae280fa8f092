//! The check sum of the image, `update`, and ST's boot loader that it starts.

use crate::common::{until_said, until_within};
use anyhow::{Result, ensure};
use hil_sim::Config;
use hil_sim::console::update;
use rand::{RngExt as _, SeedableRng as _};
use stm32g4_unicorn::memory::FLASH;
use stm32g4_unicorn::periph::Reset;
use virtual_board::interactive::pty::Pty;
use virtual_board::{Board, Image, Options};

/// Largest number of control periods until the image greets.
const GREETING: u64 = 30_000;
const DAMAGED: &str =
    "error: the image is damaged: `update gates-off`, with the supply of the gate drivers off\r\n";

fn board() -> Result<Board> {
    Board::new(Image::built()?, Options::new(&Config::default(), 37))
}

/// Returns the first output after a line.
fn ask(board: &mut Board, line: &str) -> Result<String> {
    board.type_line(line);
    until_within(board, "\n", 3000)
}

/// Returns the modes of all pins except PA2 and PA3.
fn modes(board: &mut Board) -> Vec<u32> {
    let console = |port: usize| if port == 0 { 0xf0 } else { 0 };
    let gpio = board.chip().gpio.iter().enumerate();
    gpio.map(|(n, port)| port.read(0).unwrap_or(0) | console(n)).collect()
}

/// The greeting comes with an intact image. One wrong bit anywhere outside of the start block, or a word that the flash
/// cannot correct, leaves all pins alone except those of the console, which reports the reason.
#[test]
fn a_damaged_image_does_not_start_and_says_so() -> Result<()> {
    let mut board = board()?;
    until_said(&mut board, "induction-drive")?;
    let version = ask(&mut board, "version")?;
    let check = board.cpu.word(board.image.symbol("__check")?.address).unwrap_or(0);
    ensure!(version.contains(&format!(", image {check:08x}, ")), "{version}");
    board.reset(Reset::Pin);
    let untouched = modes(&mut board);
    let refused = |board: &mut Board, why: &str| -> Result<()> {
        let said = until_within(board, "damaged", 3000)?;
        ensure!(said.starts_with("error: the image is damaged: `update"), "{why}: {said}");
        let said = ask(board, "@7 status")?;
        ensure!(said.starts_with("error: the image is damaged"), "{why}: {said}");
        ensure!(modes(board) == untouched, "{why}: pins");
        Ok(())
    };
    for segment in board.image.segments.clone() {
        let last = segment.address + segment.bytes.len() as u32 - 1;
        for at in [segment.address, last].into_iter().filter(|at| *at >= FLASH + 2048) {
            let byte = board.cpu.byte(at).unwrap_or(0);
            board.cpu.write(at, &[byte ^ 0x10]);
            board.reset(Reset::Pin);
            refused(&mut board, &format!("{at:#x}"))?;
            board.cpu.write(at, &[byte]);
        }
    }
    board.reset(Reset::Pin);
    board.chip().flash.bad_code = Some(FLASH + 0x2_0000);
    refused(&mut board, "check code")?;
    board.reset(Reset::Pin);
    while modes(&mut board) == untouched {
        board.run_periods(1)?;
    }
    until_said(&mut board, "induction-drive").map(drop)
}

/// Returns the image as the `.bin` of `cargo firmware`; with `other` it has another commit in its text and the sum of that.
fn binary(board: &Board, other: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for segment in &board.image.segments {
        let at = (segment.address - FLASH) as usize;
        bytes.resize(bytes.len().max(at + segment.bytes.len()), 0xff);
        bytes[at..at + segment.bytes.len()].copy_from_slice(&segment.bytes);
    }
    if other {
        let commit = b", commit ";
        let at = bytes.windows(9).position(|text| text == commit).expect("a commit") + 9;
        bytes[at..at + 4].copy_from_slice(b"next");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4"));
        let pieces = (board.image.symbol("__pieces").expect("pieces").address - FLASH) as usize;
        let sum = (0..4).fold(u32::MAX, |sum, n| {
            let [from, to] = [0, 4].map(|at| (word(pieces + 8 * n + at) - FLASH) as usize);
            bytes[from..to].iter().fold(sum, |sum, byte| {
                let step = |v: u32, _| v >> 1 ^ if v & 1 != 0 { 0xedb8_8320 } else { 0 };
                (0..8).fold(sum ^ u32::from(*byte), step)
            })
        });
        bytes[pieces + 32..pieces + 36].copy_from_slice(&(!sum).to_le_bytes());
    }
    bytes
}

/// Runs `cargo sim update` with these bytes while the board runs; returns the answer of the new image to `version`. It
/// ends early if power fails.
fn update(board: &mut Board, bytes: Vec<u8>) -> Result<Option<String>> {
    let image = update::Image::new(bytes).map_err(anyhow::Error::msg)?;
    let mut pty = Pty::open()?;
    let (mut port, _) = hil_sim::console::open(&pty.path.to_string_lossy(), 115_200)?;
    let host = std::thread::spawn(move || update::update(&mut port, &image, |_| ()));
    let resets = board.resets.len();
    while !host.is_finished() {
        board.send(&pty.read()?);
        board.run_periods(if board.loader.is_some() { 1 } else { 6 })?;
        if board.resets[resets..].iter().any(|(_, cause)| *cause == Reset::Power) {
            // The program gets no answer on the line, and ends.
            return Ok(None);
        }
        pty.write(&board.chip().lpuart.line.take())?;
    }
    let said = host.join().map_err(|_| anyhow::anyhow!("the program panicked"))?;
    Ok(Some(said?))
}

/// Returns a board without voltage at its power stage.
fn unsupplied() -> Result<Board> {
    let mut board = board()?;
    board.supply_stage(false, 1.0)?;
    until_said(&mut board, "induction-drive")?;
    Ok(board)
}

/// With the supply of the drivers on, the check of the gates detects the effect of the loader.
#[test]
fn a_loader_that_switches_a_gate_on_is_noticed() -> Result<()> {
    let mut board = board()?;
    until_said(&mut board, "induction-drive")?;
    board.supply_stage(true, 10.0)?;
    board.run_periods(600)?;
    ensure!(ask(&mut board, "update gates-off")?.starts_with("ok: ST's loader is next"));
    let why = board.run_periods(1200).expect_err("nothing was noticed").to_string();
    ensure!(why.contains("high side b is on while the outputs are off"), "{why}");
    Ok(())
}

/// The program writes another image, starts it and reads its check sum; settings stay.
#[test]
fn the_program_writes_another_image_and_keeps_the_settings() -> Result<()> {
    let mut board = unsupplied()?;
    ask(&mut board, "set speed.ramp_rpm_per_s 777")?;
    board.type_line("save");
    until_within(&mut board, "ok", 60_000)?;
    let next = binary(&board, true);
    let said = update(&mut board, next)?.expect("no power was lost");
    ensure!(said.contains(", commit next"), "{said}");
    ensure!(ask(&mut board, "get speed.ramp_rpm_per_s")?.contains("= 777"));
    Ok(())
}

/// Sends what the program sends, without waiting for answers, until power fails in an operation of the flash, counted from 1.
fn lose_power(board: &mut Board, bytes: &[u8], operation: u64) -> Result<()> {
    let summed = |bytes: &[u8]| [bytes, &[bytes.iter().fold(0, |sum, byte| sum ^ byte)]].concat();
    board.type_line("update gates-off");
    while board.loader.is_none() {
        board.run_periods(60)?;
    }
    let flash = &mut board.chip().flash;
    flash.power_loss_at = Some(flash.operations + operation);
    let resets = board.resets.len();
    board.send(&[0x7f]);
    let mut pages: Vec<_> = pages(bytes).collect();
    pages.rotate_left(1);
    for (n, page) in pages {
        board.send(&[&[0x44, 0xbb], &summed(&[0, 0, 0, n as u8])[..]].concat());
        for (block, data) in page.chunks(256).enumerate() {
            let at = (FLASH + (2048 * n + 256 * block) as u32).to_be_bytes();
            let data = summed(&[&[0xff], data].concat());
            board.send(&[&[0x31, 0xce], &summed(&at)[..], &data[..]].concat());
        }
        while board.loader.as_ref().is_some_and(|loader| !loader.line.is_empty()) {
            board.run_periods(1)?;
        }
        // The rest of the first page may reset the chip over and over.
        if board.resets[resets..].iter().any(|(_, cause)| *cause == Reset::Power) {
            return Ok(());
        }
    }
    anyhow::bail!("{operation}: no loss of power")
}

/// Returns the pages of an image that are not empty.
fn pages(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    bytes.chunks(2048).enumerate().filter(|(_, page)| page.iter().any(|byte| *byte != 0xff))
}

/// Power fails at random operations of the flash: afterwards the old or the new image runs, or the start block reports
/// the reason and accepts the update, or, while the first page is written, nothing starts.
fn power_losses(count: u32, first_page: u32) -> Result<()> {
    let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(37);
    let mut board = unsupplied()?;
    let [old, next] = [false, true].map(|other| {
        let mut bytes = binary(&board, other);
        bytes.resize(bytes.len().next_multiple_of(2048), 0xff);
        bytes
    });
    let operations = pages(&next).count() as u64 * (1 + 256);
    let (mut started, mut told, mut silent) = (0, 0, 0);
    for n in 0..count + first_page {
        // The original image, complete.
        for (at, page) in pages(&old) {
            let at = FLASH + 2048 * at as u32;
            board.cpu.write(at, page);
            board.chip().flash.by_loader(at..at + 2048, page);
        }
        board.forgive();
        board.reset(Reset::Pin);
        until_said(&mut board, "induction-drive")?;
        let at = operations - rng.random_range(0..if n < count { operations } else { 257 });
        lose_power(&mut board, &next, at)?;
        // Output after the loss is what follows the loader's bytes: confirmations (y) and a refusal of the operation without power.
        let heard = board.take_console();
        let mut said = heard.rsplit("yyy").next().unwrap_or_default().replace('\u{1f}', "");
        for _ in 0..GREETING / 600 {
            board.run_periods(600)?;
            said += &board.take_console();
            if said.ends_with('\n') {
                break;
            }
        }
        let in_first_page = at + 257 > operations;
        println!("{n}: {at} of {operations}: {said:?}");
        match said.as_str() {
            text if text.contains("induction-drive") => started += 1,
            text if text.ends_with(DAMAGED) => {
                told += 1;
                ensure!(ask(&mut board, "update gates-off")?.starts_with("ok: ST's"), "{at}");
                board.run_periods(60)?;
                ensure!(board.loader.is_some(), "{at}: no loader");
            }
            text if in_first_page && DAMAGED.starts_with(text) => silent += 1,
            text => anyhow::bail!("{at} of {operations}: {text:?}"),
        }
    }
    println!("{operations} operations; {started} started, {told} told why not, {silent} did not");
    Ok(())
}

#[test]
fn a_loss_of_power_leaves_an_image_that_starts_or_says_why_not() -> Result<()> {
    power_losses(2, 1)
}

/// Run with `cargo test --release --test image update::fifty -- --ignored --nocapture`.
#[test]
#[ignore = "long"]
fn fifty_losses_of_power_and_ten_in_the_first_page() -> Result<()> {
    power_losses(50, 10)
}

/// An image names its board, and so does the drive at the port. Each image fits only its own board, and the refusal of
/// another one names both boards.
#[test]
fn an_image_of_another_board_is_not_written() -> Result<()> {
    let mut board = board()?;
    until_said(&mut board, "last run: ")?;
    let mut pty = Pty::open()?;
    let (mut port, _) = hil_sim::console::open(&pty.path.to_string_lossy(), 115_200)?;
    let host = std::thread::spawn(move || update::board_at(&mut port));
    while !host.is_finished() {
        board.send(&pty.read()?);
        board.run_periods(6)?;
        pty.write(board.take_console().as_bytes())?;
    }
    let there = host.join().expect("it ends").map_err(|why| anyhow::anyhow!("{why:?}"))?;
    ensure!(there.as_deref() == Some("reference"), "{there:?}");
    for stage in virtual_board::power_stage::ALL {
        let options = Options::on(stage, &stage.config()?, 1);
        let other = Board::new(Image::built_for(stage.name)?, options)?;
        let image = update::Image::new(binary(&other, false)).map_err(anyhow::Error::msg)?;
        ensure!(image.board.as_deref() == Some(stage.name), "{:?}", image.board);
        let fits = image.fits(there.as_deref());
        match fits {
            Ok(()) => ensure!(stage.name == "reference", "{} fits", stage.name),
            Err(why) => {
                let both = [stage.name, "is a reference", "--other-board"];
                ensure!(stage.name != "reference" && both.iter().all(|part| why.contains(part)));
            }
        }
        // Nothing is known of a board that does not answer.
        ensure!(image.fits(None).is_ok());
    }
    Ok(())
}
