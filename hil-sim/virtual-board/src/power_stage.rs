//! The power stages that the chip can be mounted on: gate drivers, current sensors and dc link.
//!
//! A [`PowerStage`] is a statement about hardware with sources of its own. It is not read from the board file of the
//! firmware: the two are independent, and the tests find where they differ.

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

/// The six inputs of the drivers at the chip: port (0 is A) and number of the pins of the high and the low side of the
/// legs a, b and c. ST's morpho connector for motor control, the same on all boards here: PA8, PA7; PA9, PB0; PA10, PB1.
pub const GATE_PINS: [[(usize, u32); 2]; 3] =
    [[(0, 8), (0, 7)], [(0, 9), (1, 0)], [(0, 10), (1, 1)]];
/// Alternate function that connects these pins with TIM1 (datasheet).
pub const GATE_FUNCTION: u32 = 6;

/// The analog signals at the chip, by their channel of ADC1 and ADC2 alike: PA0, PC1, PC0, PA1, PC2 (datasheet).
pub mod channel {
    /// Currents of a, b and c.
    pub const CURRENTS: [usize; 3] = [1, 7, 6];
    /// Dc link.
    pub const DC_LINK: usize = 2;
    /// Heat sink.
    pub const HEAT_SINK: usize = 8;
}

/// Reference voltage of the converters, V: the 3.3 V supply of the Nucleo board.
pub const REFERENCE_V: f64 = 3.3;
/// Codes of the converters.
pub const CODES: f64 = 4096.0;

/// Limits of the gate signals, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateLimits {
    /// Shortest time in which both switches of a leg are off at a change.
    pub dead_time_s: f64,
    /// Shortest pulse that the drivers pass on.
    pub pulse_s: f64,
}

/// The voltage at the switches of the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switches {
    /// Absolute maximum, drain to source or collector to emitter, V.
    pub rated_v: f64,
    /// What a turn-off adds to the dc link, V per ampere that it switches off: the inductance of the loop over the time in which
    /// the current falls.
    pub ringing_v_per_a: f64,
}

impl Switches {
    /// Highest voltage at a switch beside this dc link, V, with these currents of the legs or none, A.
    pub fn stress_v(&self, dc_link: f64, currents: [f64; 3]) -> f64 {
        let largest = currents.into_iter().fold(0.0, |most, current| current.abs().max(most));
        dc_link + self.ringing_v_per_a * largest
    }
}

/// The sensors of the phase currents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensors {
    /// In the lines a and b, as the configuration of the plant describes them.
    InLine,
    /// Below the three low sides.
    LowSide(Shunts),
}

/// What the pin of the dc link is connected to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DcLinkPin {
    /// A divider with this resistance, seen from the pin, and a capacitor to ground.
    Divider {
        /// Ohm.
        ohm: f64,
        /// Farad.
        farad: f64,
    },
    /// An amplifier or an isolated sensor drives it: a pull of the chip does not move it.
    Driven,
}

/// A power stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerStage {
    /// Name at the command line, that of the firmware's board.
    pub name: &'static str,
    /// The drivers of the gates.
    pub driver: Driver,
    /// The signals that the switches stand.
    pub limits: GateLimits,
    /// The voltage that they stand.
    pub switches: Switches,
    /// The pin of the dc link.
    pub dc_link_pin: DcLinkPin,
    /// Resistor from the fault input to the supply of the chip, ohm.
    pub fault_pull_ohm: f64,
    /// Pins, as in [`GATE_PINS`], that it ties to nets of others: they stay analog.
    pub analog_only: &'static [(usize, u32)],
    /// Pins of the terminal strip, as in "A8 - C0", `-` for none: contacts to ground, outputs, and its analog inputs with that
    /// of the motor's sensor.
    pub terminals: [&'static str; 3],
    /// Thermistor of the heat sink.
    pub ntc: Ntc,
    /// The current sensors.
    pub sensors: Sensors,
    /// Voltage at the dc link for each volt at the chip's pin; none as the configuration says.
    pub dc_link_divider: Option<f64>,
    /// Delay of the drivers, s, and drop of a switch against the current, V; none as the configuration says.
    pub delay_and_drop: Option<(f64, f64)>,
    /// A motor that suits it, by the name of its file; none is the dissertation's.
    pub motor: Option<&'static str>,
    /// Supply of the dc link, V; none as the motor's file says.
    pub supply_v: Option<f64>,
}

impl PowerStage {
    /// The power stage with this name.
    ///
    /// # Errors
    /// [`Error::Refused`] with the names of all.
    pub fn named(name: &str) -> Result<&'static Self, Error> {
        ALL.into_iter().find(|stage| stage.name == name).ok_or_else(|| {
            let names = ALL.map(|stage| stage.name).join(", ");
            Error::Refused(format!("--board {name}: no such board; there are {names}"))
        })
    }

    /// The board of the firmware with this name.
    pub fn board(&self) -> &'static Board {
        // A test finds one for each power stage.
        boards_of_the_firmware::find(self.name).unwrap_or(boards_of_the_firmware::SELECTED)
    }

    /// The settings that the image for this board starts with.
    pub fn firmware_settings(&self) -> Settings {
        induction_drive::board::settings_of(self.board())
    }

    /// The configuration with a motor and a dc link that suit it.
    ///
    /// # Errors
    /// The motor's file is not there, or the voltage is out of its range.
    pub fn config(&self) -> Result<Config, Error> {
        Config::load(self.motor, None, &self.assignments())
    }

    /// Gives a session the motor and the dc link that suit it, unless it has a motor.
    pub fn suit(&self, input: &mut Input) {
        if input.motor.is_none() {
            input.motor = self.motor.map(str::to_owned);
            input.assignments.splice(0..0, self.assignments());
        }
    }

    /// What its switches stand, V. A stage whose divider the configuration states has switches that suit it.
    pub fn rated_v(&self, plant: &PlantSettings) -> f64 {
        let own = MeasurementSettings::default().dc_link_v;
        let scale = self.dc_link_divider.map_or(plant.measurement.dc_link_v / own, |_| 1.0);
        scale * self.switches.rated_v
    }

    fn assignments(&self) -> Vec<String> {
        self.supply_v.iter().map(|volts| format!("inverter.dc_link_v={volts}")).collect()
    }
}
