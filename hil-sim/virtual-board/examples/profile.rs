//! Samples where the core is: profile <elf> <ticks between> <samples>
use std::collections::BTreeMap;
use std::path::Path;
use virtual_board::*;
fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let image = image::Image::open(Path::new(&args[0]))?;
    let mut board = Board::new(image, Options::new(&hil_sim::Config::default(), 1))?;
    let mut all = BTreeMap::<String, u32>::new();
    let mut own = BTreeMap::<String, u32>::new();
    let n: u32 = args[2].parse()?;
    for _ in 0..n {
        board.run_ticks(args[1].parse()?)?;
        let sp = board.cpu_sp();
        let mut seen = std::collections::BTreeSet::new();
        let at = board.chip().at;
        for (k, f) in board.image().frames(at).iter().enumerate() { if k == 0 { *own.entry(f.function.clone()).or_default() += 1; } seen.insert(f.function.clone()); }
        // return addresses on the stack, conservatively
        for k in 0..400 { if let Some(w) = board.word(sp + 4 * k) { if w & 1 == 1 && (0x0800_0200..0x0801_1278).contains(&w) { for f in board.image().frames((w & !1) - 2) { seen.insert(f.function); } } } }
        for f in seen { *all.entry(f).or_default() += 1; }
    }
    for (name, map) in [("own", own), ("all", all)] { println!("-- {name}"); let mut v: Vec<_> = map.into_iter().collect(); v.sort_by_key(|x| std::cmp::Reverse(x.1)); for (f, c) in v.iter().take(26) { println!("{:5.1}% {f}", 100.0 * *c as f64 / n as f64); } }
    Ok(())
}
