//! The motor alone.

use std::f64::consts::TAU;

use hil_sim::config::plant_settings;
use hil_sim::error::Error;
use hil_sim::plant::{
    Complex, ElectricalState as _, EnergyMachine, Load, Machine, MachineModel, MotorModel,
};
use hil_sim::{error, plant};
use numpy::{IntoPyArray as _, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::config::Config;
use crate::{check, raised};

/// Either machine model.
enum Motor {
    A(MotorModel<Machine>),
    Energy(Box<MotorModel<EnergyMachine>>),
}

/// The motor of a configuration with its shaft, between voltages and currents: without inverter and sensors.
#[pyclass(module = "induction_drive")]
pub struct Plant {
    motor: Motor,
    substeps: u32,
}

/// Space vectors of current and flux, torque, speed and angle over time.
#[derive(Default)]
struct Course {
    vectors: [Vec<Complex>; 2],
    values: [Vec<f64>; 3],
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

fn integrated<M: MachineModel>(
    motor: &mut MotorModel<M>,
    voltages: &[Complex],
    (h, times): (f64, u32),
) -> Course {
    let mut course = Course::default();
    for &voltage in voltages {
        (0..times).for_each(|_| motor.step(voltage, h));
        let state = &motor.state;
        let vectors = [state.electrical.current(), state.electrical.rotor_flux()];
        let torque = motor.machine.torque(&state.electrical);
        let values = [torque, state.speed * 60.0 / TAU, state.angle];
        course.vectors.iter_mut().zip(vectors).for_each(|(all, one)| all.push(one));
        course.values.iter_mut().zip(values).for_each(|(all, one)| all.push(one));
    }
    course
}

#[pymethods]
impl Plant {
    #[new]
    fn new(config: &Config) -> PyResult<Self> {
        let settings = plant_settings(&config.values);
        let plant = plant::Plant::new(&settings, 1).map_err(Error::refused).map_err(raised)?;
        let motor = match (plant.model_a(), plant.energy_model()) {
            (Some(motor), _) => Motor::A(*motor),
            (None, Some(motor)) => Motor::Energy(Box::new(*motor)),
            (None, None) => return Err(PyValueError::new_err("the motor has no model")),
        };
        Ok(Self { motor, substeps: settings.substeps })
    }

    /// Applies space vectors of the voltage, V, complex in the stator frame and amplitude-invariant, each for `step_s` seconds. Returns
    /// arrays with the values at the end of each: `current` (A) and `flux` of the rotor (Wb) as space vectors, `torque_nm`,
    /// `speed_rpm`, and `angle_rad` of the shaft.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        voltages: PyReadonlyArray1<'py, Complex>,
        step_s: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        check("step_s", step_s, (1e-7, 1e-3), "s")?;
        let voltages = voltages.as_slice()?;
        let (h, times) = (step_s / f64::from(self.substeps), self.substeps);
        let motor = &mut self.motor;
        let course = py.detach(|| match motor {
            Motor::A(motor) => integrated(motor, voltages, (h, times)),
            Motor::Energy(motor) => integrated(motor, voltages, (h, times)),
        });
        let arrays = PyDict::new(py);
        for (name, vector) in ["current", "flux"].into_iter().zip(course.vectors) {
            arrays.set_item(name, vector.into_pyarray(py))?;
        }
        for (name, value) in ["torque_nm", "speed_rpm", "angle_rad"].into_iter().zip(course.values)
        {
            arrays.set_item(name, value.into_pyarray(py))?;
        }
        Ok(arrays)
    }

    /// Couples another load: `free` against a torque in Nm, `locked`, or held at a `speed` in rpm.
    #[pyo3(signature = (mode, value=0.0))]
    fn set_load(&mut self, mode: &str, value: f64) -> PyResult<()> {
        let load = load(mode, value)?;
        fn set<M: MachineModel>(motor: &mut MotorModel<M>, load: Load) -> Result<(), Error> {
            motor.mechanics.set_load(load).map_err(Error::refused)?;
            motor.hold_speed();
            Ok(())
        }
        match &mut self.motor {
            Motor::A(motor) => set(motor, load),
            Motor::Energy(motor) => set(motor, load),
        }
        .map_err(raised)
    }
}
