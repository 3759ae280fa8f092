//! First power-up, step by step: the lines of `docs/first-power-up.md` on a board that nobody has confirmed. The words in code
//! of its column "do" are typed as they stand there, and those of "expect" must come.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};
use drive_core::Sample;
use drive_settings::{SETTINGS, find};
use hil_sim::config::LoadMode;
use induction_drive::board::ADC_FULL_SCALE;
use virtual_board::board::Debugger;
use virtual_board::periph::Reset;
use virtual_board::power_stage::{ALL, PowerStage};
use virtual_board::{Board, Image, Options};

const PAGE: &str = include_str!("../../../docs/first-power-up.md");

/// Control periods of a second.
const SECOND: u64 = 6000;

/// What stands in code in a cell.
fn code(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The cells of the page's rows whose first cell `takes`.
fn rows(takes: impl Fn(&str) -> bool) -> impl Iterator<Item = Vec<&'static str>> {
    let cells = |line: &'static str| line.split('|').skip(1).map(str::trim).collect::<Vec<_>>();
    PAGE.lines().map(cells).filter(move |cells| cells.first().is_some_and(|first| takes(first)))
}

/// Steps by number: what to type and what to hear.
type Steps = BTreeMap<u32, (Vec<String>, Vec<String>)>;

/// A board on the way through the page.
struct Bench {
    stage: &'static PowerStage,
    board: Board,
    steps: Steps,
    /// LOW, NOMINAL, no trip, TRIP, V.
    volts: [f64; 4],
}

impl Bench {
    fn new(stage: &'static PowerStage) -> Result<Self> {
        let mut config = stage.config()?;
        config.load.mode = LoadMode::Free;
        let mut options = Options::on(stage, &config, 12).set_up(&config)?;
        options.confirmed = false;
        let board = Board::new(Image::built_for(stage.name)?, options)?;
        let values = rows(|first| first == stage.name).next().context("no values of the board")?;
        let value = |n: usize| values[n].parse::<f64>().with_context(|| values[n].to_owned());
        let volts = [value(1)?, value(2)?, value(3)?, value(4)?];
        let steps = rows(|first| first.parse::<u32>().is_ok()).map(|cells| {
            let lines = code(cells[1]).into_iter().filter(|line| !line.starts_with("cargo "));
            let [low, nominal, ..] = volts.map(|v| v.to_string());
            let lines = lines.map(|line| line.replace("LOW", &low).replace("NOMINAL", &nominal));
            (cells[0].parse().unwrap(), (lines.collect(), code(cells[2])))
        });
        let steps = steps.collect();
        Ok(Self { stage, board, steps, volts })
    }

    fn run(&mut self, seconds: f64) -> Result<()> {
        self.board.run_periods((seconds * SECOND as f64) as u64)?;
        while self.board.next_period().is_some() {}
        Ok(())
    }

    /// What console and log have said since the last time.
    fn heard(&mut self) -> Result<String> {
        Ok(self.board.take_console() + &self.board.take_log()?.join("\n") + "\n")
    }

    /// Types the next line of a step; what is said within this time.
    fn line(&mut self, step: u32, seconds: f64) -> Result<String> {
        let (lines, _) = self.steps.get_mut(&step).context("no such step")?;
        ensure!(!lines.is_empty(), "step {step} has no more lines");
        let line = lines.remove(0);
        self.board.type_line(&line);
        self.run(seconds)?;
        let heard = self.heard()?;
        println!("{step}: {line}\n{heard}");
        Ok(heard)
    }

    /// Ends a step: all its lines were typed, and all that it expects was heard.
    fn done(&mut self, step: u32, heard: &str) -> Result<()> {
        let (lines, expected) = self.steps.remove(&step).context("no such step")?;
        ensure!(lines.is_empty(), "step {step}: not typed: {lines:?}");
        for text in expected {
            ensure!(heard.contains(&text), "step {step}: no {text:?} in {heard}");
        }
        Ok(())
    }

    /// A step that is one line.
    fn step(&mut self, step: u32, seconds: f64) -> Result<String> {
        let heard = self.line(step, seconds)?;
        self.done(step, &heard)?;
        Ok(heard)
    }

    fn is_off(&mut self) -> Result<()> {
        ensure!(!self.board.gates().any_on(), "a gate is on after {:.3} s", self.board.time());
        Ok(())
    }

    /// Starts, and stops in the midst of pulses; what was said.
    fn pulses(&mut self, step: u32) -> Result<String> {
        let heard = self.line(step, 0.3)?;
        self.board.run_ticks(7000)?;
        ensure!(self.board.gates().any_on(), "step {step}: no pulses");
        Ok(heard)
    }

    /// Waits until the console answers after a reset.
    fn starts(&mut self) -> Result<String> {
        // Console and log apart: either may stop within a line.
        let (mut console, mut log) = (String::new(), String::new());
        for _ in 0..60 {
            self.run(0.1)?;
            self.is_off()?;
            console += &self.board.take_console();
            log += &(self.board.take_log()?.join("\n") + "\n");
            if console.contains("last run: ") {
                self.run(0.3)?;
                return Ok(console + &log + &self.heard()?);
            }
        }
        anyhow::bail!("it does not start: {console}")
    }
}

/// The number before a text in a status line.
fn word_before(status: &str, text: &str) -> f64 {
    let (head, _) = status.split_once(text).unwrap_or_else(|| panic!("{text:?}: {status}"));
    let word = head.rsplit(' ').next();
    word.and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{text:?}: {status}"))
}

/// The number between two texts in a status line.
fn number(status: &str, before: &str, after: &str) -> f64 {
    let from = status.find(before).unwrap_or_else(|| panic!("{before:?}: {status}")) + before.len();
    let to = status[from..].find(after).unwrap_or_else(|| panic!("{after:?}: {status}"));
    status[from..from + to].trim().parse().unwrap_or_else(|_| panic!("{before:?}: {status}"))
}

fn controller(bench: &mut Bench) -> Result<()> {
    // No power stage: the chip pulls the break input down.
    bench.board.set_fault_pin(false);
    let heard = bench.starts()?;
    bench.done(1, &heard)?;
    ensure!(!heard.contains("ERROR"), "{heard}");
    // `cargo xtask bench-dump` compares a chip with this board.
    bench.done(2, "")?;
    let heard = bench.step(3, 0.3)?;
    ensure!(!heard.contains("not started"), "{heard}");
    bench.step(4, 0.3)?;
    bench.board.unplug();
    bench.board.set_fault_pin(false);
    bench.starts()?;
    bench.run(2.0)?;
    bench.step(5, 0.3)?;
    // As often as it says on one board; the flash is that of the chip.
    for _ in 0..if bench.stage.name == ALL[0].name { 99 } else { 3 } {
        bench.board.type_line("save");
        let mut heard = String::new();
        while heard.trim().is_empty() {
            bench.run(0.02)?;
            heard += &bench.heard()?;
        }
        ensure!(heard.trim() == "ok", "{heard}");
    }
    bench.step(6, 0.3)?;
    ensure!(bench.board.resets.len() == 1, "{:?}", bench.board.resets);
    let status = bench.step(7, 0.3)?;
    ensure!(word_before(&status, " cycles, ") < 3700.0, "{status}");
    ensure!(number(&status, "latest start ", " us") < 10.0, "{status}");
    bench.board.set_crystal(false);
    let heard = bench.starts()?;
    let heard = heard + &bench.line(8, 0.3)?;
    bench.done(8, &heard)?;
    bench.board.set_crystal(true);
    bench.board.reset(Reset::Pin);
    bench.starts().map(|_| ())
}

fn drivers(bench: &mut Bench) -> Result<()> {
    bench.board.set_fault_pin(true);
    bench.board.reset(Reset::Pin);
    bench.is_off()?;
    bench.done(9, "advice of board")?;
    let image = Image::built_for(bench.stage.name)?;
    bench.board.flash(&image, 50.0)?;
    bench.done(10, "")?;
    bench.starts()?;
    bench.done(11, "")?;
    // By hand; `boards.rs` holds the polarities of the model's drivers against those of the board.
    bench.done(12, "board")
}

fn measurements(bench: &mut Bench) -> Result<()> {
    let settings = bench.stage.firmware_settings();
    let lines = [settings.scales.current_a, settings.scales.current_b, settings.scales.current_c];
    let trace = bench.step(13, 1.5)?;
    for (n, line) in lines[..2].iter().enumerate() {
        let values = trace.lines().filter_map(|l| l.split(',').nth(n + 1)?.parse::<f64>().ok());
        let values: Vec<f64> = values.collect();
        ensure!(values.len() == 256, "{} records", values.len());
        let mean = values.iter().sum::<f64>() / 256.0;
        let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 256.0;
        let gain = f64::from(line.gain.abs());
        let range = gain * f64::from(ADC_FULL_SCALE) / 2.0;
        ensure!(square.sqrt() < 4.0 * gain && mean.abs() < 0.05 * range, "{mean} {square}");
    }
    bench.step_14(&lines)?;
    bench.board.plant.set_dc_link(10.0)?;
    bench.run(0.2)?;
    let volts = number(&bench.step(15, 0.3)?, "dc link ", " V");
    ensure!((volts - 10.0).abs() < 0.3, "{volts} V");
    let warm = bench.stage.ntc.code(31.0);
    bench.board.plant.set_heat_sink(warm);
    bench.run(0.2)?;
    let celsius = number(&bench.step(16, 0.3)?, "heat sink ", " degC");
    ensure!((celsius - 31.0).abs() < 1.5, "{celsius} degC");
    for step in [17, 18] {
        bench.board.set_fault_pin(false);
        bench.run(0.3)?;
        bench.step(step, 0.3)?;
        bench.board.set_fault_pin(true);
        bench.run(0.3)?;
        bench.board.type_line("status");
        bench.run(0.3)?;
        ensure!(!bench.heard()?.contains("fault input trips"));
    }
    let [_, nominal, below, trip] = bench.volts;
    bench.board.plant.set_dc_link(below)?;
    bench.run(0.3)?;
    bench.board.type_line("status");
    bench.run(0.3)?;
    ensure!(!bench.heard()?.contains("fault input trips"), "at {below} V");
    bench.board.plant.set_dc_link(trip)?;
    bench.run(0.3)?;
    bench.step(19, 0.3)?;
    bench.board.plant.set_dc_link(nominal)?;
    bench.nameplate()?;
    bench.step(21, 1.0)?;
    bench.is_off()?;
    let heard = bench.step(22, 0.3)?;
    ensure!(!heard.contains("error"), "{heard}");
    Ok(())
}

impl Bench {
    /// The nameplate of the motor that is simulated.
    fn nameplate(&mut self) -> Result<()> {
        let motor = self.stage.config()?.drive;
        let plate = SETTINGS.iter().filter(|entry| entry.name.starts_with("nameplate."));
        for entry in plate.chain(find("motor.pole_pairs")) {
            self.board.type_line(&format!("set {} {}", entry.name, entry.get(&motor)));
            self.run(0.1)?;
            let heard = self.heard()?;
            ensure!(heard.starts_with("ok"), "{}: {heard}", entry.name);
        }
        self.step(20, 6.0).map(|_| ())
    }

    /// A laboratory supply at each sensor in turn.
    fn step_14(&mut self, lines: &[drive_core::Line; 3]) -> Result<()> {
        let sensors = if self.stage.board().currents.shunts.is_some() { 3 } else { 2 };
        let typed = self.steps[&14].0[0].clone();
        let mut heard = String::new();
        for (n, name) in ["a ", "b ", "c "].into_iter().enumerate().take(sensors) {
            let codes = (1.0 / lines[n].gain).round() as i32;
            self.board.disturb = Some(Box::new(move |sample: &mut Sample| {
                let codes_of =
                    [&mut sample.current_a, &mut sample.current_b, &mut sample.current_c];
                for (i, code) in codes_of.into_iter().enumerate() {
                    *code = (i32::from(*code) + if i == n { codes } else { 0 }) as u16;
                }
            }));
            self.run(0.2)?;
            self.board.type_line(&typed);
            self.run(0.3)?;
            heard = self.heard()?;
            let shown = &heard[heard.find("sensors ").context("no sensors")?..];
            let amperes = number(shown, name, " A");
            let allowed = 0.03 + 4.0 * f64::from(lines[n].gain.abs());
            ensure!((amperes - 1.0).abs() < allowed, "sensor {name}: {heard}");
        }
        self.board.disturb = None;
        self.steps.get_mut(&14).context("no step")?.0.clear();
        self.done(14, &heard)
    }
}

fn gate_signals(bench: &mut Bench) -> Result<()> {
    let [low, ..] = bench.volts;
    bench.board.plant.set_dc_link(low)?;
    // Without a phase no current flows through a sensor: fault 30 comes as without a motor.
    bench.board.plant.set_open_phase(Some(0))?;
    bench.line(23, 0.3)?;
    let heard = bench.line(23, 6.0)?;
    bench.done(23, &heard)?;
    let heard = bench.pulses(24)?;
    // The board fails the run for two switches of a leg that are on, and for a shorter dead time than the stage needs.
    let us = f64::from(bench.board.gates().dead_time) / 170.0;
    let own = f64::from(bench.stage.board().dead_time_s.value) * 1e6;
    ensure!((0.0..0.1).contains(&(us - own + 1e-3)), "dead time {us} us of {own} us");
    bench.done(25, "")?;
    bench.run(1.0)?;
    bench.is_off()?;
    let heard = heard + &bench.heard()? + &bench.line(24, 0.3)?;
    bench.done(24, &heard)?;

    bench.pulses(26)?;
    bench.board.attach(Debugger::ProbeRs);
    bench.board.halt(0.001)?;
    bench.is_off()?;
    bench.board.halt(1000.0)?;
    bench.is_off()?;
    bench.board.resume();
    bench.board.detach();
    bench.done(26, "")?;
    bench.starts()?;

    bench.pulses(27)?;
    bench.board.set_fault_pin(false);
    bench.board.run_ticks(51)?;
    bench.is_off()?;
    bench.run(0.3)?;
    bench.board.set_fault_pin(true);
    bench.run(0.3)?;
    let heard = bench.heard()?;
    let heard = heard + &bench.line(27, 0.3)?;
    bench.done(27, &heard)
}

fn power_stage(bench: &mut Bench) -> Result<()> {
    bench.board.plant.set_open_phase(None)?;
    let rpm = |bench: &Bench| bench.board.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
    bench.step(28, 3.0)?;
    let heard = bench.line(29, 3.0)?;
    ensure!((30.0..90.0).contains(&rpm(bench)), "{} rpm", rpm(bench));
    let status = heard + &bench.line(29, 0.3)?;
    ensure!(word_before(&status, " cycles, ") < 12_000.0, "{status}");
    ensure!(word_before(&status, " with a command") < 12_000.0, "{status}");
    bench.done(29, &status)?;
    bench.step(30, 4.0)?;
    ensure!((-90.0..-30.0).contains(&rpm(bench)), "{} rpm", rpm(bench));
    bench.step(31, 3.0)?;
    bench.is_off()?;
    bench.line(32, 0.3)?;
    let saved = bench.line(32, 6.0)?;
    bench.line(32, 0.3)?;
    bench.done(32, &saved)?;
    bench.starts()?;
    bench.board.plant.set_dc_link(bench.volts[1])?;
    bench.done(33, "")
}

#[test]
fn every_line_of_the_page_can_be_followed() -> Result<()> {
    for stage in ALL {
        let mut bench = Bench::new(stage)?;
        controller(&mut bench)?;
        drivers(&mut bench)?;
        measurements(&mut bench)?;
        gate_signals(&mut bench)?;
        power_stage(&mut bench)?;
        ensure!(bench.steps.is_empty(), "steps that nobody did: {:?}", bench.steps.keys());
    }
    Ok(())
}
