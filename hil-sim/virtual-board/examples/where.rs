//! w
use std::path::Path;
use virtual_board::*;
use virtual_board::cpu::*;
fn main() -> anyhow::Result<()> {
    let elf = std::env::args().nth(1).unwrap();
    let n: u64 = std::env::args().nth(2).unwrap().parse()?;
    let image = image::Image::open(Path::new(&elf))?;
    let mut board = Board::new(image, Options::new(&hil_sim::Config::default(), 1))?;
    for k in 0..n {
        let r = board.run_ticks(28334);
        let (now, ins, act) = (board.chip().now, board.chip().instructions, board.chip().scs.active.clone()); let at = board.chip().at; let pc = board.cpu().get(Register::Pc);
        println!("{k} now {} insns {} at {} pc {pc:#x} active {:?}", now, ins, board.image().location(at), act);
        for x in board.logged()? { println!("LOG {x}"); }
        r?;
    }
    Ok(())
}
