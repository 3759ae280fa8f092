//! First power-up on the virtual board: a scripted person does with the model what `hil-sim/src/first_light/steps.toml`
//! says, and sees and measures what the model shows. A defect stops the walk at the step that is intended for it.

use std::cell::{RefCell, RefMut};
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, ensure};
use drive_core::Sample;
use drive_settings::find;
use drive_stream::client::{Answer, Client, Event};
use hil_sim::Error;
use hil_sim::config::LoadMode;
use hil_sim::console::link::LinkError;
use hil_sim::first_light::Options as Light;
use hil_sim::first_light::evidence::{Evidence, Record, SCHEMA, Verdict};
use hil_sim::first_light::person::Person;
use hil_sim::first_light::table::Table;
use hil_sim::first_light::walk::Walk;
use hil_sim::first_light::wire::{Port, Wire};
use hil_sim::plant::Load;
use induction_drive::board::{ADC_FULL_SCALE, protection};
use induction_drive::boards::Level;
use stm32g4_unicorn::periph::Reset;
use virtual_board::board::{Debugger, snapshot::Snapshot};
use virtual_board::power_stage::{ALL, PowerStage, REFERENCE};
use virtual_board::{Board, Counting, Image, Options};

use crate::common::dump;

use crate::common::program::{Running, command, folder};

/// Number of control periods per second.
const SECOND: f64 = 6000.0;
/// Longest wait for the next line of an answer, and longest wait that is not cut short, s.
const PATIENCE_S: f64 = 8.0;
const WAIT_S: f64 = 4.0;

/// A defect of a board or its power stage.
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
    client: Client,
    unasked: Vec<String>,
    sent: Vec<String>,
    log: String,
    /// Whether an output was on since the last line, and whether all went off as required.
    pulses: bool,
    went_off: bool,
    /// Whether a gate was on while the controller restarted.
    on_in_reset: bool,
    crystal_log: bool,
    /// Whether the power stage is connected.
    connected: bool,
    motor: bool,
    /// Number of periods since the last sign of life.
    silent: u64,
    gone: bool,
}

#[derive(Clone)]
struct Lab(Rc<RefCell<Bench>>);

impl Lab {
    /// Makes a board with a defect; its power stage may be connected, and then it is confirmed.
    fn new(
        stage: &'static PowerStage,
        defect: Defect,
        connected: bool,
        confirmed: bool,
        counting: Counting,
    ) -> Result<Self> {
        let mut config = stage.config()?;
        config.load.mode = LoadMode::Free;
        let mut options = Options::on(stage, &config, 12).set_up(&config)?;
        (options.confirmed, options.counting) = (confirmed, counting);
        let board = Board::new(Image::built_for(stage.name)?, options)?;
        let mut bench = Bench {
            stage,
            board,
            defect,
            client: Client::default(),
            unasked: Vec::new(),
            sent: Vec::new(),
            log: String::new(),
            pulses: false,
            went_off: false,
            on_in_reset: false,
            crystal_log: false,
            connected,
            motor: false,
            silent: 0,
            gone: false,
        };
        // If nothing is connected, the chip pulls the break input down.
        bench.set_fault_pin(connected);
        bench.sensors(None);
        bench.starts()?;
        Ok(Self(Rc::new(RefCell::new(bench))))
    }

    fn bench(&self) -> RefMut<'_, Bench> {
        self.0.borrow_mut()
    }

    /// Restores the board to its state after the start, with this defect.
    fn again(&self, started: &Snapshot, defect: Defect) -> Result<()> {
        let mut bench = self.bench();
        bench.board.go_back(started)?;
        (bench.defect, bench.gone) = (defect, false);
        bench.sent.clear();
        bench.unasked.clear();
        let connected = bench.connected;
        bench.set_fault_pin(connected);
        bench.sensors(None);
        Ok(())
    }
}

impl Bench {
    fn run(&mut self, seconds: f64) -> Result<()> {
        let mut left = (seconds * SECOND) as u64;
        while left > 0 {
            let periods = left.min(120);
            self.board.run_periods(periods)?;
            // The signs of life of `Port`.
            self.silent += periods;
            if self.silent > 2400 && !self.gone {
                self.silent = 0;
                self.board.send(b"\n");
            }
            left -= periods;
            while self.board.next_period().is_some() {}
            self.pulses |= self.board.gates().outputs_on;
        }
        Ok(())
    }

    /// Keeps the lines that answer nothing; returns what belongs to the awaited answer.
    fn hear(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        for event in self.board.take_console().bytes().filter_map(|byte| self.client.push(byte)) {
            match event {
                Event::Unasked(line) => self.unasked.push(line),
                event => events.push(event),
            }
        }
        events
    }

    /// Runs until the greeting after a reset.
    fn starts(&mut self) -> Result<()> {
        (self.on_in_reset, self.log) = (false, String::new());
        for _ in 0..80 {
            self.run(0.1)?;
            self.on_in_reset |= self.board.gates().any_on();
            self.hear();
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
        self.pulses = false;
        self.board.send(self.client.ask(line).as_bytes());
        let mut silence = 0.0;
        while silence < PATIENCE_S {
            self.run(0.02).unwrap();
            silence += 0.02;
            for event in self.hear() {
                silence = 0.0;
                if let Event::Answer(answer) = event {
                    return Ok(answer);
                }
            }
        }
        Err(LinkError::Silence(line.to_owned(), PATIENCE_S as u64))
    }

    /// Sets the sensors to their present state, with a current through one of them, A.
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
        } else if is("or shunt a") {
            self.sensors(Some(0));
        } else if is("the same through b") {
            self.sensors(Some(1));
        } else if is("or shunt c") {
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
            if !self.motor {
                // With phase a open no current flows through a sensor, so fault 30 comes as without a motor.
                self.board.plant.set_open_phase(Some(0))?;
            }
        } else if is("connect the motor") {
            self.motor = true;
            self.board.plant.set_open_phase(None)?;
        } else if is("bring the shaft to rest") {
            self.board.plant.set_load(Load::Locked)?;
            self.run(0.3)?;
            self.board.plant.set_load(Load::Free { torque: 0.0 })?;
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
        // Mean over a second: with V/f control a shaft without a load oscillates, on one board between 68 and 128 rpm at 60.
        let from = self.board.plant.mechanical_angle();
        if is("forwards") || is("backwards") {
            self.run(1.0)?;
        }
        let rpm = (self.board.plant.mechanical_angle() - from) * 30.0 / std::f64::consts::PI;
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
            let [high, low] =
                [driver.high, driver.low].map(|input| level(input.on_at_high != wrong));
            is(&format!("high sides go on at {high}, low sides at {low},"))
        } else if is("every driver input at the level that is off") {
            let (board, driver) = (self.stage.board(), self.stage.driver);
            let sides = [(board.high, driver.high), (board.low, driver.low)];
            let off = |on_at: Level| Some(on_at == Level::Low);
            !self.on_in_reset
                && sides.iter().all(|(pin, input)| input.level(None) == off(pin.on_at.value))
        } else if is("all six off within") {
            self.went_off
        } else if is("pulses of 6 kHz") || is("never on together") {
            // The board fails the run if two switches of a leg are on.
            self.pulses
        } else if is("forwards") {
            (30.0..150.0).contains(&rpm)
        } else if is("backwards") {
            (-150.0..-30.0).contains(&rpm)
        } else if is("a steady current") {
            self.board.plant.current().norm() > 0.1
        } else if is("off") {
            !self.on_in_reset
        } else {
            is("assumed")
        })
    }

    /// Compares the registers with those of an untouched board.
    fn registers(&mut self) -> Result<bool> {
        let image = Image::built_for(self.stage.name)?;
        if self.defect == D::RegisterChanged {
            // The counter's top, as for another frequency.
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
                // The dead time of the timer is never shorter than the value of the file, except for its rounding to single precision.
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
        bench.hear();
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

fn options(file: &Path) -> Light {
    let bench = "emulated: virtual board, simulated motor, scripted person".to_owned();
    let (port, evidence) = (String::new(), file.to_owned());
    Light { port, baud: 0, board: None, evidence, bench, skip_learning: true }
}

/// Returns a walk of a lab.
fn walk<'a>(table: &'a Table, lab: &Lab, options: Light) -> Result<Walk<'a, Lab, Lab>, Error> {
    Walk::new(table, (lab.clone(), lab.clone()), options, Arc::default())
}

/// Walks through every step of the table; with `skip` it leaves out saliency self-commissioning and trace.
fn whole(skip: bool) -> Result<PathBuf> {
    let table = Table::read()?;
    let file = folder(&format!("first-light-{skip}")).join("evidence.toml");
    let counting = Counting { cycles: true, every_instruction: false };
    let lab = Lab::new(&REFERENCE, D::None, false, false, counting)?;
    walk(&table, &lab, Light { skip_learning: skip, ..options(&file) })?.run()?;
    let evidence = Evidence::open(&file)?.context("a file")?;
    ensure!(table.next(&evidence)?.is_none());
    let skipped = evidence.verdict("learn") == Some(Verdict::Skipped);
    ensure!(skipped == skip && evidence.verdict("forwards") == Some(Verdict::Passed));
    let mut bench = lab.bench();
    ensure!(!bench.board.gates().any_on());
    println!("{} s emulated", bench.board.time());
    Ok(file)
}

#[test]
fn every_step_on_the_reference_board() -> Result<()> {
    whole(true).map(|_| ())
}

/// Starts at the step that connects the power stage: the steps before it concern the controller, which is that of the reference board.
fn every_step_of_the_power_stage(stage: &'static PowerStage) -> Result<()> {
    let begun = Begun::at(stage, "noise")?;
    walk(&begun.table, &begun.lab, options(&begun.file))?.run()?;
    let evidence = Evidence::open(&begun.file)?.context("a file")?;
    ensure!(begun.table.next(&evidence)?.is_none());
    ensure!(evidence.verdict("commission") == Some(Verdict::Passed));
    ensure!(!begun.lab.bench().board.gates().any_on());
    Ok(())
}

#[test]
fn every_step_with_shunts_at_low_voltage() -> Result<()> {
    every_step_of_the_power_stage(ALL[1])
}

#[test]
#[ignore = "long; cargo xtask prove image"]
fn every_step_with_shunts_at_high_voltage() -> Result<()> {
    every_step_of_the_power_stage(ALL[2])
}

/// Includes saliency self-commissioning and trace, which take minutes; writes the contributed file of the emulated board.
#[test]
#[ignore = "learning takes minutes; writes docs/evidence/emulated-reference.toml"]
fn the_evidence_of_the_emulated_board() -> Result<()> {
    // An unfinished file of a previous run is continued, with a confirmed board.
    let file = match std::env::var_os("UNFINISHED") {
        None => whole(false)?,
        Some(file) => {
            let lab = Lab::new(&REFERENCE, D::None, true, true, Counting::default())?;
            let light = Light { skip_learning: false, ..options(Path::new(&file)) };
            walk(&Table::read()?, &lab, light)?.run()?;
            file.into()
        }
    };
    let evidence =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/evidence/emulated-reference.toml");
    std::fs::copy(file, evidence)?;
    Ok(())
}

/// A board with a defect at a step; the steps before it are passed in the file of the test record.
struct Begun {
    table: Table,
    lab: Lab,
    file: PathBuf,
}

impl Begun {
    fn at(stage: &'static PowerStage, step: &str) -> Result<Self> {
        let table = Table::read()?;
        let place = |name: &str| table.steps().position(|(_, step)| step.name == name);
        let [first, connected, confirmed] = [step, "noise", "low-voltage"].map(place);
        let (connected, confirmed) = (first >= connected, first >= confirmed);
        let lab = Lab::new(stage, D::None, connected, confirmed, Counting::default())?;
        Self::with(lab, step)
    }

    /// Makes the same with a board that has started.
    fn with(lab: Lab, step: &str) -> Result<Self> {
        let table = Table::read()?;
        let bench = lab.bench();
        // Tests of one step and defect run at the same time.
        let test = std::thread::current().name().unwrap_or("unnamed").replace("::", "-");
        let name = format!("{test}-{}-{:?}-{step}", bench.stage.name, bench.defect);
        drop(bench);
        let file = folder(&name).join("evidence.toml");
        let mut evidence = walk(&table, &lab, options(&file))?.evidence().clone();
        let before = table.steps().take_while(|(_, other)| other.name != step);
        evidence.steps.extend(before.map(|(_, step)| Record::new(&step.name, Verdict::Passed)));
        evidence.write(&file)?;
        Ok(Self { table, lab, file })
    }

    /// Continues the walk; returns the step that stops, and the reason.
    fn stops(&self) -> Result<Record> {
        let end = walk(&self.table, &self.lab, options(&self.file))?.run();
        let why = end.err().context("no step stops")?.to_string();
        let evidence = Evidence::open(&self.file)?.context("a file")?;
        let last = evidence.steps.last().context("a record")?.clone();
        ensure!(last.verdict != Verdict::Passed && why.contains(&last.name), "{why}: {last:?}");
        Ok(last)
    }
}

/// A defect that is present from a step on stops the walk at the step that is intended for it, `expected`. The drive is
/// off then, and a line that switches it on was sent only after the steps that judge gates and fault input.
fn are_stopped(defects: &[(Defect, &str, &str)], switched_on: bool) -> Result<()> {
    let lab = Begun::at(&REFERENCE, defects[0].1)?.lab;
    let started = lab.bench().board.keep()?;
    for &(defect, first, expected) in defects {
        lab.again(&started, defect)?;
        let begun = Begun::with(lab.clone(), first).with_context(|| format!("{defect:?}"))?;
        let last = begun.stops().with_context(|| format!("{defect:?}"))?;
        println!("STOPPED {defect:?} at {}: {}", last.name, last.why);
        ensure!(last.name == expected && last.verdict == Verdict::Stopped, "{defect:?}: {last:?}");
        let mut bench = lab.bench();
        bench.run(0.5)?;
        ensure!(!bench.board.gates().any_on(), "{defect:?}: a gate is on");
        let was_on = bench.sent.iter().any(|line| line.starts_with("start"));
        ensure!(was_on == switched_on, "{defect:?}: {:?}", bench.sent);
    }
    Ok(())
}

#[test]
fn every_defect_of_controller_and_drivers_is_stopped_at_its_step() -> Result<()> {
    let defects = [
        (D::RegisterChanged, "registers", "registers"),
        (D::WatchdogResets, "power", "power"),
        (D::BootPinFloats, "boot-pin", "boot-pin"),
        (D::DriverPolarity, "gate-levels", "gate-levels"),
    ];
    are_stopped(&defects, false)
}

#[test]
fn every_defect_of_the_measurements_is_stopped_at_its_step() -> Result<()> {
    let defects = [
        (D::CurrentGain, "noise", "sensors"),
        (D::CurrentSign, "sensors", "sensors"),
        (D::SensorsExchanged, "sensors", "sensors"),
        (D::Divider, "dc-link", "dc-link"),
        (D::NtcOpen, "heat-sink", "heat-sink"),
        (D::NtcShorted, "heat-sink", "heat-sink"),
        (D::BreakNeverTrips, "break-pin", "break-pin"),
        (D::BreakAlwaysTrips, "break-pin", "break-pin"),
    ];
    are_stopped(&defects, false)
}

#[test]
fn every_defect_of_the_first_turn_is_stopped_at_its_step() -> Result<()> {
    let defects =
        [(D::DeadTime, "low-voltage", "dead-time"), (D::PhasesExchanged, "current", "forwards")];
    are_stopped(&defects, true)
}

/// A person who pulls the plug when asked to do something.
struct Puller(Running);

impl Person for Puller {
    fn tell(&mut self, text: &str) {
        println!("{text}");
    }

    fn hand(&mut self, _: &str) -> Option<()> {
        self.0.end().ok()
    }

    fn see(&mut self, _: &str) -> Option<bool> {
        None
    }

    fn measure(&mut self, _: &str, _: &str) -> Option<f64> {
        None
    }
}

/// Through a serial port, as `cargo sim first-light` does it: a step is passed, then the plug is pulled.
#[test]
fn a_serial_port_that_goes_is_noted() -> Result<()> {
    let folder = folder("first-light-port");
    let (table, file) = (Table::read()?, folder.join("evidence.toml"));
    let mut board = command(&folder, &["--fast"]);
    let mut board = Running(board.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?);
    let mut shown = BufReader::new(board.0.stdout.take().context("its output")?).lines();
    let first = shown.next().context("its port")??;
    let path = first.strip_prefix("console: ").context("a port")?;
    // A line that comes before the greeting is lost.
    ensure!(shown.map_while(Result::ok).any(|line| line.contains("last run: ")), "no greeting");
    let mut port = Port::new(path, 115_200, Arc::default())?;
    let version = port.ask("version")?.lines.join(" ");
    let build = version.split(", build ").nth(1).and_then(|rest| rest.split(';').next());
    let (bench, build) = (String::new(), build.context("a build")?.to_owned());
    let before = table.steps().take_while(|(_, step)| step.name != "noise");
    let steps = before.map(|(_, step)| Record::new(&step.name, Verdict::Passed)).collect();
    let evidence =
        Evidence { schema: SCHEMA, bench, board: REFERENCE.name.to_owned(), build, steps };
    evidence.write(&file)?;
    let bench = (port, Puller(board));
    let why = Walk::new(&table, bench, options(&file), Arc::default())?.run().err();
    let why = why.context("it has ended")?.to_string();
    let evidence = Evidence::open(&file)?.context("a file")?;
    let last = evidence.steps.last().context("a record")?;
    ensure!(evidence.verdict("noise") == Some(Verdict::Passed), "{why}");
    ensure!(last.name == "sensors" && last.why.contains("the port is closed"), "{last:?}");
    ensure!(last.verdict == Verdict::Stopped && why.contains("port"), "{last:?}");
    Ok(())
}

/// Ctrl-C while a line is being answered: `stop` is sent, and the step counts as interrupted.
#[test]
fn an_interrupted_step_is_noted_and_the_drive_is_stopped() -> Result<()> {
    let begun = Begun::at(&REFERENCE, "noise")?;
    let interrupted = Arc::new(AtomicBool::new(true));
    let bench = (begun.lab.clone(), begun.lab.clone());
    ensure!(Walk::new(&begun.table, bench, options(&begun.file), interrupted)?.run().is_err());
    let evidence = Evidence::open(&begun.file)?.context("a file")?;
    ensure!(evidence.verdict("noise") == Some(Verdict::Interrupted));
    ensure!(begun.lab.bench().sent.iter().any(|line| line == "stop"));
    Ok(())
}

/// The image of another board, and another build than that of the test record, are refused before anything is done.
#[test]
fn another_image_is_refused() -> Result<()> {
    let begun = Begun::at(&REFERENCE, "noise")?;
    let refused = |options: Light, text: &str| {
        let why = walk(&begun.table, &begun.lab, options).err().context("refused")?.to_string();
        ensure!(why.contains(text), "{why}");
        Ok(())
    };
    let board = Some(ALL[1].name.to_owned());
    refused(Light { board, ..options(&begun.file) }, ALL[1].name)?;
    let mut evidence = Evidence::open(&begun.file)?.context("a file")?;
    evidence.build = "0123456789abcdef".to_owned();
    evidence.write(&begun.file)?;
    refused(options(&begun.file), "0123456789abcdef")
}

/// The port is lost, or the person leaves, while the motor turns: the drive is off within seconds, by itself or by
/// `stop`. The record notes it; a later run repeats the step and continues.
#[test]
fn a_lost_port_and_a_lost_person_stop_the_drive_and_the_walk_goes_on() -> Result<()> {
    let lab = Begun::at(&REFERENCE, "turn-at-nominal")?.lab;
    let started = lab.bench().board.keep()?;
    for (defect, verdict) in
        [(D::PortLost, Verdict::Stopped), (D::PersonGone, Verdict::Interrupted)]
    {
        lab.again(&started, defect)?;
        let begun = Begun::with(lab.clone(), "turn-at-nominal")?;
        let last = begun.stops()?;
        ensure!(last.name == "turn-at-nominal" && last.verdict == verdict, "{last:?}");
        let stopped = begun.lab.bench().sent.iter().any(|line| line == "stop");
        ensure!(stopped == (defect == D::PersonGone));
        begun.lab.bench().run(if stopped { 1.0 } else { 4.0 })?;
        let outputs = begun.lab.bench().board.gates().outputs_on;
        ensure!(!outputs, "{defect:?}: the outputs are on");
        let mut bench = begun.lab.bench();
        (bench.defect, bench.gone) = (D::None, false);
        bench.unasked.clear();
        drop(bench);
        let mut walk = walk(&begun.table, &begun.lab, options(&begun.file))?;
        walk.step()?;
        let steps = &walk.evidence().steps;
        let verdicts: Vec<_> =
            steps[steps.len() - 2..].iter().map(|r| (r.name.as_str(), r.verdict)).collect();
        let name = "turn-at-nominal";
        ensure!(verdicts == [(name, verdict), (name, Verdict::Passed)], "{verdicts:?}");
    }
    Ok(())
}

/// The values of the boards in the table are those of the firmware's boards.
#[test]
fn the_values_of_the_table_are_those_of_the_boards() -> Result<()> {
    let table = Table::read()?;
    ensure!(table.boards.iter().map(|b| b.name.as_str()).eq(ALL.iter().map(|s| s.name)));
    for (values, stage) in table.boards.iter().zip(ALL) {
        let (board, settings) = (stage.board(), stage.firmware_settings());
        let number = |name: &str| values.number(name);
        let near = |name: &str, expected: f64, share: f64| {
            let is = number(name);
            ensure!(
                (is / expected - 1.0).abs() < share,
                "{} {name} = {is}: {expected}",
                stage.name
            );
            Ok(())
        };
        let gain = f64::from(settings.scales.current_a.gain.abs());
        near("NOISE", 4.0 * gain, 0.04)?;
        near("MEAN", 0.05 * gain * f64::from(ADC_FULL_SCALE) / 2.0, 0.03)?;
        near("SENSOR", 0.03 + 4.0 * gain, 0.02)?;
        near("DEAD", f64::from(board.dead_time_s.value) * 1e6, 1e-6)?;
        near("NOMINAL", f64::from(settings.inverter.dc_link_v), 1e-6)?;
        let code = protection(board, &settings).over_voltage;
        let comparator = f64::from(settings.scales.dc_link.at(code));
        near("UNDER", comparator / 1.03, 0.005)?;
        near("TRIP", comparator * 1.03, 0.005)?;
        for (name, level) in
            [("HIGHSIDE", board.high.on_at.value), ("LOWSIDE", board.low.on_at.value)]
        {
            ensure!(values.fill(name) == if level == Level::High { "high" } else { "low" });
        }
        ensure!(values.has_third_sensor() == board.currents.shunts.is_some());
    }
    Ok(())
}
