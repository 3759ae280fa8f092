//! The power stages on which the chip can be mounted: gate drivers, current sensors and dc link.
//!
//! A [`PowerStage`] is a description of hardware with its own sources. It is not read from the board file of the
//! firmware: the two are independent, and the tests find their differences.

mod boards;
pub mod bridge;
pub mod driver;
pub mod shunts;
pub mod watch;

use drive_settings::{Ntc, Settings};
use hil_sim::input::Input;
use hil_sim::plant::{MeasurementSettings, PlantSettings};
use hil_sim::{Config, Error};
use induction_drive::boards::{self as boards_of_the_firmware, Board};

pub use boards::{ALL, REFERENCE};
use driver::Driver;
use shunts::Shunts;
pub use stm32g4_unicorn::chip::CODES;
use stm32g4_unicorn::chip::pins::Pin;
use stm32g4_unicorn::circuit::{SUPPLY_V, Source};

/// A pin with its alternate function for TIM1 (datasheet).
pub type TimerPin = (Pin, u32);

/// The connections of the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiring {
    /// The inputs of the drivers: high and low side of the legs a, b and c.
    pub gates: [[TimerPin; 2]; 3],
    /// The fault input.
    pub fault: TimerPin,
    /// Channels of the currents a, b and c: ADC1, ADC2 and both.
    pub currents: [usize; 3],
    /// Channel of the dc link at ADC1.
    pub dc_link: usize,
    /// Channel of the heat sink at ADC2.
    pub heat_sink: usize,
    /// The precharge relay.
    pub relay: Pin,
    /// Crystal, Hz.
    pub crystal_hz: u32,
}

/// Channels of the pins that can be compared: PA0, PC1, PA1 (datasheet).
pub const COMPARED: [usize; 3] = [1, 7, 2];

/// Reference voltage of the ADCs, V: the supply of the Nucleo board.
pub const REFERENCE_V: f64 = SUPPLY_V;

/// Limits of the gate signals, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateLimits {
    /// Shortest time for which both switches of a leg are off at a change.
    pub dead_time_s: f64,
    /// Shortest pulse that the drivers pass on.
    pub pulse_s: f64,
}

/// The voltage at the switches of the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switches {
    /// Absolute maximum, drain to source or collector to emitter, V.
    pub rated_v: f64,
    /// Voltage that a turn-off adds to the dc link, V per ampere that is switched off: the inductance of the loop
    /// divided by the time in which the current falls.
    pub ringing_v_per_a: f64,
}

impl Switches {
    /// Returns the highest voltage at a switch for this dc-link voltage, V, with these currents of the legs or none, A.
    pub fn stress_v(&self, dc_link: f64, currents: [f64; 3]) -> f64 {
        let largest = currents.into_iter().fold(0.0, |most, current| current.abs().max(most));
        dc_link + self.ringing_v_per_a * largest
    }
}

/// A power stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerStage {
    /// Name on the command line, which is that of the firmware's board.
    pub name: &'static str,
    /// The connections of the chip.
    pub wiring: Wiring,
    /// The drivers of the gates.
    pub driver: Driver,
    /// Limits of the gate signals that the switches permit.
    pub limits: GateLimits,
    /// Voltage limits of the switches.
    pub switches: Switches,
    /// The circuit at the pin of the dc link.
    pub dc_link_pin: Source,
    /// Resistor from the fault input to the supply of the chip, ohm.
    pub fault_pull_ohm: f64,
    /// Pins that the board ties to nets of other signals: they stay analog.
    pub analog_only: &'static [(usize, u32)],
    /// Pins of the terminal strip, as in "A8 - C0", with `-` for none: contacts to ground, outputs, and analog inputs
    /// including that of the motor's sensor.
    pub terminals: [&'static str; 3],
    /// Thermistor of the heat sink.
    pub ntc: Ntc,
    /// Shunts below the three low sides; if none, sensors in the lines a and b, as in the configuration.
    pub shunts: Option<Shunts>,
    /// Dc-link voltage per volt at the chip's pin; if none, as in the configuration.
    pub dc_link_divider: Option<f64>,
    /// Delay of the drivers, s, and voltage drop of a switch against the current, V; if none, as in the configuration.
    pub delay_and_drop: Option<(f64, f64)>,
    /// A suitable motor, by the name of its file; if none, the dissertation's motor.
    pub motor: Option<&'static str>,
    /// Supply voltage of the dc link, V; if none, as in the motor's file.
    pub supply_v: Option<f64>,
}

impl PowerStage {
    /// Returns the power stage with this name.
    ///
    /// # Errors
    /// [`Error::Refused`] with the names of all power stages.
    pub fn named(name: &str) -> Result<&'static Self, Error> {
        ALL.into_iter().find(|stage| stage.name == name).ok_or_else(|| {
            let names = ALL.map(|stage| stage.name).join(", ");
            Error::Refused(format!("--board {name}: no such board; there are {names}"))
        })
    }

    /// Returns the board of the firmware with this name.
    pub fn board(&self) -> &'static Board {
        // A test checks that each power stage has one.
        boards_of_the_firmware::find(self.name).unwrap_or(boards_of_the_firmware::SELECTED)
    }

    /// Returns the settings with which the image for this board starts.
    pub fn firmware_settings(&self) -> Settings {
        induction_drive::board::settings_of(self.board())
    }

    /// Returns the configuration with a suitable motor and dc link.
    ///
    /// # Errors
    /// The motor's file does not exist, or the voltage is out of its range.
    pub fn config(&self) -> Result<Config, Error> {
        Config::load(self.motor, None, &self.assignments())
    }

    /// Gives a session the suitable motor and dc link, unless it has a motor.
    pub fn suit(&self, input: &mut Input) {
        if input.motor.is_none() {
            input.motor = self.motor.map(str::to_owned);
            input.assignments.splice(0..0, self.assignments());
        }
    }

    /// Returns the voltage rating of its switches, V. If the configuration states the divider of a stage, its switches suit it.
    pub fn rated_v(&self, plant: &PlantSettings) -> f64 {
        let own = MeasurementSettings::default().dc_link_v;
        let scale = self.dc_link_divider.map_or(plant.measurement.dc_link_v / own, |_| 1.0);
        scale * self.switches.rated_v
    }

    fn assignments(&self) -> Vec<String> {
        self.supply_v.iter().map(|volts| format!("inverter.dc_link_v={volts}")).collect()
    }
}
