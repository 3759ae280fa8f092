//! First light on the virtual board: a scripted person does with the model what `hil-sim/src/first_light/steps.toml` says, sees and
//! measures what the model shows; and a defect stops the walk at the step that is there for it.

use std::cell::{RefCell, RefMut};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use drive_core::Sample;
use drive_settings::find;
use hil_sim::Error;
use hil_sim::config::LoadMode;
use hil_sim::console::answer::{Meaning, meaning, tagged};
use hil_sim::console::link::{Answer, LinkError};
use hil_sim::first_light::evidence::{Evidence, Verdict};
use hil_sim::first_light::person::Person;
use hil_sim::first_light::table::Table;
use hil_sim::first_light::walk::{Session, Walk};
use hil_sim::first_light::wire::Wire;
use hil_sim::plant::Load;
use induction_drive::board::ADC_FULL_SCALE;
use induction_drive::boards::Level;
use virtual_board::board::Debugger;
use virtual_board::periph::Reset;
use virtual_board::power_stage::{ALL, PowerStage, REFERENCE};
use virtual_board::{Board, Counting, Image, Options, dump};

use crate::common::program::folder;

/// Control periods of a second.
const SECOND: f64 = 6000.0;
/// Longest silence within an answer, and longest wait that is not cut short, s.
const PATIENCE_S: f64 = 8.0;
const WAIT_S: f64 = 4.0;

/// What is wrong with a board or its power stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Defect {
    None,
    RegisterChanged,
    WatchdogResets,
    BootPinFloats,
    DriverPolarity,
    CurrentGain,
    CurrentSign,
    SensorsExchanged,
    Divider,
    NtcOpen,
    NtcShorted,
    BreakNeverTrips,
    BreakAlwaysTrips,
    DeadTime,
    PhasesExchanged,
    PortLost,
    PersonGone,
}
use Defect as D;

/// The bench: a board with everything that the person has at hand.
struct Bench {
    stage: &'static PowerStage,
    board: Board,
    defect: Defect,
    tag: u32,
    partial: String,
    unasked: Vec<String>,
    sent: Vec<String>,
    log: String,
    /// Whether an output was on since the last line, and whether all went off as they had to.
    pulses: bool,
    went_off: bool,
    /// Whether a gate was on while the controller started again.
    on_in_reset: bool,
    crystal_log: bool,
    /// Whether the power stage is.
    connected: bool,
    gone: bool,
}

#[derive(Clone)]
struct Lab(Rc<RefCell<Bench>>);

impl Lab {
    fn new(stage: &'static PowerStage, counting: Counting) -> Result<Self> {
        let mut config = stage.config()?;
        config.load.mode = LoadMode::Free;
        let mut options = Options::on(stage, &config, 12).set_up(&config)?;
        (options.confirmed, options.counting) = (false, counting);
        let mut board = Board::new(Image::built_for(stage.name)?, options)?;
        // Nothing is connected: the chip pulls the break input down.
        board.set_fault_pin(false);
        let mut bench = Bench {
            stage,
            board,
            defect: D::None,
            tag: 0,
            partial: String::new(),
            unasked: Vec::new(),
            sent: Vec::new(),
            log: String::new(),
            pulses: false,
            went_off: false,
            on_in_reset: false,
            crystal_log: false,
            connected: false,
            gone: false,
        };
        bench.starts()?;
        Ok(Self(Rc::new(RefCell::new(bench))))
    }

    fn bench(&self) -> RefMut<'_, Bench> {
        self.0.borrow_mut()
    }
}

impl Bench {
    fn run(&mut self, seconds: f64) -> Result<()> {
        let mut left = (seconds * SECOND) as u64;
        while left > 0 {
            let periods = left.min(120);
            self.board.run_periods(periods)?;
            left -= periods;
            while self.board.next_period().is_some() {}
            self.pulses |= self.board.gates().outputs_on;
        }
        Ok(())
    }

    /// The lines that came since the last call.
    fn lines(&mut self) -> Vec<String> {
        self.partial += &self.board.take_console();
        let rest = self.partial.rfind('\n').map_or(0, |at| at + 1);
        let rest = self.partial.split_off(rest);
        let lines = std::mem::replace(&mut self.partial, rest);
        lines.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
    }

    /// Until the greeting after a reset.
    fn starts(&mut self) -> Result<()> {
        (self.on_in_reset, self.log) = (false, String::new());
        for _ in 0..80 {
            self.run(0.1)?;
            self.on_in_reset |= self.board.gates().any_on();
            let lines = self.lines();
            self.unasked.extend(lines);
            if self.unasked.iter().any(|line| line.contains("last run: ")) {
                self.run(0.3)?;
                self.log = self.board.take_log()?.join("\n");
                return Ok(());
            }
        }
        anyhow::bail!("it does not start: {:?}", self.unasked)
    }

    fn ask(&mut self, line: &str) -> Result<Answer, LinkError> {
        if self.gone {
            return Err(LinkError::Closed);
        }
        println!("{line}");
        self.sent.push(line.to_owned());
        (self.tag, self.pulses) = (self.tag + 1, false);
        self.board.type_line(&tagged(self.tag, line));
        let (mut answer, mut silence) = (Answer::default(), 0.0);
        while silence < PATIENCE_S {
            self.run(0.02).unwrap();
            silence += 0.02;
            let mut ended = false;
            for said in self.lines() {
                silence = 0.0;
                match meaning(self.tag, line, &said) {
                    _ if ended => self.unasked.push(said),
                    Meaning::Answer => answer.lines.push(said),
                    Meaning::Last(rest) => {
                        answer.lines.push(rest.to_owned());
                        ended = true;
                    }
                    _ => self.unasked.push(said),
                }
            }
            if ended {
                return Ok(answer);
            }
        }
        Err(LinkError::Silence(line.to_owned(), PATIENCE_S as u64))
    }

    /// The sensors as they are, with a current through one of them, A.
    fn sensors(&mut self, through: Option<usize>) {
        let (defect, settings) = (self.defect, self.stage.firmware_settings());
        let scales = settings.scales;
        let gains = [scales.current_a, scales.current_b, scales.current_c].map(|line| line.gain);
        let zeros = [scales.current_a, scales.current_b, scales.current_c]
            .map(|line| f64::from(-line.offset / line.gain));
        self.board.disturb = Some(Box::new(move |sample: &mut Sample| {
            let codes = [&mut sample.current_a, &mut sample.current_b, &mut sample.current_c];
            for (n, code) in codes.into_iter().enumerate() {
                let added = if through == Some(n) { 1.0 / f64::from(gains[n]) } else { 0.0 };
                let current = f64::from(*code) - zeros[n] + added;
                let seen = match defect {
                    D::CurrentGain => current * 1.15,
                    D::CurrentSign => -current,
                    _ => current,
                };
                *code = (zeros[n] + seen).clamp(0.0, f64::from(ADC_FULL_SCALE)).round() as u16;
            }
            match defect {
                D::SensorsExchanged => {
                    std::mem::swap(&mut sample.current_a, &mut sample.current_b);
                }
                D::Divider => sample.dc_link = (f64::from(sample.dc_link) * 1.1) as u16,
                D::NtcOpen => sample.heat_sink = 0,
                D::NtcShorted => sample.heat_sink = ADC_FULL_SCALE,
                _ => {}
            }
        }));
    }

    fn set_fault_pin(&mut self, high: bool) {
        match self.defect {
            D::BreakNeverTrips if self.connected => self.board.set_fault_pin(true),
            D::BreakAlwaysTrips => self.board.set_fault_pin(false),
            _ => self.board.set_fault_pin(high),
        }
    }

    /// Does what a step says.
    fn hand(&mut self, what: &str) -> Result<()> {
        let is = |text: &str| what.contains(text);
        println!("DO {what}");
        self.unasked.clear();
        let image = || Image::built_for(self.stage.name);
        if is("cargo xtask flash") || is("flash again") {
            let image = image()?;
            self.board.flash(&image, 50.0)?;
            return self.starts();
        } else if is("unplug the USB cable, wait") || is("plug it in") {
            self.board.unplug();
            self.set_fault_pin(self.connected);
            self.starts()?;
            if self.defect == D::WatchdogResets {
                self.board.hang();
            }
        } else if is("short the crystal") {
            self.board.set_crystal(false);
            self.starts()?;
            self.crystal_log = self.log.contains("the crystal does not start");
        } else if is("take the tweezers away") {
            self.board.set_crystal(true);
            self.board.reset(Reset::Pin);
            self.starts()?;
        } else if is("press the reset button") {
            self.board.reset(Reset::Pin);
            self.starts()?;
        } else if is("hold the reset button") {
            self.connected = true;
            self.set_fault_pin(true);
            self.board.reset(Reset::Pin);
            self.on_in_reset = self.board.gates().any_on();
        } else if is("1 A of a laboratory supply") {
            self.sensors(Some(0));
        } else if is("the same through b") {
            self.sensors(Some(1));
        } else if is("the same through c") {
            self.sensors(Some(2));
        } else if is("take the supply away") {
            self.sensors(None);
        } else if is("10 V at the dc link") {
            self.board.plant.set_dc_link(10.0)?;
        } else if is("warm the heat sink") {
            let warm = self.stage.ntc.code(33.0);
            self.board.plant.set_heat_sink(warm);
        } else if is("while it runs") {
            self.run(0.3)?;
            self.board.run_ticks(7000)?;
            ensure!(self.board.gates().any_on(), "no pulses");
            if is("halt the core") {
                self.board.attach(Debugger::ProbeRs);
                self.board.halt(0.001)?;
                let off = !self.board.gates().any_on();
                self.board.halt(1000.0)?;
                self.went_off = off && !self.board.gates().any_on();
                return Ok(());
            }
            self.set_fault_pin(false);
            self.board.run_ticks(51)?;
            self.went_off = !self.board.gates().any_on();
        } else if is("let the core go") {
            self.board.resume();
            self.board.detach();
            self.starts()?;
        } else if is("pull the fault input") || is("inject a current") {
            self.set_fault_pin(false);
        } else if is("let it go") || is("take it away") {
            self.set_fault_pin(true);
        } else if is("dc link") {
            let volts = what.split(' ').find_map(|word| word.parse().ok()).unwrap_or(0.0);
            self.board.plant.set_dc_link(volts)?;
            if is("at ") {
                // Without a phase no current flows through a sensor: fault 30 comes as without a motor.
                self.board.plant.set_open_phase(Some(0))?;
            }
        } else if is("connect the motor") {
            self.board.plant.set_open_phase(None)?;
        } else if is("lock the shaft") {
            self.board.plant.set_load(Load::Locked)?;
        } else {
            ensure!(is("bench-dump") || is("unplug"), "nobody knows how to {what}");
        }
        self.run(0.3)
    }

    fn see(&mut self, what: &str) -> Result<bool> {
        println!("SEE {what}");
        let is = |text: &str| what.contains(text);
        let rpm = self.board.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
        let rpm = if self.defect == D::PhasesExchanged { -rpm } else { rpm };
        Ok(if is("the log shows") {
            let expected = what.split('`').skip(1).step_by(2);
            let expected: Vec<_> = expected.filter(|text| !self.log.contains(text)).collect();
            ensure!(expected.is_empty(), "no {expected:?} in {}", self.log);
            !self.log.contains("ERROR")
        } else if is("every register") {
            self.registers()?
        } else if is("the crystal does not start") {
            self.crystal_log
        } else if is("high sides go on") {
            let wrong = self.defect == D::DriverPolarity;
            let level = |on_at_high: bool| if on_at_high { "high" } else { "low" };
            let driver = self.stage.driver;
            let [high, low] = [driver.high, driver.low].map(|input| level(input.on_at_high != wrong));
            is(&format!("high sides go on at {high}, low sides at {low},"))
        } else if is("every driver input at the level that is off") {
            let (board, driver) = (self.stage.board(), self.stage.driver);
            let sides = [(board.high, driver.high), (board.low, driver.low)];
            let off = |on_at: Level| Some(on_at == Level::Low);
            !self.on_in_reset && sides.iter().all(|(pin, input)| input.level(None) == off(pin.on_at.value))
        } else if is("all six off within") {
            self.went_off
        } else if is("pulses of 6 kHz") || is("never on together") {
            // The board fails the run for two switches of a leg that are on.
            self.pulses
        } else if is("forwards") {
            (30.0..90.0).contains(&rpm)
        } else if is("backwards") {
            (-90.0..-30.0).contains(&rpm)
        } else if is("a steady current") {
            self.board.plant.current().norm() > 0.1
        } else if is("off") {
            !self.on_in_reset
        } else {
            is("assumed")
        })
    }

    /// Compares the registers with those of a board that nobody has touched.
    fn registers(&mut self) -> Result<bool> {
        let image = Image::built_for(self.stage.name)?;
        if self.defect == D::RegisterChanged {
            // The counter's top, as of another frequency.
            let old = self.board.chip().read(0x4001_2c2c, 4);
            self.board.chip().write(0x4001_2c2c, 4, old - 1);
        }
        for ((name, address, mask), line) in
            dump::registers()?.into_iter().zip(dump::lines(image, self.stage)?)
        {
            let value = self.board.chip().read(address, 4) & mask;
            let expected = line.split(' ').nth(2).context("a value")?;
            if format!("{value:08x}") != expected {
                println!("{name}: {value:08x}, not {expected}");
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn measure(&mut self, what: &str) -> Result<f64> {
        println!("MEASURE {what}");
        Ok(match what {
            "PB8 to ground" if self.defect == D::BootPinFloats => 1e6,
            "PB8 to ground" => 10.0,
            what if what.starts_with("dead time") => {
                let short = if self.defect == D::DeadTime { 1.0 } else { 0.0 };
                // What the timer makes is never shorter than the value of the file, but for its rounding to single precision.
                f64::from(self.board.gates().dead_time) / 170.0 + 1e-4 - short
            }
            key => {
                let motor = self.stage.config()?.drive;
                find(key).context("a setting")?.get(&motor).to_string().parse()?
            }
        })
    }
}

impl Wire for Lab {
    fn ask(&mut self, line: &str) -> Result<Answer, LinkError> {
        self.bench().ask(line)
    }

    fn wait(&mut self, seconds: f64) {
        self.bench().run(seconds.min(WAIT_S)).unwrap();
    }

    fn unasked(&mut self) -> Vec<String> {
        let mut bench = self.bench();
        let lines = bench.lines();
        bench.unasked.extend(lines);
        std::mem::take(&mut bench.unasked)
    }

    fn reopen(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

impl Person for Lab {
    fn tell(&mut self, text: &str) {
        println!("{text}");
    }

    fn hand(&mut self, what: &str) -> Option<()> {
        self.bench().hand(what).unwrap();
        Some(())
    }

    fn see(&mut self, what: &str) -> Option<bool> {
        let mut bench = self.bench();
        let turning = what.contains("the shaft turns forwards");
        if turning && bench.defect == D::PersonGone {
            return None;
        }
        bench.gone = turning && bench.defect == D::PortLost;
        Some(bench.see(what).unwrap())
    }

    fn measure(&mut self, what: &str, _: &str) -> Option<f64> {
        Some(self.bench().measure(what).unwrap())
    }
}

fn session(file: PathBuf) -> Session {
    let bench = "emulated: virtual board, simulated motor, scripted person".to_owned();
    Session { file: Some(file), bench, board: None, skip: true, interrupted: Arc::default() }
}

/// Every step of the table, learning and trace left out.
fn whole(stage: &'static PowerStage, counting: Counting) -> Result<()> {
    let table = Table::read()?;
    let file = folder(&format!("first-light-{}", stage.name)).join("evidence.toml");
    let lab = Lab::new(stage, counting)?;
    Walk::new(&table, lab.clone(), lab.clone(), session(file.clone()))?.run()?;
    let evidence = Evidence::open(&file)?.context("a file")?;
    for (_, step) in table.steps() {
        let expected = if step.optional { Verdict::Skipped } else { Verdict::Passed };
        ensure!(evidence.verdict(&step.name) == Some(expected), "{}", step.name);
    }
    ensure!(!lab.bench().board.gates().any_on());
    println!("{} s emulated", lab.bench().board.time());
    Ok(())
}

#[test]
fn every_step_on_the_reference_board() -> Result<()> {
    whole(&REFERENCE, Counting { cycles: true, every_instruction: false })
}

#[test]
fn every_step_with_shunts_at_low_voltage() -> Result<()> {
    whole(ALL[1], Counting::default())
}

#[test]
fn every_step_with_shunts_at_high_voltage() -> Result<()> {
    whole(ALL[2], Counting::default())
}
