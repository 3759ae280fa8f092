//! The module `induction_drive` of Python: the drive and its simulated motor on numpy arrays, and the experiments of `cargo sim`.
//!
//! Each class is one of the simulator or of the control, and gives the same bits. An error that the user can correct is a `ValueError`
//! with the words of `cargo sim`; a command that the drive refuses and a failure are a `RuntimeError`.

mod config;
mod drive;
mod plant;
mod rig;
mod talk;

use drive_settings::{SETTINGS, value};
use hil_sim::error::Error;
use hil_sim::{cli, experiments};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

use config::Config;

/// An induction motor that holds torque at zero speed without a sensor: the drive of the firmware on a simulated motor.
#[pymodule]
mod induction_drive {
    #[pymodule_export]
    use super::{
        commission, config::Config, drive::Drive, motor_file, plant::Plant, rig::Rig, run,
    };
    /// Control period, s.
    #[pymodule_export]
    const PERIOD_S: f64 = 1.0 / hil_sim::rig::RATE_HZ;
}

/// The exception of an error of the simulator.
fn raised(error: Error) -> PyErr {
    match error.exit_code() {
        2 => PyValueError::new_err(error.to_string()),
        _ => PyRuntimeError::new_err(error.to_string()),
    }
}

/// Fails unless a number is in its range; an infinite upper limit means none.
fn check(name: &str, value: f64, (min, max): (f64, f64), unit: &str) -> PyResult<()> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let text = format!("{name} = {value}: allowed is {min} to {max} {unit}");
    Err(PyValueError::new_err(text))
}

/// Runs an experiment, a group of them or the TOML file of a scenario, and returns the object that `cargo sim run NAME --json` prints.
/// `input` is the file of an experiment that takes one. If the drive lost the lock in a run, `faults` and `metrics` say so.
#[pyfunction]
#[pyo3(signature = (experiment, config=None, *, seed=1, seconds=None, input=None))]
fn run<'py>(
    py: Python<'py>,
    experiment: String,
    config: Option<&Config>,
    seed: u64,
    seconds: Option<f64>,
    input: Option<PathBuf>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = config.map(|config| config.input.clone()).unwrap_or_default();
    let options = hil_sim::input::Input { seed, seconds, quiet: true, ..options };
    let json = py.detach(|| cli::json(experiment, input, options)).map_err(raised)?;
    py.import("json")?.call_method1("loads", (json,))
}

/// Returns the text of a motor file, for `Config(motor=FILE)`, made from a nameplate such as `750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm`.
/// Circuit and dc link are estimated, and marked as such.
#[pyfunction]
fn motor_file(nameplate: &str) -> PyResult<String> {
    hil_sim::config::motors::motor_file(nameplate).map_err(raised)
}

/// Commissions the motor of a configuration at rest, with a drive that knows its nameplate, and returns the results and the settings that
/// follow from them, by key. `Config(set=...)` takes them, for a drive that uses them.
#[pyfunction]
#[pyo3(signature = (config, seed=1))]
fn commission<'py>(py: Python<'py>, config: &Config, seed: u64) -> PyResult<Bound<'py, PyDict>> {
    let values = &config.values;
    let settings =
        py.detach(|| experiments::commission::commissioned(values, seed)).map_err(raised)?;
    let found = PyDict::new(py);
    for entry in SETTINGS {
        let (is, was) = (entry.get(&settings), entry.get(&values.drive));
        if let value::Value::Number(number) = is
            && (is != was || entry.name.starts_with("motor."))
        {
            // The shortest decimal fraction that stands for the number.
            let number: f64 = number.to_string().parse()?;
            found.set_item(format!("drive.{}", entry.name), number)?;
        }
    }
    Ok(found)
}
