//! The control alone.

use drive_core::io::Measured;
use drive_core::{Abc, Command, Hardware, Mode, Stop};
use hil_sim::config::built;
use hil_sim::error::unknown;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::config::Config;
use crate::raised;

/// A command with a value, by its name.
type Named = (&'static str, fn(f32) -> Command);

/// Commands by their name at the console; a set-point command uses the value.
#[rustfmt::skip] // one a line
const COMMANDS: &[Named] = &[
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
    ("stop now", |_| Command::Stop(Stop::Now)),
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

/// The control of the firmware alone, between measured values and duties, with the settings of a configuration.
#[pyclass(module = "induction_drive")]
pub struct Drive(pub drive_core::Drive);

#[pymethods]
impl Drive {
    #[new]
    fn new(config: &Config) -> PyResult<Self> {
        built(&config.values.drive).map(|built| Self(drive_core::Drive::new(built))).map_err(raised)
    }

    /// One control period: from the currents of phases a and b, A, and the dc link, V, at its beginning to the duties of the three legs,
    /// 0 to 1, of the next period; None: all switches are off at once. `encoder`: its count, four per line.
    #[pyo3(signature = (current_a, current_b, dc_link_v, encoder=0))]
    fn step(
        &mut self,
        current_a: f32,
        current_b: f32,
        dc_link_v: f32,
        encoder: u32,
    ) -> Option<[f32; 3]> {
        let phases = Abc { a: current_a, b: current_b, c: -current_a - current_b };
        // The heat sink allows the full current.
        let (third, dc_link, heat_sink) = (phases.c, dc_link_v, 1.0);
        let (hardware, fault) = (Hardware::empty(), None);
        self.0
            .step(&Measured { phases, third, dc_link, heat_sink, encoder, hardware, fault })
            .duties
    }
}
