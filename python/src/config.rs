//! The options that describe a simulation.

use std::path::PathBuf;

use drive_settings::value::Words as _;
use hil_sim::config::{Key, Value};
use hil_sim::input::Input;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::raised;

/// A motor with inverter, sensors and load, and its drive, as the options of `cargo sim` describe them: `motor` is a name that `cargo sim
/// motors` shows or a file, `file` a TOML file of keys, `set` a dict of keys, which has priority.
#[pyclass(frozen, module = "induction_drive")]
pub struct Config {
    /// The options.
    pub input: Input,
    /// The values that follow from the options.
    pub values: hil_sim::Config,
}

#[pymethods]
impl Config {
    #[new]
    #[pyo3(signature = (motor=None, plant=None, set=None, file=None))]
    fn new(
        motor: Option<String>,
        plant: Option<String>,
        set: Option<&Bound<'_, PyDict>>,
        file: Option<PathBuf>,
    ) -> PyResult<Self> {
        let assigned = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            Ok(match value.extract::<bool>() {
                Ok(on) => format!("{key}={on}"),
                Err(_) => format!("{key}={value}"),
            })
        };
        let assignments = set.into_iter().flatten().map(assigned).collect::<PyResult<_>>()?;
        let input =
            Input { motor, plant, assignments, config: file, quiet: true, ..Input::default() };
        let values = input.config().map_err(raised)?;
        Ok(Self { input, values })
    }

    /// Every key with its value: a number, a word, True, False, or None where it follows from others.
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let settings = PyDict::new(py);
        for key in Key::all() {
            let name = key.assigned_name();
            match key.get(&self.values) {
                Value::Number(number) => settings.set_item(name, number)?,
                Value::Whole(number) => settings.set_item(name, number)?,
                Value::Word(word) if key.words() == bool::WORDS => {
                    settings.set_item(name, word == true.word())?;
                }
                Value::Word(word) => settings.set_item(name, word)?,
                Value::Auto => settings.set_item(name, py.None())?,
            }
        }
        Ok(settings)
    }

    fn __repr__(&self) -> String {
        format!("<Config: {}>", self.values.changes().join(" "))
    }
}
