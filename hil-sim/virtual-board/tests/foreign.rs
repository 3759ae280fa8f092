//! Third-party programs on the virtual board: examples of `stm32g4xx-hal`, and our programs on `embassy-stm32`. They
//! run on chips. Each rule that they break here, and each register that they need and the model does not have, is
//! explained below. `cargo xtask foreign` builds them and runs this.

use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use hil_sim::Config;
use stm32g4_unicorn::periph::gpio::Pad;
use stm32g4_unicorn::rules::Rule;
use virtual_board::{Board, Counting, Image, Options};

/// Environment variable with the folder of the programs.
const FOLDER: &str = "INDUCTION_DRIVE_FOREIGN";

/// Known properties of a program.
struct Program {
    name: &'static str,
    /// Number of periods for which it runs.
    periods: u64,
    /// The rules that it breaks, and the reasons.
    breaks: &'static [(Rule, &'static str)],
    /// The limit of the model, if the program reaches it: part of the error, and the reason.
    ends: Option<(&'static str, &'static str)>,
    /// Checks the work that it must have done.
    done: fn(&mut Board) -> Result<()>,
}

/// The HAL reads and writes PWR without its clock; on a chip reads give values, and the writes have no effect.
const POWER: (Rule, &str) =
    (Rule::ClockGate, "the HAL never switches the clock of PWR on: F1 of this firmware too");
/// embassy-stm32 at 170 MHz with `boost`.
const EMBASSY: &[(Rule, &str)] = &[
    (
        Rule::VoltageRange,
        "stm32-metapac 21.0.0 has R1MODE at bit 0 of PWR_CR5; stm32g4 and the reset value 0x100 say bit 8: no boost",
    ),
    (Rule::Latency, "follows: four wait states are too few for 170 MHz without boost"),
    (Rule::ClockStep, "it switches to the PLL and to the whole bus clock in one write"),
];
const UNMODELLED: &str = "not modelled: this firmware does not use it";

const fn runs(name: &'static str, breaks: &'static [(Rule, &'static str)]) -> Program {
    Program { name, periods: 600, breaks, ends: None, done: |_| Ok(()) }
}

const PROGRAMS: &[Program] = &[
    Program {
        done: |board| is(board.chip().gpio[0].pad(5) != Pad::Analog),
        ..runs("hal-blinky", &[])
    },
    runs("hal-comp", &[]),
    runs("hal-comp_w_dac", &[]),
    runs("hal-dac", &[]),
    runs("hal-independent_watchdog", &[]),
    Program {
        ends: Some((
            "high side a may be on",
            "the clock comes out of PA8, which is a gate on the reference board",
        )),
        ..runs(
            "hal-clockout",
            &[
                POWER,
                (
                    Rule::EnableDelay,
                    "the HAL enables PWR for the backup domain and writes at once: F6 of this firmware too",
                ),
            ],
        )
    },
    Program { ends: Some(("register 0x40010300", UNMODELLED)), ..runs("hal-opamp", &[POWER]) },
    Program { ends: Some(("register 0x40012c28", UNMODELLED)), ..runs("hal-pwm", &[]) },
    runs("hal-adc-one-shot", &[POWER]),
    Program {
        done: |board| is(board.chip().rcc.system_hz() == 170_000_000),
        ..runs("embassy-clock", EMBASSY)
    },
    Program {
        done: |board| is(board.take_console() == "hello from embassy\n"),
        ..runs("embassy-serial", EMBASSY)
    },
    Program { done: |board| is(board.chip().tim1.outputs_on()), ..runs("embassy-pwm", EMBASSY) },
    Program {
        done: |board| {
            let samples = board.image.symbol("SAMPLES")?.address;
            is(board.cpu.word(samples) == Some(u32::from(CODE)))
        },
        ..runs("embassy-adc", EMBASSY)
    },
];

/// ADC counts at all analog pins.
const CODE: u16 = 1234;

fn is(so: bool) -> Result<()> {
    ensure!(so, "it has not done its work");
    Ok(())
}

fn board(name: &str) -> Result<Board> {
    let folder = std::env::var_os(FOLDER).with_context(|| format!("{FOLDER} names no folder"))?;
    let image = Image::open(&PathBuf::from(folder).join(name))?;
    let mut options = Options::new(&Config::default(), 1);
    options.counting = Counting { cycles: false, every_instruction: true };
    let mut board = Board::new(image, options)?;
    board.collect_violations();
    board.chip().adc.inputs = [[CODE; 19]; 2];
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
        report += &format!("    {rule:?}: {reason}\n");
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
