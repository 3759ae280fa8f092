//! The board: the core, its chip, and the motor, simulated from one period to the next.

pub mod confirmed;
mod control;
mod debugger;
mod exceptions;
mod motor;
mod options;
mod outside;
pub mod poison;
pub mod rom;
pub mod snapshot;
mod terminals;

use std::collections::VecDeque;

use anyhow::{Result, anyhow, bail, ensure};
use drive_core::{Sample, Telemetry};
use hil_sim::plant::Plant;
use induction_drive::board::PWM_TOP;

pub use control::{LongestPath, Period};
pub use debugger::Debugger;
use motor::Connection;
pub use motor::Disturbance;
pub use options::Options;

use crate::power_stage::{COMPARED, watch::GateWatch};
use crate::{addresses::Addresses, image::Image, log::Log};
use control::RunningInterrupt;
use stm32g4_unicorn::chip::{ADC_INTERRUPT, TICKS_PER_S, pins::Pin};
use stm32g4_unicorn::{memory, periph::Reset, periph::iwdg::LSI_HZ, rules::Violation};

/// The chip with the power stage at its pins.
pub type Chip = stm32g4_unicorn::Chip<GateWatch>;
/// The core of that chip.
pub type Cpu = stm32g4_unicorn::Cpu<GateWatch>;

/// Exception number of the control interrupt.
pub const CONTROL_INTERRUPT: u16 = ADC_INTERRUPT;
/// Ticks of a PWM period, from one top of the counter to the next.
pub const TICKS_PER_PERIOD: u64 = 2 * PWM_TOP as u64;
/// The pins of the brake chopper and of the driver of the field bus.
const CHOPPER: Pin = (2, 6);
const BUS_DRIVER: Pin = (2, 12);

/// Number of periods after which the log is fetched, before its buffer in RAM is full.
const PERIODS_PER_LOG: u32 = 100;

/// Largest number of loop turns in which no time passes: exceptions nest a few levels deep.
const IDLE_LIMIT: u32 = 100_000;

/// The board.
pub struct Board {
    /// The core.
    pub cpu: Cpu,
    /// The image.
    pub image: Image,
    log: Option<Log>,
    progress: Progress,
    /// The motor with everything around it.
    pub plant: Plant,
    connection: Connection,
    addresses: Option<Addresses>,
    /// ST's boot loader, while it runs.
    pub loader: Option<rom::Loader>,
    /// Changes every sample, if set.
    pub disturb: Option<Disturbance>,
    /// The check that control interrupts leave the preempted code intact, if set.
    pub poison: Option<poison::Poison>,
    /// Time at which the outputs last went off, ticks.
    pub went_off: Option<u64>,
    /// Number of pulses below the minimum, if they are counted instead of refused; see [`Board::forgive`].
    pub short_pulses: u64,
    /// Resets since power-on, in order.
    pub resets: Vec<(u64, Reset)>,
    /// The longest control interrupt, if cycles are counted.
    pub longest: LongestPath,
    /// The longest path to the compare values.
    pub longest_to_compares: LongestPath,
    /// Longest time from its request to its first instruction, ticks.
    pub latest_start: u64,
}

/// Progress while a board runs.
#[derive(Default)]
struct Progress {
    sleeping: bool,
    hung: bool,
    entered: Option<RunningInterrupt>,
    /// Control interrupts and lines of the log that the caller has not fetched yet.
    periods: VecDeque<Period>,
    lines: Vec<String>,
    /// Number of periods since the log was fetched.
    since_log: u32,
    /// Time at which [`Board::pend`] requested the control interrupt, ticks.
    pended: Option<u64>,
    /// If set, the core stops before the n-th instruction in the flash from here, and [`Board::run_ticks`] returns.
    preempt_at: Option<u64>,
}

impl Board {
    /// Makes a board that has just been powered up, with this image in its flash.
    ///
    /// # Errors
    /// A fault of the image or of the plant's settings.
    pub fn new(image: Image, options: Options) -> Result<Self> {
        let plant = Plant::new(&options.plant, options.seed).map_err(|e| anyhow!("{e}"))?;
        let mut cpu =
            Cpu::new(Chip::default(), options.counting).map_err(|e| anyhow!("emulator: {e:?}"))?;
        for segment in &image.segments {
            let end = segment.address + segment.bytes.len() as u32;
            let inside = segment.address >= memory::FLASH && end <= memory::STORED;
            ensure!(inside, "a segment at {:#x} is not in the flash of the code", segment.address);
            cpu.write(segment.address, &segment.bytes);
        }
        cpu.write(memory::SYSTEM, &rom::CODE);
        let addresses = Addresses::find(&image)?;
        let log = Log::find(&image)?;
        let mut board = Self {
            cpu,
            image,
            log,
            progress: Progress::default(),
            plant,
            connection: Connection::new(&options),
            addresses,
            loader: None,
            disturb: None,
            poison: None,
            went_off: None,
            short_pulses: 0,
            resets: Vec::new(),
            longest: LongestPath::default(),
            longest_to_compares: LongestPath::default(),
            latest_start: 0,
        };
        let chip = board.chip();
        chip.set_clocks(0.0, LSI_HZ);
        chip.set_reference(0.0);
        if options.confirmed {
            confirmed::save(&options, &mut chip.flash)?;
        }
        let wiring = options.power_stage.wiring;
        chip.rcc.crystal_hz = wiring.crystal_hz;
        chip.bus_driver = Some(BUS_DRIVER);
        chip.circuit = GateWatch::new(options.power_stage, &chip.gpio, &chip.tim1);
        chip.follow_pins();
        chip.net.source = options.dc_link_pin;
        chip.net_at = COMPARED.iter().position(|at| *at == wiring.dc_link).unwrap_or(0);
        chip.break_pin = wiring.fault.0;
        chip.break_pull_ohm = options.fault_pull_ohm;
        board.show_sample();
        // The dc link is charged before the first period. (A copy is used, so that the noise of the periods is the same.)
        let dc_link = board.plant.clone().sample().dc_link;
        board.show_dc_link(dc_link);
        board.cpu.chip_mut().keep_blocks = options.counting.cycles;
        board.cpu.chip_mut().rules.coarse = !options.counting.every_instruction;
        board.cpu.reset(memory::FLASH);
        Ok(board)
    }

    /// Returns the addresses of the firmware's data; all zero for an image without the table.
    pub fn addresses(&self) -> Addresses {
        self.addresses.unwrap_or_default()
    }

    /// Returns the rules of the chip that the program has broken since power-up, in order.
    pub fn violations(&self) -> &[Violation] {
        self.cpu.chip().rules.violations()
    }

    /// Only records broken rules from now on, without ending a run.
    pub fn collect_violations(&mut self) {
        self.chip().rules.collecting = true;
    }

    /// Returns the telemetry of the drive after its last control interrupt with the outputs on.
    pub fn telemetry(&self) -> Telemetry {
        let mut bytes = [0; size_of::<Telemetry>()];
        self.cpu.read(self.addresses().telemetry, &mut bytes);
        // SAFETY: 32-bit integers and floating-point numbers, for which every value is valid, with the same layout as on the chip.
        unsafe { bytes.as_ptr().cast::<Telemetry>().read_unaligned() }
    }

    /// Reads bytes of the memory, as a debugger does.
    pub fn read(&self, address: u32, bytes: &mut [u8]) {
        self.cpu.read(address, bytes);
    }

    /// Returns the chip.
    pub fn chip(&mut self) -> &mut Chip {
        self.cpu.chip_mut()
    }

    /// Returns the duty of the brake chopper.
    pub fn chopper_duty(&self) -> f64 {
        self.cpu.chip().tim8_duty(CHOPPER)
    }

    /// Whether the precharge relay is closed.
    pub fn is_precharged(&self) -> bool {
        let chip = self.cpu.chip();
        chip.drives_high(chip.circuit.stage.wiring.relay)
    }

    /// Passes ADC counts of the dc link to the pins that are compared; the others have none.
    pub fn show_dc_link(&mut self, counts: u16) {
        let at = self.chip().circuit.stage.wiring.dc_link;
        let [pa0, pc1, pa1] = COMPARED.map(|channel| if channel == at { counts } else { 0 });
        self.chip().compare(pa0, pc1, pa1);
    }

    /// Returns the last sample.
    pub fn sample(&self) -> Sample {
        self.connection.sample
    }

    /// Returns the seconds since power-up.
    pub fn time(&self) -> f64 {
        self.cpu.chip().now as f64 / TICKS_PER_S as f64
    }

    /// Returns the oldest finished control interrupt that was not fetched yet.
    pub fn next_period(&mut self) -> Option<Period> {
        self.progress.periods.pop_front()
    }

    /// Resets the chip. RAM, flash and the motor keep their state, unless power was lost.
    pub fn reset(&mut self, cause: Reset) {
        let now = self.cpu.chip().now;
        self.advance_plant(now);
        self.chip().reset(cause);
        self.resets.push((now, cause));
        if cause == Reset::Power {
            for (base, size) in memory::VOLATILE {
                // The RAM has neither its old contents nor zeros.
                self.cpu.write(base, &vec![0xa5; size as usize]);
            }
        }
        self.progress.sleeping = false;
        self.progress.hung = false;
        self.progress.entered = None;
        self.loader = None;
        self.follow_outputs();
        self.cpu.reset(memory::FLASH);
        // Without a vector the core locks up.
        if self.cpu.word(memory::FLASH + 4) == Some(u32::MAX) {
            self.hang();
        }
    }

    /// Runs for a number of PWM periods.
    ///
    /// # Errors
    /// The access, the gate signals or the fault with which the model cannot continue.
    pub fn run_periods(&mut self, periods: u64) -> Result<()> {
        for _ in 0..periods {
            self.run_ticks(TICKS_PER_PERIOD)?;
            self.progress.since_log += 1;
            if self.progress.since_log >= PERIODS_PER_LOG {
                self.progress.since_log = 0;
                self.drain_log()?;
            }
        }
        Ok(())
    }

    /// Runs for a number of ticks of 170 MHz.
    ///
    /// # Errors
    /// The access, the gate signals or the fault with which the model cannot continue.
    pub fn run_ticks(&mut self, ticks: u64) -> Result<()> {
        let end = self.cpu.chip().now + ticks;
        let (mut at, mut idle) = (self.cpu.chip().now, 0);
        while self.cpu.chip().now < end {
            idle = if at == self.cpu.chip().now { idle + 1 } else { 0 };
            at = self.cpu.chip().now;
            ensure!(idle <= IDLE_LIMIT, "no time passes");
            self.events()?;
            if self.progress.preempt_at.is_some_and(|at| self.cpu.chip().instructions >= at) {
                self.progress.preempt_at = None;
                return Ok(());
            }
            let chip = self.cpu.chip();
            if !chip.is_halted() && chip.stalled_until <= chip.now {
                self.exceptions()?;
            }
            self.go(end)?;
        }
        Ok(())
    }

    /// Processes due events.
    fn events(&mut self) -> Result<()> {
        self.follow_outputs();
        self.serve_loader();
        while let Some((at, top)) = self.cpu.chip_mut().catch_up() {
            if top { self.crest(at)? } else { self.valley(at) }
        }
        self.follow_outputs();
        let followed = self.cpu.follow_guard().and_then(|()| self.cpu.follow_flash());
        followed.map_err(|e| anyhow!("emulator: {e:?}"))?;
        let chip = self.cpu.chip_mut();
        if let Some(unknown) = chip.unknown.take() {
            bail!("{unknown} at {}", self.image.location(unknown.at));
        }
        if let Some(violation) = chip.rules.fatal() {
            bail!("{violation}\n{}", self.image.location(violation.at));
        }
        if let Some(seen) = chip.circuit.take() {
            let (place, time) =
                (self.image.location(seen.at), seen.time as f64 / TICKS_PER_S as f64);
            bail!("bad gate signals: {} after {time:.6} s, at {place}", seen.what);
        }
        if chip.flash.power_lost {
            chip.reset = Some(Reset::Power);
        }
        if let Some(cause) = chip.reset.take() {
            self.drain_log()?;
            self.reset(cause);
        }
        Ok(())
    }
}
