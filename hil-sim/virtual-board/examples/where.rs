//! Runs lines at the console: boot <elf> <line> <periods> ...
use std::path::Path;
use std::time::Instant;
use virtual_board::*;
fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let image = image::Image::open(Path::new(&args[0]))?;
    let mut c = hil_sim::Config::default(); if std::env::var("FREE").is_ok() { c.load.mode = hil_sim::config::LoadMode::Free; } let mut options = Options::new(&c, 1);
    options.counting.cycles = std::env::var("NOCOUNT").is_err();
    let mut board = Board::new(image, options)?;
    let mut before = 0;
    for pair in args[1..].chunks(2) {
        board.type_line(&pair[0]);
        let t = Instant::now();
        let r = board.run_periods(pair[1].parse()?);
        let mut n = 0; while board.next_period().is_some() { n += 1; }
        let ins = board.chip().instructions;
        println!("{:.6} > {}: {:?}; {} interrupts, {} flash instructions, wall {:?} resets {:?}", board.time(), pair[0], board.heard(), n, ins - before, t.elapsed(), board.resets);
        before = ins;
        for x in board.logged()?.iter().rev().take(4).rev() { println!("   LOG {x}"); }
        r?;
    }
    Ok(())
}
