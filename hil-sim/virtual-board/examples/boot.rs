use std::path::Path;
use std::time::Instant;
use virtual_board::*;
fn main() -> anyhow::Result<()> {
    let elf = std::env::args().nth(1).unwrap();
    let image = image::Image::open(Path::new(&elf))?;
    let config = hil_sim::Config::default();
    let t = Instant::now();
    let mut board = Board::new(image, Options::new(&config, 1))?;
    println!("new {:?}", t.elapsed());
    let r = (|| -> anyhow::Result<()> {
        let mut shadow = Shadow::new()?;
        for (line, periods) in [("version", 600), ("status", 600), ("start torque", 6000*4), ("torque 1", 3000), ("status", 3000), ("torque 2", 6000), ("torque -1", 6000), ("stop", 6000), ("status", 600)] {
            board.type_line(line);
            shadow.type_line(line)?;
            let t = Instant::now();
            for _ in 0..periods {
            board.run_periods(1)?;
            for p in board.periods() { shadow.follow(&p)?; }
            }
            println!("{:.6} > {line}: {} compared {:?} cycles {}", board.time(), board.heard(), shadow.compared, board.worst.cycles);
            println!("   {:?} state {} torque {} wall per s: {:.3}", t.elapsed(), shadow.drive.state(), board.plant.torque(), t.elapsed().as_secs_f64()/periods as f64*6000.0);
            let l = board.logged()?; for x in l.iter().take(3).chain(l.iter().rev().take(3)) { println!("LOG {x}"); }
        }
        Ok(())
    })();
    for x in board.logged()? { println!("LOG {x}"); }
    println!("{}", board.heard());
    println!("resets {:?}", board.resets);
    r
}
