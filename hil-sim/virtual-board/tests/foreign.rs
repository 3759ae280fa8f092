//! Programs of others on the virtual board: examples of `stm32g4xx-hal`, and ours on `embassy-stm32`. They run on
//! chips; each rule that they break here, and each register that they need and the model does not have, is
//! explained below. `cargo xtask foreign` builds them and runs this.

use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use hil_sim::Config;
use virtual_board::rules::Rule;
use virtual_board::{Board, Counting, Image, Options};

/// Names the folder with the programs.
const FOLDER: &str = "INDUCTION_DRIVE_FOREIGN";

/// What is known of a program.
struct Program {
    name: &'static str,
    /// Periods that it runs.
    periods: u64,
    /// The rules that it breaks, and why.
    breaks: &'static [(Rule, &'static str)],
    /// Where the model ends, if it does: part of the error, and why.
    ends: Option<(&'static str, &'static str)>,
    /// What it must have done.
    done: fn(&mut Board) -> Result<()>,
}

const PROGRAMS: &[Program] = &[];

fn board(name: &str) -> Result<Board> {
    let folder = std::env::var_os(FOLDER).with_context(|| format!("{FOLDER} names no folder"))?;
    let image = Image::open(&PathBuf::from(folder).join(name))?;
    let mut options = Options::new(&Config::default(), 1);
    options.counting = Counting { cycles: false, every_instruction: true };
    let mut board = Board::new(image, options)?;
    board.collect_violations();
    Ok(board)
}

fn run(program: &Program) -> Result<String> {
    let mut board = board(program.name)?;
    let outcome = board.run_periods(program.periods);
    let mut broken: Vec<_> = board.violations().iter().map(|violation| violation.rule).collect();
    let text: String =
        board.violations().iter().map(|v| format!("    {v}, {} times\n", v.count)).collect();
    broken.sort_unstable();
    broken.dedup();
    let mut known: Vec<_> = program.breaks.iter().map(|known| known.0).collect();
    known.sort_unstable();
    let mut report = format!("{}\n{text}", program.name);
    match (&outcome, program.ends) {
        (Ok(()), None) => {}
        (Err(why), Some((end, reason))) if format!("{why:#}").contains(end) => {
            report += &format!("    ends: {end}: {reason}\n");
        }
        _ => bail!("{report}    {outcome:?}, expected {:?}", program.ends),
    }
    ensure!(broken == known, "{report}    known: {known:?}");
    for (rule, reason) in program.breaks {
        report += &format!("    {rule}: {reason}\n");
    }
    (program.done)(&mut board).with_context(|| report.clone())?;
    Ok(report)
}

#[test]
#[ignore = "needs the programs that `cargo xtask foreign` builds"]
fn programs_of_others_break_no_rule_without_a_reason() -> Result<()> {
    let mut failed = String::new();
    for program in PROGRAMS {
        match run(program) {
            Ok(report) => println!("{report}"),
            Err(why) => failed += &format!("{why:?}\n"),
        }
    }
    ensure!(failed.is_empty(), "{failed}");
    Ok(())
}
