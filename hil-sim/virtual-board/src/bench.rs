//! The board: the core, its chip, and the motor, from one period to the next.

pub mod poison;
pub mod snapshot;

use std::collections::VecDeque;
use std::fmt;

use anyhow::{Context, Result, anyhow};
use drive_core::{Compare, Hardware, Sample};
use hil_sim::config::Config;
use hil_sim::plant::{MeasurementSettings, Plant, PlantSettings};

use crate::board as numbers;
use crate::chip::{Block, Chip, IRQ_ADC1_2, Reset, TICKS_PER_S, Unknown};
use crate::cpu::{Cpu, Fault, Register, Stop};
use crate::image::Image;
use crate::log::Log;
use crate::memory;
use crate::periph::tim1::{BadGates, GateLimits};
use crate::scs;
use crate::unicorn::{Counting, UnicornCpu};

/// What a board is made with.
pub struct Options {
    /// The motor and everything around it; see [`Options::plant`].
    pub plant: PlantSettings,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// What is counted.
    pub counting: Counting,
    /// What the gates must respect.
    pub gates: GateLimits,
}

impl Options {
    /// The plant that a configuration describes, with the sensors and the dead time of this board.
    pub fn plant(config: &Config) -> PlantSettings {
        let mut plant = hil_sim::rig::plant_settings(config);
        // The converters have another reference than the source's.
        let gain = f64::from(numbers::CURRENT_A.gain / drive_core::sensing::Line::CHANNEL_A.gain);
        plant.measurement.lsb_a = MeasurementSettings::default().lsb_a * gain;
        plant.inverter.dead_time_us = f64::from(numbers::dead_time(numbers::DEAD_TIME_S).1) * 1e6;
        plant.inverter.timer_top = numbers::PWM_TOP;
        plant
    }

    /// A board with the motor of a configuration.
    pub fn new(config: &Config, seed: u64) -> Self {
        let us = numbers::CYCLES_PER_US;
        let gates = GateLimits {
            // What the firmware asks for; the timer makes it a little longer.
            dead_time: (f64::from(numbers::DEAD_TIME_S) * TICKS_PER_S as f64).round() as u32,
            // A microsecond, less what rounding to counts takes.
            pulse: us - 2,
        };
        Self {
            plant: Self::plant(config),
            seed,
            counting: Counting { cycles: true, every_instruction: false },
            gates,
        }
    }
}

/// Why the board cannot go on.
#[derive(Clone, Debug)]
pub enum Failure {
    /// A register that the model does not know.
    Unknown(Unknown, String),
    /// Bad gate signals.
    Gates(BadGates),
    /// The core does something that no exception of the model covers.
    Core(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(access, place) => match access.written {
                Some(value) => {
                    write!(
                        f,
                        "unknown register {:#010x} written with {value:#x} at {place}",
                        access.address
                    )
                }
                None => write!(f, "unknown register {:#010x} read at {place}", access.address),
            },
            Self::Gates(bad) => write!(f, "bad gate signals: {bad:?}"),
            Self::Core(what) => f.write_str(what),
        }
    }
}

impl std::error::Error for Failure {}

/// One control interrupt, as seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// When it began, ticks.
    pub began: u64,
    /// What the converters and the encoder gave it.
    pub sample: Sample,
    /// Compare values it wrote, and whether the outputs were on after it.
    pub compare: Compare,
    /// Whether it took an order from the console.
    pub took_order: bool,
    /// Estimated cycles, with entry, exit and bus, when they are counted.
    pub cycles: u32,
}

/// What is known of a control interrupt while it runs.
#[derive(Clone, Copy, Debug)]
struct Entered {
    began: u64,
    sample: Sample,
    ended: bool,
    had_order: bool,
    accesses: u64,
}

/// The longest control interrupt.
#[derive(Clone, Debug, Default)]
pub struct Worst {
    /// Estimated cycles.
    pub cycles: u32,
    /// Accesses to registers.
    pub accesses: u32,
    /// What it executed.
    pub blocks: Vec<Block>,
}

/// Periods after which the log is fetched, before its buffer in RAM is full.
const PERIODS_PER_LOG: u32 = 100;

/// Turns of the loop without time passing: exceptions nest a few deep.
const IDLE_LIMIT: u32 = 100_000;

/// A change of what the converters see.
pub type Disturbance = Box<dyn FnMut(&mut Sample)>;

/// The board.
pub struct Board {
    cpu: UnicornCpu,
    image: Image,
    log: Log,
    lines: Vec<String>,
    since_log: u32,
    /// The motor with everything around it.
    pub plant: Plant,
    gates: GateLimits,
    /// Up to where the plant has gone.
    plant_at: u64,
    applied: Compare,
    outputs: bool,
    sample: Sample,
    sleeping: bool,
    hung: bool,
    /// The core executes nothing before this.
    stalled_until: u64,
    entered: Option<Entered>,
    periods: VecDeque<Period>,
    order_flag: u32,
    /// Changes every sample, if there.
    pub disturb: Option<Disturbance>,
    /// Compares what control interrupts preempt before and after, if there.
    pub poison: Option<poison::Poison>,
    /// When the outputs went off last, ticks.
    pub went_off: Option<u64>,
    /// Pulses below the minimum, where they are counted instead of refused; see [`Board::forgive`].
    pub short_pulses: u64,
    /// Resets since power-on, in order.
    pub resets: Vec<(u64, Reset)>,
    /// The longest control interrupt, when cycles are counted.
    pub worst: Worst,
    /// The core is stopped before the n-th instruction in the flash from here on, if set, and
    /// [`Board::run_ticks`] returns.
    preempt_at: Option<u64>,
}

impl Board {
    /// A board that has just been powered, with this image in its flash.
    ///
    /// # Errors
    /// What is wrong with the image or the plant.
    pub fn new(image: Image, options: Options) -> Result<Self> {
        let plant = Plant::new(&options.plant, options.seed).map_err(|e| anyhow!("{e}"))?;
        let mut cpu = UnicornCpu::new(Chip::new(), options.counting)
            .map_err(|e| anyhow!("emulator: {e:?}"))?;
        for segment in image.segments() {
            let end = segment.address + segment.bytes.len() as u32;
            if segment.address < memory::FLASH || end > memory::BANK_2 {
                return Err(anyhow!("a segment at {:#x} is not in bank 1", segment.address));
            }
            cpu.write(segment.address, &segment.bytes);
        }
        let (size, offset) = image.member("Mailbox<induction_drive::link::Order>", "full")?;
        let order_flag =
            image.variable("start_control", size).context("mailbox of orders")? + offset;
        let log = Log::new(&image)?;
        let mut board = Self {
            cpu,
            image,
            log,
            lines: Vec::new(),
            since_log: 0,
            plant,
            gates: options.gates,
            plant_at: 0,
            applied: Compare::OFF,
            outputs: false,
            sample: Sample::default(),
            sleeping: false,
            hung: false,
            stalled_until: 0,
            entered: None,
            periods: VecDeque::new(),
            order_flag,
            disturb: None,
            poison: None,
            went_off: None,
            short_pulses: 0,
            resets: Vec::new(),
            worst: Worst::default(),
            preempt_at: None,
        };
        board.see();
        board.cpu.chip_mut().keep_blocks = options.counting.cycles;
        board.cpu.reset(memory::FLASH);
        Ok(board)
    }

    /// The core.
    pub fn cpu(&mut self) -> &mut UnicornCpu {
        &mut self.cpu
    }

    /// A word of memory.
    pub fn word(&self, address: u32) -> Option<u32> {
        self.cpu.word(address)
    }

    /// The chip.
    pub fn chip(&mut self) -> &mut Chip {
        self.cpu.chip_mut()
    }

    /// The image.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// What the converters see.
    pub fn sample(&self) -> Sample {
        self.sample
    }

    /// Seconds since power-on.
    pub fn time(&self) -> f64 {
        self.cpu.chip().now as f64 / TICKS_PER_S as f64
    }

    /// Puts a line, without its end, on the wire to the console.
    pub fn type_line(&mut self, line: &str) {
        self.send(line.as_bytes());
        self.send(b"\n");
    }

    /// Puts bytes on the wire to the console.
    pub fn send(&mut self, bytes: &[u8]) {
        let chip = self.chip();
        chip.lpuart.wire.to_chip.extend(bytes.iter().map(|byte| Some(*byte)));
        chip.lpuart.wake(chip.now);
    }

    /// What the console has said since the last call.
    pub fn heard(&mut self) -> String {
        let bytes = std::mem::take(&mut self.chip().lpuart.wire.from_chip);
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// What was logged since the last call.
    ///
    /// # Errors
    /// The log cannot be decoded.
    pub fn logged(&mut self) -> Result<Vec<String>> {
        self.drain_log()?;
        Ok(std::mem::take(&mut self.lines))
    }

    fn drain_log(&mut self) -> Result<()> {
        let lines = self.log.take(&mut self.cpu)?;
        self.lines.extend(lines);
        Ok(())
    }

    /// The oldest control interrupt that has ended and was not asked for yet.
    pub fn next_period(&mut self) -> Option<Period> {
        self.periods.pop_front()
    }

    /// Level of the break pin: low trips.
    pub fn set_fault_pin(&mut self, high: bool) {
        self.chip().tim1.set_fault_pin(high);
    }

    /// The crystal stops, or lives again.
    pub fn set_crystal(&mut self, lives: bool) {
        self.chip().rcc.crystal_lives = lives;
    }

    /// The core executes nothing any more, until a reset.
    pub fn hang(&mut self) {
        self.hung = true;
    }

    /// The core executes nothing for some ticks, as if the bus were taken.
    pub fn stall(&mut self, ticks: u64) {
        self.stalled_until = self.cpu.chip().now + ticks;
    }

    /// From now on what the model does not know is what the chip makes of it: reserved registers read as 0,
    /// other accesses are faults, and a fault in a fault handler locks the core up. For runs in
    /// which the firmware is damaged on purpose.
    pub fn forgive(&mut self) {
        self.cpu.chip_mut().forgiving = true;
    }

    /// Returns from [`Board::run_ticks`] before the n-th instruction in the flash from here on.
    pub fn stop_after(&mut self, instructions: u64) {
        self.preempt_at = Some(self.cpu.chip().instructions + instructions);
    }

    /// Makes an exception pending: it preempts what runs, as its priority and the masks say.
    pub fn pend(&mut self, exception: u16) {
        self.chip().scs.pend(exception);
    }

    /// Resets the chip; RAM, flash and the motor stay, unless power was lost.
    pub fn reset(&mut self, cause: Reset) {
        let now = self.cpu.chip().now;
        self.advance_plant(now);
        self.chip().reset(cause);
        self.resets.push((now, cause));
        if cause == Reset::Power {
            for (base, size) in [(memory::RAM, memory::RAM_SIZE), (memory::CCM, memory::CCM_SIZE)] {
                // Not what it was, and not zeros.
                self.cpu.write(base, &vec![0xa5; size as usize]);
            }
        }
        self.sleeping = false;
        self.hung = false;
        self.stalled_until = 0;
        self.entered = None;
        self.see_outputs();
        self.cpu.reset(memory::FLASH);
    }

    /// Goes on for a number of PWM periods.
    ///
    /// # Errors
    /// What the board cannot go on with.
    pub fn run_periods(&mut self, periods: u64) -> Result<()> {
        for _ in 0..periods {
            self.run_ticks(2 * u64::from(numbers::PWM_TOP))?;
            self.since_log += 1;
            if self.since_log >= PERIODS_PER_LOG {
                self.since_log = 0;
                self.drain_log()?;
            }
        }
        Ok(())
    }

    /// Goes on for a number of ticks of 170 MHz.
    ///
    /// # Errors
    /// What the board cannot go on with.
    pub fn run_ticks(&mut self, ticks: u64) -> Result<()> {
        let end = self.cpu.chip().now + ticks;
        let (mut at, mut idle) = (self.cpu.chip().now, 0);
        while self.cpu.chip().now < end {
            idle = if at == self.cpu.chip().now { idle + 1 } else { 0 };
            at = self.cpu.chip().now;
            if idle > IDLE_LIMIT {
                return Err(Failure::Core("no time passes".into()).into());
            }
            self.events()?;
            if self.preempt_at.is_some_and(|at| self.cpu.chip().instructions >= at) {
                self.preempt_at = None;
                return Ok(());
            }
            self.exceptions()?;
            self.go(end)?;
        }
        Ok(())
    }

    /// Lets happen what is due.
    fn events(&mut self) -> Result<()> {
        self.see_outputs();
        loop {
            let happened = self.cpu.chip_mut().catch_up();
            if let Some(at) = happened.crest {
                self.crest(at)?;
            } else {
                break;
            }
        }
        self.see_outputs();
        let chip = self.cpu.chip_mut();
        if let Some(unknown) = chip.unknown.take() {
            return Err(Failure::Unknown(unknown, self.image.location(unknown.at)).into());
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

    /// Takes the exception that is due.
    fn exceptions(&mut self) -> Result<()> {
        let (primask, basepri) = self.masks();
        let Some(exception) = self.cpu.chip().scs.due(primask, basepri) else { return Ok(()) };
        self.enter(exception)
    }

    fn masks(&self) -> (u32, u32) {
        (self.cpu.get(Register::Primask), self.cpu.get(Register::Basepri))
    }

    fn enter(&mut self, exception: u16) -> Result<()> {
        self.sleeping = false;
        if exception == 16 + IRQ_ADC1_2 {
            self.begin_control();
        }
        let vector = self.cpu.chip().scs.vector(exception);
        let handler = self.cpu.word(vector).ok_or_else(|| Failure::Core("no vector".into()))?;
        self.cpu.chip_mut().scs.begin(exception);
        if exception == 16 + IRQ_ADC1_2 {
            self.remember();
        }
        let stacked = self.cpu.enter(exception, handler & !1);
        if exception == 16 + IRQ_ADC1_2 {
            self.spoil();
        }
        if !stacked && exception != scs::HARD_FAULT {
            // The stack is at its end: the frame is lost, and the fault is taken instead.
            self.hard_fault(1 << 12, None)?;
        }
        Ok(())
    }

    fn hard_fault(&mut self, cfsr: u32, address: Option<u32>) -> Result<()> {
        let pc = self.cpu.get(Register::Pc);
        let chip = self.cpu.chip_mut();
        if chip.scs.running() < 0 && chip.forgiving {
            // Locked up, until a reset.
            chip.lock_up();
            self.hung = true;
            return Ok(());
        }
        if chip.scs.running() < 0 {
            let place = self.image.location(pc);
            return Err(
                Failure::Core(format!("lock-up: a fault in a fault handler at {place}")).into()
            );
        }
        chip.scs.cfsr |= cfsr;
        chip.scs.hfsr |= 1 << 30;
        if let Some(address) = address {
            chip.scs.bfar = address;
            chip.scs.cfsr |= 1 << 15;
        }
        self.enter(scs::HARD_FAULT)
    }

    /// Lets the core run, or time pass if it sleeps.
    fn go(&mut self, end: u64) -> Result<()> {
        let chip = self.cpu.chip_mut();
        chip.deadline = chip.next_event().min(end);
        if self.stalled_until > chip.now {
            chip.now = chip.now.max(chip.deadline.min(self.stalled_until));
            return Ok(());
        }
        if self.hung || self.sleeping {
            if self.sleeping && chip.scs.wakes() {
                self.sleeping = false;
                return Ok(());
            }
            chip.now = chip.now.max(chip.deadline);
            return Ok(());
        }
        if chip.attention || chip.reset.is_some() {
            return Ok(());
        }
        // A mask that is going to be taken away lets in what waits: look at every instruction.
        if chip.scs.waits() {
            chip.deadline = chip.now + 1;
        }
        if let Some(at) = self.preempt_at {
            chip.deadline =
                chip.deadline.min(chip.now + at.saturating_sub(chip.instructions).max(1));
        }
        match self.cpu.run() {
            Stop::Asked => {}
            Stop::Wait => self.sleeping = true,
            Stop::Return(exc_return) => self.leave(exc_return)?,
            Stop::Fault(Fault::Access(address))
                if memory::is_reserved(address) || self.cpu.chip().forgiving =>
            {
                self.hard_fault(1 << 9, Some(address))?;
            }
            Stop::Fault(Fault::Instruction) => self.hard_fault(1 << 16, None)?,
            Stop::Fault(Fault::Access(address)) => {
                let place = self.image.location(self.cpu.chip().at);
                return Err(Failure::Core(format!("access to {address:#010x} at {place}")).into());
            }
        }
        Ok(())
    }

    fn leave(&mut self, exc_return: u32) -> Result<()> {
        let ended = self.cpu.chip_mut().scs.end();
        if ended == Some(16 + IRQ_ADC1_2) {
            self.end_control();
        }
        if ended.is_none() || !self.cpu.leave(exc_return) {
            self.hard_fault(1 << 11, None)?;
        } else if ended == Some(16 + IRQ_ADC1_2) {
            self.compare_with_before()?;
        }
        Ok(())
    }

    fn has_order(&self) -> bool {
        let mut flag = [0];
        self.cpu.read(self.order_flag, &mut flag) && flag[0] == 1
    }

    fn begin_control(&mut self) {
        let had_order = self.has_order();
        let chip = self.cpu.chip_mut();
        chip.begin_interrupt();
        let mut hardware = Hardware::NONE;
        if chip.adc.over_current() {
            hardware = hardware.and(Hardware::ANALOG_WATCHDOG);
        }
        if chip.tim1.broken() {
            hardware = hardware.and(Hardware::BREAK);
        }
        let ended = chip.adc.ended();
        if ended[0] && !ended[1] {
            hardware = hardware.and(Hardware::CONVERTER_OVERRUN);
        }
        let [one, two] = chip.adc.data();
        let sample = Sample {
            current_a: one[0],
            current_b: two[0],
            dc_link: one[1],
            heat_sink: two[1],
            encoder: chip.tim2.count(),
            hardware,
        };
        let (began, accesses) = (chip.now, chip.accesses);
        self.entered = Some(Entered { began, sample, ended: ended[0], had_order, accesses });
    }

    fn end_control(&mut self) {
        let Some(entered) = self.entered.take() else { return };
        let took_order = entered.had_order && !self.has_order();
        let chip = self.cpu.chip_mut();
        let accesses = (chip.accesses - entered.accesses) as u32;
        let spent = crate::chip::cycles_of(&chip.blocks);
        let cycles = spent + crate::cost::EXCEPTION + accesses * crate::cost::BUS;
        if spent > 0 && cycles > self.worst.cycles {
            self.worst = Worst { cycles, accesses, blocks: std::mem::take(&mut chip.blocks) };
        }
        if entered.ended {
            let [a, b, c] = chip.tim1.written().map(|value| value as u16);
            let compare = Compare { a, b, c, enabled: chip.tim1.outputs_on() };
            let period = Period {
                began: entered.began,
                sample: entered.sample,
                compare,
                took_order,
                cycles,
            };
            self.periods.push_back(period);
        }
    }

    /// The outputs as they are now hold from now on.
    fn see_outputs(&mut self) {
        let chip = self.cpu.chip();
        let (on, now) = (chip.tim1.outputs_on(), chip.now);
        if on != self.outputs {
            if on && !chip.gates_connected() {
                return; // the pins are not the timer's
            }
            self.advance_plant(now);
            self.outputs = on;
            if !on {
                self.went_off = Some(now);
            }
        }
    }

    fn advance_plant(&mut self, to: u64) {
        let compare =
            if self.outputs { Compare { enabled: true, ..self.applied } } else { Compare::OFF };
        while self.plant_at < to {
            // The plant's steps are fractions of what it is given: a period at most.
            let ticks = (to - self.plant_at).min(2 * u64::from(numbers::PWM_TOP));
            self.plant.advance(&compare, ticks as f64 / TICKS_PER_S as f64);
            self.plant_at += ticks;
        }
    }

    /// The counter is at its top: a period of the motor ends, the converters hold their samples, and the
    /// compare values taken over are in force.
    fn crest(&mut self, at: u64) -> Result<()> {
        self.advance_plant(at);
        self.sample = self.plant.sample();
        if let Some(disturb) = &mut self.disturb {
            disturb(&mut self.sample);
        }
        self.see();
        let chip = self.cpu.chip_mut();
        let [a, b, c] = chip.tim1.in_force().map(|value| value as u16);
        self.applied = Compare { a, b, c, enabled: true };
        if self.outputs {
            match chip.tim1.check_gates(self.gates) {
                Err(BadGates::Pulse { .. }) if chip.forgiving => self.short_pulses += 1,
                checked => checked.map_err(Failure::Gates)?,
            }
        }
        Ok(())
    }

    /// Shows the sample to converters, comparators and encoder.
    fn see(&mut self) {
        let s = self.sample;
        let chip = self.cpu.chip_mut();
        let pins = [
            (0, numbers::ADC1_CHANNELS.0, s.current_a),
            (0, numbers::ADC1_CHANNELS.1, s.dc_link),
            (1, numbers::ADC2_CHANNELS.0, s.current_b),
            (1, numbers::ADC2_CHANNELS.1, s.heat_sink),
        ];
        for (converter, channel, code) in pins {
            chip.adc.inputs[converter][usize::from(channel)] = code;
        }
        chip.tim2.set_position(s.encoder);
        chip.compare(s.current_a, s.current_b, s.dc_link);
    }
}
