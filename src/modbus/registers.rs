//! The registers that the master reads: a table, from which the table in the manual is made.
//!
//! A value of 32 bits takes two registers, the upper half first; a setting is a float, see [`float`](super::float).

use drive_core::io::PERIOD_S;
use drive_core::{Stage, State};
use drive_settings::value::Words as _;
use modbus_core::Exception;

use super::cia402::{self, Power};
use super::faults::{self, FaultLog};
use super::float::to_float;
use crate::desk::Desk;
use crate::desk::order::Refusal;
use crate::link::Status;
use crate::recording::trace::{SIGNALS as ALL_SIGNALS, Sampled, shown};
use crate::settings::Commander;
use crate::settings::FirmwareSettings;
use crate::settings::keys;

/// The command; see the manual.
pub const COMMAND: u16 = 0x2000;
/// Bit of the command for a run.
pub const RUN: u16 = 2;
/// The frequency reference, 0.01 Hz.
pub const FREQUENCY: u16 = 0x2001;
/// Bit 1 clears the latched fault.
pub const RESET: u16 = 0x2002;
/// The control word of CiA 402.
pub const CONTROL: u16 = 0x6040;
/// The mode of operation of CiA 402.
pub const MODE: u16 = 0x6060;
/// The only mode that may be written: velocity.
pub const VELOCITY: u16 = 2;
/// The signals of a trace: two registers each, by permanent number.
pub const SIGNALS: u16 = 0x3000;
const SIGNALS_END: u16 = 0x3200;
/// The settings, up to [`STAGED`]: two registers each, by permanent number.
pub const SETTINGS: u16 = 0x4000;
/// Request about the staged settings: 1 puts them in force, 2 also saves, 3 drops them.
pub const STAGED: u16 = 0x4fff;
/// The faults since the start, the newest first: code, and seconds since the start.
pub const FAULTS: u16 = 0x5100;
/// Number of registers per fault.
const PER_FAULT: u16 = 3;
const FAULTS_END: u16 = FAULTS + PER_FAULT * faults::KEPT as u16;

/// Pages: an address in a page that has no meaning reads as 0, so that a block read may span gaps.
const PAGES: [(u16, u16); 6] = [
    (0x0000, 0x01ff),
    (0x2000, 0x21ff),
    (SIGNALS, SIGNALS_END - 1),
    (SETTINGS, STAGED),
    (0x5000, 0x51ff),
    (0x6000, 0x60ff),
];

/// Bits of the register 0x2101.
const STATE_RUNS: u16 = 0b11;
const STATE_STARTS: u16 = 0b10;
const STATE_STOPS: u16 = 0b01;
const TURNS_REVERSE: u16 = 0b11 << 3;
const BY_BUS: u16 = 1 << 8 | 1 << 10;
const AT_SPEED: u16 = 1 << 12;
const STANDSTILL: u16 = 1 << 13;
const SPEED_ASSUMED: u16 = 1 << 15;

/// State that the registers show.
pub struct View<'a> {
    /// Last report of the control; `None` if it does not run.
    pub status: Option<Status>,
    /// The command arbiter, with the settings.
    pub desk: &'a Desk,
    /// The settings in force.
    pub settings: &'a FirmwareSettings,
    /// The command in force, as it would be written.
    pub command: u16,
    /// The state of CiA 402.
    pub power: Power,
    /// Whether the speed has been reached for long enough.
    pub at_speed: bool,
    /// Whether the shaft has been at standstill for long enough.
    pub standstill: bool,
    /// The frequency reference, 0.01 Hz.
    pub frequency: u16,
    /// The faults.
    pub faults: &'a FaultLog,
    /// Seconds since the start.
    pub seconds: u32,
}

use Shown::{Double, Number, Word};

/// Function that gives a value.
pub enum Shown {
    /// A number in fractions of its unit: 10 for 0.1.
    Number(u16, fn(&View<'_>) -> f32),
    /// A word.
    Word(fn(&View<'_>) -> u16),
    /// 32 bits.
    Double(fn(&View<'_>) -> u32),
}

/// A register, or two.
pub struct Row {
    /// Number of the (first) register.
    pub at: u16,
    /// Unit; empty if there is none.
    pub unit: &'static str,
    /// Function that gives its value.
    pub shown: Shown,
    /// Meaning, one sentence without its full stop.
    pub help: &'static str,
}

/// Rows of `NUMBER: SHOWN, UNIT, MEANING;`.
macro_rules! rows {
    ($($at:tt: $shown:expr, $unit:literal, $help:literal;)+) => {
        [$(Row { at: $at, unit: $unit, shown: $shown, help: $help }),+]
    };
}

/// The registers except settings and faults, by number.
pub static ROWS: [Row; 34] = rows! {
    0x0100: Number(100, |v| v.largest_hz()), "Hz", "largest frequency that can be requested, as 0x211B";
    COMMAND: Word(|v| v.command), "", "command: 1 stop, 18 run forward, 34 run in reverse, 0 release; see Command";
    FREQUENCY: Number(100, |v| f32::from(v.frequency) * 0.01), "Hz", "requested frequency";
    RESET: Word(|_| 0), "", "bit 1 (value 2) clears the latched fault, bit 2 (value 4) switches the outputs off; reads as 0";
    0x2100: Word(|v| v.fault()), "", "number of the latched fault, 0 for none";
    0x2101: Word(|v| v.delta_status()), "", "status, see Status";
    0x2102: Number(100, |v| f32::from(v.frequency) * 0.01), "Hz", "requested frequency, the value of 0x2001";
    0x2103: Number(100, |v| v.rpm().abs() * v.hz_per_rpm()), "Hz", "frequency of the shaft, without slip, magnitude: comparable with 0x2001";
    0x2104: Number(10, |v| v.current()), "A", "line current, rms of the fundamental";
    0x2105: Number(10, |v| v.dc_link()), "V", "voltage of the dc link";
    0x2106: Number(10, |v| v.voltage()), "V", "output voltage between lines, rms of the fundamental";
    0x2107: Number(1, |v| v.rpm().abs()), "rpm", "speed of the shaft, magnitude";
    0x210b: Number(1, |v| v.torque()), "%", "torque in percent of the rated torque, signed";
    0x210c: Number(1, |v| v.rpm().abs()), "rpm", "speed of the shaft, magnitude";
    0x210e: Number(1, |v| v.heat_sink()), "degC", "temperature of the heat sink, signed";
    0x211b: Number(100, |v| v.largest_hz()), "Hz", "largest frequency that can be requested: `speed.limit_rpm` times pole pairs over 60";
    0x2120: Number(100, |v| v.output_hz()), "Hz", "output frequency (of the flux), with slip, magnitude";
    STAGED: Word(|v| v.desk.settings().count() as u16), "", "reads the number of staged settings; write 1 to put them in force, 2 to save them as well, 3 to drop them";
    0x5000: Word(|_| 1), "", "version of this layout of the registers";
    0x5001: Double(|_| 0x669f_b378), "", "always 0x669FB378, as a sign that the registers of the settings are as in the table of Settings";
    0x5003: Word(|_| keys::COUNT as u16), "", "number of settings";
    0x5004: Word(|_| { version(env!("CARGO_PKG_VERSION_MAJOR")) << 8 | version(env!("CARGO_PKG_VERSION_MINOR")) }), "", "version of the firmware: major in the upper byte, minor in the lower";
    0x5005: Word(|_| version(env!("CARGO_PKG_VERSION_PATCH"))), "", "patch level of the firmware";
    0x5006: Word(|v| board(v.settings)), "", "board, as `board` in the settings";
    0x5007: Double(|v| v.seconds), "s", "time since the reset";
    0x5009: Word(|v| v.settings.command.commander.place() as u16), "", "interface in command: 0 console, 1 bus, 2 terminal strip";
    0x500a: Word(|v| v.settings.learned.is_some().into()), "", "1 if learned values are in force";
    0x500b: Word(|v| v.desk.refusal().map_or(0, Refusal::code)), "", "reason of the last write that was refused since the reset, see Requests; 0 for none";
    0x603f: Word(|v| v.error_code()), "", "fault as in CiA 402: 0xFF00 plus its number, 0 for none";
    CONTROL: Word(|v| v.control_word()), "", "control word of CiA 402, see Control word";
    0x6041: Word(|v| v.status_word()), "", "status word of CiA 402, see States";
    0x605a: Word(|v| v.settings.modules.bus.quick_stop.word().parse().unwrap_or(0)), "", "quick stop option code of CiA 402: `bus.quick_stop`";
    MODE: Word(|_| VELOCITY), "", "mode of operation of CiA 402: 2, velocity; other values are refused with exception 3";
    0x6061: Word(|v| if v.status.is_some_and(|s| s.state == State::Speed) { VELOCITY } else { 0 }), "", "mode of operation in force: 2 while the speed is regulated, otherwise 0";
};

impl View<'_> {
    /// The word of a register.
    ///
    /// # Errors
    /// [`Exception::IllegalDataAddress`] outside the pages.
    pub fn read(&self, at: u16) -> Result<u16, Exception> {
        if !PAGES.iter().any(|(first, last)| (*first..=*last).contains(&at)) {
            return Err(Exception::IllegalDataAddress);
        }
        if (SIGNALS..SIGNALS_END).contains(&at) {
            return Ok(half(self.signal((at - SIGNALS) / 2).to_bits(), at - SIGNALS));
        }
        if (SETTINGS..STAGED).contains(&at) {
            let key = keys::find_id((at - SETTINGS) / 2);
            let bits = key.map_or(0, |key| to_float(key, self.desk.settings().latest()).to_bits());
            return Ok(half(bits, at - SETTINGS));
        }
        if (FAULTS..FAULTS_END).contains(&at) {
            let (code, seconds) = self.faults.get(usize::from((at - FAULTS) / PER_FAULT));
            return Ok(match (at - FAULTS) % PER_FAULT {
                0 => code.into(),
                place => half(seconds, place - 1),
            });
        }
        Ok(ROWS.iter().find_map(|row| row.word(at, self)).unwrap_or(0))
    }

    /// The latest value of the signal with this number; 0 for an unknown number, and before the control runs.
    fn signal(&self, id: u16) -> f32 {
        let Some(s) = &self.status else { return 0.0 };
        let sampled = Sampled::new(&s.sample, s.state, s.limiting);
        let values = shown(&s.telemetry, &sampled, self.desk.shaft().freq());
        let found = ALL_SIGNALS.iter().zip(values).find(|(signal, _)| signal.id == id);
        found.map_or(0.0, |(signal, value)| signal.shown(value, &self.settings.drive))
    }

    /// The report, if the drive is not off.
    fn active(&self) -> Option<&Status> {
        self.status.as_ref().filter(|status| !status.state.is_off())
    }

    fn largest_hz(&self) -> f32 {
        self.settings.drive.speed_limit_rpm() * self.hz_per_rpm()
    }

    fn hz_per_rpm(&self) -> f32 {
        f32::from(self.settings.drive.motor.pole_pairs) / 60.0
    }

    fn fault(&self) -> u16 {
        match self.status.map(|status| status.state) {
            Some(State::Fault(fault)) => fault.code().into(),
            _ => 0,
        }
    }

    fn error_code(&self) -> u16 {
        match self.fault() {
            0 => 0,
            code => 0xff00 | code,
        }
    }

    /// Output frequency. While the drive is off, it is that of the shaft: masters take it for the speed, and wait for standstill by it.
    fn output_hz(&self) -> f32 {
        let freq = match self.active() {
            Some(status) => status.telemetry.flux_freq,
            None => self.desk.shaft().freq(),
        };
        (freq / PERIOD_S).abs()
    }

    /// Speed of the shaft, signed, rpm; the last measured one while nothing measures it.
    fn rpm(&self) -> f32 {
        let freq = match self.active() {
            Some(status) => status.telemetry.rotor_freq,
            None => self.desk.shaft().freq(),
        };
        freq / PERIOD_S / self.hz_per_rpm()
    }

    /// Whether the drive is off and does not know whether the shaft rotates.
    fn speed_is_assumed(&self) -> bool {
        self.active().is_none() && self.desk.shaft().is_assumed()
    }

    fn current(&self) -> f32 {
        self.active().map_or(0.0, |status| {
            let i = status.telemetry.current;
            libm::sqrtf(0.5 * (i.d * i.d + i.q * i.q))
        })
    }

    fn voltage(&self) -> f32 {
        self.active().map_or(0.0, |status| {
            let v = status.telemetry.voltage;
            libm::sqrtf(1.5 * (v.d * v.d + v.q * v.q))
        })
    }

    /// Torque by 3/2 P L_m/L_r psi i_q (Eq. 2.7), as at the console.
    fn torque(&self) -> f32 {
        let (motor, plate) = (&self.settings.drive.motor, &self.settings.drive.nameplate);
        let rated = plate.torque_nm();
        self.active().map_or(0.0, |status| {
            let i = status.telemetry.current;
            100.0 * motor.torque_per_ampere(i.d) * i.q / rated
        })
    }

    fn dc_link(&self) -> f32 {
        let scales = &self.settings.drive.scales;
        self.status.map_or(0.0, |status| scales.dc_link.at(status.sample.dc_link))
    }

    fn heat_sink(&self) -> f32 {
        let scales = &self.settings.drive.scales;
        self.status.map_or(0.0, |status| scales.ntc.celsius(status.sample.heat_sink))
    }

    fn delta_status(&self) -> u16 {
        let state = match self.status.map(|status| status.state.stage()) {
            Some(Stage::Running) => STATE_RUNS,
            Some(Stage::Starting) => STATE_STARTS,
            Some(Stage::Stopping) => STATE_STOPS,
            _ => 0,
        };
        state
            | bits([
                (self.rpm() < -0.5, TURNS_REVERSE),
                (self.bus_commands(), BY_BUS),
                (self.at_speed, AT_SPEED),
                (self.standstill, STANDSTILL),
                (self.speed_is_assumed(), SPEED_ASSUMED),
            ])
    }

    fn bus_commands(&self) -> bool {
        self.settings.command.commander == Commander::Bus
    }

    /// The control word that leads to the state.
    fn control_word(&self) -> u16 {
        match self.power {
            _ if self.command & RUN == RUN => 15,
            Power::SwitchedOn => 7,
            Power::ReadyToSwitchOn => 6,
            _ => 0,
        }
    }

    /// Whether the drive regulates the speed and has reached its reference.
    pub fn is_at_reference(&self) -> bool {
        let most = self.settings.drive.speed_limit_rpm();
        let wanted = f32::from(self.frequency) * 0.01 / self.hz_per_rpm();
        let error = self.rpm().abs() - wanted.min(most);
        let near = error.abs() <= 0.01 * self.settings.modules.bus.reached_pct * most;
        near && self.status.is_some_and(|status| status.state == State::Speed)
    }

    /// Whether the shaft is known to be at rest.
    pub fn is_at_standstill(&self) -> bool {
        let slow = 0.01 * self.settings.modules.bus.standstill_pct;
        let at_rest = self.rpm().abs() <= slow * self.settings.drive.speed_limit_rpm();
        at_rest && self.status.is_some() && !self.speed_is_assumed()
    }

    fn status_word(&self) -> u16 {
        let has_voltage =
            self.status.is_some() && self.dc_link() > self.settings.drive.dc_under_v();
        self.power.bits()
            | bits([
                (has_voltage, cia402::VOLTAGE_ENABLED),
                (self.bus_commands(), cia402::REMOTE),
                (self.at_speed, cia402::TARGET_REACHED),
                (self.standstill, cia402::STANDSTILL),
                (self.speed_is_assumed(), cia402::SPEED_ASSUMED),
            ])
    }
}

/// The bits whose condition holds.
fn bits(of: [(bool, u16); 5]) -> u16 {
    of.into_iter().filter(|(holds, _)| *holds).fold(0, |word, (_, bit)| word | bit)
}

impl Row {
    /// The word at this register number, if it belongs to the row.
    fn word(&self, at: u16, view: &View<'_>) -> Option<u16> {
        let place = at.checked_sub(self.at).filter(|place| *place < self.words())?;
        Some(match self.shown {
            Shown::Number(parts, value) => counts(value(view), parts),
            Shown::Word(value) => value(view),
            Shown::Double(value) => half(value(view), place),
        })
    }

    /// Number of registers of the row.
    pub fn words(&self) -> u16 {
        if matches!(self.shown, Shown::Double(_)) { 2 } else { 1 }
    }
}

/// A number in fractions of its unit, rounded; a negative one as two's complement.
fn counts(value: f32, parts: u16) -> u16 {
    let counts = libm::roundf(value * f32::from(parts));
    // The casts saturate.
    if counts < 0.0 { counts as i16 as u16 } else { counts as u16 }
}

/// The upper half of 32 bits at an even place, the lower at an odd one.
fn half(bits: u32, place: u16) -> u16 {
    if place.is_multiple_of(2) { (bits >> 16) as u16 } else { bits as u16 }
}

/// A part of the version.
fn version(text: &str) -> u16 {
    text.parse().unwrap_or(u16::MAX)
}

/// Place of the board in its list.
fn board(settings: &FirmwareSettings) -> u16 {
    keys::find(keys::BOARD).map_or(0, |key| to_float(key, settings) as u16)
}
