//! Records runs of the board: `tests/recorded/NAME.samples` and `NAME.orders`, which `tests/replay/` feeds to a host
//! drive; see the README there.

use std::fs;
use std::path::Path;

use crate::common::pair::Pair;
use anyhow::Result;
use drive_core::{Hardware, State};
use hil_sim::{Config, config::LoadMode};
use virtual_board::{Image, Options, Period};

/// A typed line, the state to wait for, and the periods that follow.
type Step = (&'static str, Option<State>, u64);

const SENSORLESS: [Step; 10] = [
    ("start torque", Some(State::Torque), 0),
    ("torque 1", None, 6600),
    ("torque 1.25", None, 6600),
    ("torque 1.5", None, 6600),
    ("torque 1.75", None, 6600),
    ("torque 2", None, 6600),
    ("torque -1", None, 6600),
    ("torque -2", None, 6600),
    ("torque 0.5", None, 6600),
    ("stop", Some(State::Off), 600),
];

const ENCODER: [Step; 5] = [
    ("set angle_source encoder motor.r_r 1.3", None, 0),
    ("start position", Some(State::Position), 0),
    ("position 1", None, 6000),
    ("position -0.5", None, 6000),
    ("stop", Some(State::Off), 0),
];

/// The samples of consecutive interrupts, and the requests that the drive took between them.
#[derive(Default)]
struct Record {
    samples: Vec<u8>,
    orders: String,
    interrupts: u64,
    /// Requests that were given but not taken yet.
    given: Vec<String>,
}

impl Record {
    fn take(&mut self, period: &Period) {
        let s = &period.sample;
        // The self-test of the break raises its event before a start. The replay does without: its drive is not stopped by it.
        let (events, interrupt) = (s.hardware, self.interrupts);
        assert!(Hardware::BREAK.contains(events), "{events:?} in interrupt {interrupt}");
        for code in [s.current_a, s.current_b, s.dc_link, s.heat_sink] {
            self.samples.extend(code.to_le_bytes());
        }
        self.samples.extend(s.encoder.to_le_bytes());
        if period.took_order {
            self.orders += &format!("{} {}\n", self.interrupts, self.given.remove(0));
        }
        self.interrupts += 1;
    }
}

fn record(name: &str, config: &Config, seed: u64, steps: &[Step]) -> Result<()> {
    let mut pair = Pair::new(Image::built()?, Options::new(config, seed))?;
    let mut record = Record::default();
    for (line, state, periods) in steps {
        if line.starts_with("start") && !pair.shadow.firmware_settings().command.wiring_checked {
            record.given.push("check wiring".into());
        }
        record.given.push((*line).into());
        pair.board.take_console();
        pair.board.type_line(line);
        pair.shadow.type_line(line);
        let mut run = |pair: &mut Pair, periods| pair.run(periods, |_, period| record.take(period));
        let mut answer = String::new();
        while !answer.ends_with('\n') {
            run(&mut pair, 1)?;
            answer += &pair.board.take_console();
        }
        println!("{name}: {line}: {}", answer.trim());
        while state.is_some_and(|state| pair.shadow.drive.state() != state) {
            run(&mut pair, 1)?;
        }
        run(&mut pair, *periods)?;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/recorded");
    fs::write(folder.join(format!("{name}.samples")), &record.samples)?;
    fs::write(folder.join(format!("{name}.orders")), &record.orders)?;
    println!("{name}: {} interrupts", record.interrupts);
    Ok(())
}

/// After `cargo firmware`, with the path that it prints in `INDUCTION_DRIVE_ELF`: `cargo test --release --test image
/// records_the_runs -- --ignored` in `hil-sim/virtual-board`.
#[test]
#[ignore = "writes the files of the replays anew"]
fn records_the_runs_of_the_replays() -> Result<()> {
    record("sensorless", &Config::default(), 11, &SENSORLESS)?;
    let mut free = Config::default();
    free.load.mode = LoadMode::Free;
    record("encoder", &free, 12, &ENCODER)
}
