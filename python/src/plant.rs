//! The motor alone.

use std::f64::consts::TAU;

use hil_sim::config::plant_settings;
use hil_sim::error::{self, Error};
use hil_sim::plant::{self, Complex, Load};
use numpy::{IntoPyArray as _, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::config::Config;
use crate::{check, raised};

/// The motor of a configuration with its shaft, between voltages and currents: without inverter and sensors.
#[pyclass(module = "induction_drive")]
pub struct Plant {
    plant: plant::Plant,
    substeps: u32,
}

/// A load by the words of `load.mode`: against a torque, Nm, `locked`, or held at a speed, rpm.
pub fn load(mode: &str, value: f64) -> PyResult<Load> {
    match mode {
        "free" => Ok(Load::Free { torque: value }),
        "locked" => Ok(Load::Locked),
        "speed" => Ok(Load::Speed { speed: value * TAU / 60.0 }),
        _ => Err(PyValueError::new_err(error::unknown("load", mode, &["free", "locked", "speed"]))),
    }
}

#[pymethods]
impl Plant {
    #[new]
    fn new(config: &Config) -> PyResult<Self> {
        let settings = plant_settings(&config.values);
        let plant = plant::Plant::new(&settings, 1).map_err(Error::refused).map_err(raised)?;
        Ok(Self { plant, substeps: settings.substeps })
    }

    /// Applies space vectors of the voltage, V, complex in the stator frame and amplitude-invariant, each for `step_s` seconds. Returns
    /// arrays with the values at the end of each step: `current` (A) and `flux` of the rotor (Wb) as space vectors, `torque_nm`,
    /// `speed_rpm`, and `angle_rad` of the shaft.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        voltages: PyReadonlyArray1<'py, Complex>,
        step_s: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        check("step_s", step_s, (1e-7, 1e-3), "s")?;
        let (voltages, plant, times) = (voltages.as_slice()?, &mut self.plant, self.substeps);
        let seen = |&voltage: &Complex| {
            (0..times).for_each(|_| plant.step_motor(voltage, step_s / f64::from(times)));
            let rpm = plant.mechanical_speed() * 60.0 / TAU;
            let vectors = [plant.current(), plant.rotor_flux()];
            (vectors, [plant.torque(), rpm, plant.mechanical_angle()])
        };
        let course: Vec<_> = py.detach(|| voltages.iter().map(seen).collect());
        let arrays = PyDict::new(py);
        for (n, name) in ["current", "flux"].into_iter().enumerate() {
            let vectors: Vec<Complex> = course.iter().map(|(vectors, _)| vectors[n]).collect();
            arrays.set_item(name, vectors.into_pyarray(py))?;
        }
        for (n, name) in ["torque_nm", "speed_rpm", "angle_rad"].into_iter().enumerate() {
            let values: Vec<f64> = course.iter().map(|(_, values)| values[n]).collect();
            arrays.set_item(name, values.into_pyarray(py))?;
        }
        Ok(arrays)
    }

    /// Couples another load: `free` against a torque in Nm, `locked`, or held at a `speed` in rpm.
    #[pyo3(signature = (mode, value=0.0))]
    fn set_load(&mut self, mode: &str, value: f64) -> PyResult<()> {
        self.plant.set_load(load(mode, value)?).map_err(Error::refused).map_err(raised)
    }
}
