//! The control alone.

use drive_core::io::Measured;
use drive_core::{Abc, Accepted, Command, Hardware, Mode, Stop};
use hil_sim::config::built;
use hil_sim::error::unknown;
use hil_sim::rig::{RATE_HZ, fault_text};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::config::Config;
use crate::raised;

/// Commands by their name at the console; a reference is that of the value.
#[rustfmt::skip] // one a line
const COMMANDS: &[(&str, fn(f32) -> Command)] = &[
    ("torque", Command::Torque),
    ("speed", Command::Speed),
    ("position", Command::Position),
    ("start torque", |_| Command::Start(Mode::Torque)),
    ("start speed", |_| Command::Start(Mode::Speed)),
    ("start position", |_| Command::Start(Mode::Position)),
    ("start vf", |_| Command::Start(Mode::VoltsPerHertz)),
    ("stop", |_| Command::Stop(Stop::Coast)),
    ("stop ramp", |_| Command::Stop(Stop::Ramp)),
    ("stop quick", |_| Command::Stop(Stop::Quick)),
    ("relock", |_| Command::Relock),
    ("clear", |_| Command::Clear),
];

/// The command with this name.
pub fn named(name: &str, value: f32) -> PyResult<Command> {
    let found = COMMANDS.iter().find(|(known, _)| *known == name);
    let names = || COMMANDS.iter().map(|(known, _)| *known).collect::<Vec<_>>();
    let error = || PyValueError::new_err(unknown("command", name, &names()));
    Ok((found.ok_or_else(error)?.1)(value))
}

/// Gives the drive a command; the value that holds now where it was limited.
pub fn give(drive: &mut drive_core::Drive, name: &str, value: f32) -> PyResult<Option<f32>> {
    match drive.command(&named(name, value)?) {
        Ok(Accepted::AsGiven) => Ok(None),
        Ok(Accepted::Limited(to)) => Ok(Some(to)),
        Err(why) => Err(PyRuntimeError::new_err(format!("the drive refuses {name}: {why}"))),
    }
}

/// What the drive estimated and wanted in its last period with the outputs on: angle in electrical turns, frequencies in Hz.
pub fn seen<'py>(py: Python<'py>, drive: &drive_core::Drive) -> PyResult<Bound<'py, PyDict>> {
    let seen = drive.telemetry();
    let values = PyDict::new(py);
    values.set_item("flux_angle_turns", seen.phi.to_turns())?;
    for (name, value) in [
        ("flux_hz", seen.flux_freq * RATE_HZ as f32),
        ("rotor_hz", seen.rotor_freq * RATE_HZ as f32),
        ("direct_reference_a", seen.reference.d),
        ("torque_reference_a", seen.reference.q),
        ("direct_current_a", seen.current.d),
        ("torque_current_a", seen.current.q),
        ("direct_voltage_v", seen.voltage.d),
        ("torque_voltage_v", seen.voltage.q),
        ("dc_link_v", seen.dc_link),
        ("saliency", seen.saliency),
        ("saliency_loss", seen.saliency_loss),
        ("position_turns", seen.turns),
    ] {
        values.set_item(name, value)?;
    }
    Ok(values)
}

/// The control of the firmware alone, between measured values and duties, with the settings of a configuration.
#[pyclass(module = "induction_drive")]
pub struct Drive(drive_core::Drive);

#[pymethods]
impl Drive {
    #[new]
    fn new(config: &Config) -> PyResult<Self> {
        built(&config.values.drive).map(|built| Self(drive_core::Drive::new(built))).map_err(raised)
    }

    /// One control period: from the currents of phases a and b, A, and the dc link, V, at its beginning to the duties of the three
    /// legs, 0 to 1, of the next period; None: all switches are off at once. `encoder`: its count, four a line.
    #[pyo3(signature = (current_a, current_b, dc_link_v, encoder=0))]
    fn step(
        &mut self,
        current_a: f32,
        current_b: f32,
        dc_link_v: f32,
        encoder: u32,
    ) -> Option<[f32; 3]> {
        let phases = Abc { a: current_a, b: current_b, c: -current_a - current_b };
        // The heat sink bears all of the current.
        let (third, dc_link, heat_sink) = (phases.c, dc_link_v, 1.0);
        let (hardware, fault) = (Hardware::empty(), None);
        self.0
            .step(&Measured { phases, third, dc_link, heat_sink, encoder, hardware, fault })
            .duties
    }

    /// Gives a command by its name at the console: `torque`, a current in A, `speed` in rpm, `position` in turns, `start torque`,
    /// `stop quick`, `clear` and others. Returns the value that holds where it was limited, else None.
    #[pyo3(signature = (name, value=0.0))]
    fn command(&mut self, name: &str, value: f32) -> PyResult<Option<f32>> {
        give(&mut self.0, name, value)
    }

    /// What it estimated and wanted in the last period with the outputs on.
    fn telemetry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        seen(py, &self.0)
    }

    /// Its state in words.
    #[getter]
    fn state(&self) -> String {
        self.0.state().to_string()
    }

    /// The fault with which it has stopped itself, with its number, or None.
    #[getter]
    fn fault(&self) -> Option<String> {
        self.0.state().fault().map(fault_text)
    }
}
