//! The initial state of every injection: snapshots of a board that has started.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use anyhow::{Result, bail, ensure};
use drive_core::State;
use drive_settings::Settings;
use hil_sim::{Config, experiments::full_range::for_the_range, plant::Load};
use induction_drive::settings::FirmwareSettings;
use induction_drive::store::{Flash, FlashError, Saved};
use serde::Deserialize;

use stm32g4_unicorn::memory::{Region, STORED};
use virtual_board::addresses::Addresses;
use virtual_board::board::{Chip, snapshot::Snapshot};
use virtual_board::{Board, Image, Options, PowerStage};

use super::judge::wait;
use crate::common::pair::Pair;

/// q-axis current before the injection of a fault, A on the dissertation's motor. At speed its sign also makes the motor generate.
const TORQUE_A: f64 = 1.5;
/// Held speeds of the shaft with the encoder, rpm on four poles, in a campaign without a given speed.
const SPEEDS_RPM: [f64; 2] = [300.0, 900.0];
/// Number of periods until the torque has settled; the second value is for speed, where the field may be weakened.
const SETTLING: u64 = 1200;
const SETTLING_AT_SPEED: u64 = 3600;
/// Number of periods in which the held shaft is accelerated by [`STEP_RPM`]: 1000 rpm/s on four poles.
const STEP: u64 = 60;
const STEP_RPM: f64 = 10.0;
/// Number of periods until the rotor flux has decayed: 1.5 s are eight time constants.
const DECAYED: u64 = 9000;
/// Longest duration of the saliency self-commissioning, periods: ten minutes.
const LEARNING: u64 = 3_600_000;
/// A setting that is changed but not saved yet.
const CHANGE: (&str, f32) = ("command.timeout_s", 3600.0);

/// The source of the flux angle, and the speed of the shaft unless the campaign has one.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// No encoder: the injection, with the shaft locked, or the observer at speed.
    Sensorless,
    /// The encoder, at 300 rpm.
    Encoder,
    /// The encoder, at 900 rpm.
    FastEncoder,
}

/// The target of the faults: regions of memory in which bits flip, and the sizes of the drive's quantities.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The data of the control interrupt, in CCM.
    pub addresses: Addresses,
    /// The code of the control interrupt, in CCM.
    pub code: Region,
    /// Data in RAM, without the stack.
    pub data: Region,
    /// The stack.
    pub stack: Region,
    /// The drive's settings.
    pub settings: Settings,
    /// Scale of currents relative to the dissertation's motor.
    pub relative_current: f64,
    /// Scale of voltages relative to its dc link.
    pub relative_voltage: f64,
    /// Speed of [`Source::Encoder`], rpm on four poles.
    pub encoder_rpm: f64,
    /// Inertia of the motor, kg m^2.
    pub inertia: f64,
}

impl Target {
    fn new(board: &Board, config: &Config, settings: Settings, encoder_rpm: f64) -> Result<Self> {
        let between = |first: &str, end: &str| {
            let address = board.image.symbol(first)?.address;
            anyhow::Ok(Region { address, size: board.image.symbol(end)?.address - address })
        };
        Ok(Self {
            addresses: board.addresses(),
            code: between("__sccm", "__eccm")?,
            data: between("__sdata", "__euninit")?,
            stack: between("_stack_end", "_stack_start")?,
            settings,
            relative_current: config.amperes(1.0),
            relative_voltage: config.inverter.dc_link_v / Config::default().inverter.dc_link_v,
            encoder_rpm,
            inertia: config.motor.inertia,
        })
    }
}

/// A board and its snapshots.
pub struct Scene {
    /// The board.
    pub board: Board,
    /// The target of the faults.
    pub target: Target,
    /// Two sets of settings.
    pub settings: [FirmwareSettings; 2],
    /// Snapshots with the drive off: one with the first set saved twice and the second one not saved yet; one with the
    /// second set saved over the older copy, and the first set to be saved again.
    off: [Snapshot; 2],
    /// Snapshots with the drive off, and turning for the terminal strip, after the first fault of its wires has made them.
    pub strip: Option<[Snapshot; 2]>,
    /// Snapshots after lines that were typed with the drive off.
    typed: BTreeMap<Vec<String>, Snapshot>,
    /// Snapshots with each torque: without the encoder, and with it at each speed.
    sensorless: Vec<Snapshot>,
    encoder: Vec<Vec<Snapshot>>,
}

impl Scene {
    /// Starts a board with this power stage and a motor that suits it, once with each angle source. A given speed, rpm
    /// on four poles, selects settings for the full speed range.
    ///
    /// # Errors
    /// The board does not start.
    pub fn new(image: Image, stage: &'static PowerStage, rpm: Option<f64>) -> Result<Self> {
        let mut config = stage.config()?;
        let (mut torques, mut speeds) = (vec![config.amperes(TORQUE_A)], SPEEDS_RPM.to_vec());
        if let Some(rpm) = rpm {
            config = for_the_range(&config)?;
            torques.push(-torques[0]);
            speeds = vec![rpm];
        }
        let mut pair = Pair::new(image, Options::on(stage, &config, 1).set_up(&config)?)?;
        pair.order("set wiring_checked yes")?;
        if config.prepare.learn {
            pair.order("learn")?;
            pair.until_state(State::Learning)?;
            pair.until("the end of learning", LEARNING, |_, state| state == State::Off)?;
        }
        // Saved twice, so that both pages hold a set.
        for _ in 0..2 {
            pair.order("save")?;
        }
        let old = saved_settings(&mut pair.board)?;
        pair.order(&format!("set {} {}", CHANGE.0, CHANGE.1))?;
        let mut new = old;
        new.command.timeout_s = CHANGE.1;
        let first = pair.board.keep()?;
        pair.order("save")?;
        pair.order(&format!("set {} {}", CHANGE.0, old.command.timeout_s))?;
        let off = [first, pair.board.keep()?];
        let settling = if rpm.is_some() { SETTLING_AT_SPEED } else { SETTLING };
        pair.start_torque()?;
        let mut held = 0.0;
        while held < rpm.unwrap_or(0.0) {
            held += STEP_RPM;
            let speed = config.rpm(held.min(speeds[0])) * TAU / 60.0;
            pair.board.plant.set_load(Load::Speed { speed })?;
            pair.run(STEP, |_, _| {})?;
        }
        let sensorless = with_torques(&mut pair, &torques, settling)?;
        pair.order("angle encoder")?;
        let mut with_encoder = |rpm: &f64| {
            pair.board.plant.set_load(Load::Speed { speed: config.rpm(*rpm) * TAU / 60.0 })?;
            pair.start_torque()?;
            with_torques(&mut pair, &torques, settling)
        };
        let encoder = speeds.iter().map(&mut with_encoder).collect::<Result<_>>()?;
        let settings = pair.shadow.settings();
        let board = pair.board;
        let target = Target::new(&board, &config, settings, speeds[0])?;
        Ok(Self {
            board,
            target,
            settings: [old, new],
            off,
            strip: None,
            typed: BTreeMap::new(),
            sensorless,
            encoder,
        })
    }

    /// Goes to a snapshot in which the drive regulates torque; at speed, every second pair of turns has a generating torque.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn regulating(&mut self, source: Source, turn: u64) -> Result<()> {
        let snapshots = match source {
            Source::Sensorless => &self.sensorless,
            Source::Encoder => &self.encoder[0],
            Source::FastEncoder => &self.encoder[self.encoder.len() - 1],
        };
        self.board.go_back(&snapshots[(turn / 2) as usize % snapshots.len()])
    }

    /// Goes to a snapshot with the drive off and settings that are not saved: the second set, to go to one slot, or the
    /// first, to go to the other.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn off(&mut self, slot: usize) -> Result<()> {
        self.board.go_back(&self.off[slot % 2])
    }

    /// Goes to the drive off after these lines, each with time to take effect; makes the snapshot at the first call.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn typed(&mut self, lines: &[String]) -> Result<()> {
        self.off(0)?;
        if !self.typed.contains_key(lines) {
            for line in lines {
                self.board.type_line(line);
                wait(&mut self.board, DECAYED)?;
                let said = self.board.take_console();
                ensure!(!said.contains("error"), "{line}: {said}");
            }
            self.typed.insert(lines.to_vec(), self.board.keep()?);
        }
        self.board.go_back(&self.typed[lines])
    }
}

/// Takes a snapshot with each torque, then stops the drive.
fn with_torques(pair: &mut Pair, torques: &[f64], settling: u64) -> Result<Vec<Snapshot>> {
    let mut snapshots = Vec::new();
    for torque in torques {
        pair.order(&format!("torque {torque}"))?;
        pair.run(settling, |_, _| {})?;
        // A control interrupt has just ended; half a period later nothing happens for a while.
        pair.board.run_ticks(u64::from(induction_drive::board::PWM_TOP) / 2)?;
        snapshots.push(pair.board.keep()?);
    }
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    // A start mistakes a flux that has not decayed for a current without a voltage.
    pair.run(DECAYED, |_, _| {})?;
    Ok(snapshots)
}

/// The settings area of the flash, as the firmware reads it.
#[derive(Debug)]
struct Bank<'a>(&'a mut Chip);

impl Flash for Bank<'_> {
    fn read(&mut self, slot: usize, word: usize) -> Option<u64> {
        let address = induction_drive::board::settings_address(slot, word);
        let (low, torn) = self.0.flash.load(address);
        let (high, _) = self.0.flash.load(address + 4);
        (!torn).then_some(u64::from(low) | u64::from(high) << 32)
    }

    fn erase(&mut self, _: usize) -> Result<(), FlashError> {
        Err(FlashError::Erase(0)) // looked at only
    }

    fn program(&mut self, _: usize, _: usize, _: u64) -> Result<(), FlashError> {
        Err(FlashError::Program(0))
    }
}

/// Returns the settings in the flash.
///
/// # Errors
/// The flash holds no settings.
pub fn saved_settings(board: &mut Board) -> Result<FirmwareSettings> {
    ensure!(
        induction_drive::board::settings_address(0, 0) >= STORED,
        "settings outside the part that can be written"
    );
    let mut chip = board.chip().clone();
    let defaults = FirmwareSettings::of(chip.circuit.stage.board());
    let Ok(Some(settings)) = Saved::load(Bank(&mut chip), &defaults).1 else {
        bail!("no whole settings in the flash");
    };
    Ok(settings)
}
