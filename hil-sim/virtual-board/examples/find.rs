//! f
use virtual_board::*;
use virtual_board::cpu::*;
fn main() -> anyhow::Result<()> {
    let mut c = hil_sim::Config::default(); c.load.mode = hil_sim::config::LoadMode::Free;
    let mut board = Board::new(Image::built()?, Options::new(&c, 1))?;
    for (l, n) in [("version", 9000), ("angle encoder", 10000), ("start position", 9000), ("position 2", 10), ("trace 500 2", 6000), ("position -1", 10), ("trace 500 2", 0)] {
        board.type_line(l); board.run_periods(n)?;
    }
    board.logged()?;
    let mut last = 0;
    loop {
        board.run_ticks(3000)?;
        let now = board.chip().now;
        if now > 1004786740 - 800_000 {
            let i = board.chip().instructions; let at = board.chip().at; let act = board.chip().scs.active.clone();
            let pc = board.cpu().get(Register::Pc);
            let f = board.image().frames(at);
            println!("{now} ins {} pc {pc:x} {:?} {}", i - last, act, f.iter().map(|f| f.function.rsplit("::").take(2).collect::<Vec<_>>().join("<")).collect::<Vec<_>>().join(" | "));
            last = i;
        }
        if now > 1004786740 { break; }
    }
    Ok(())
}
