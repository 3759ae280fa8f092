//! The drive on its simulated motor.

use drive_core::Command;
use hil_sim::experiments::scenario::{QUANTITIES, Seen};
use hil_sim::rig::{self, Point, RATE_HZ};
use numpy::IntoPyArray as _;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::config::Config;
use crate::drive::named;
use crate::{check, plant, raised};

/// Longest run of one call, s: all its columns take 700 MB.
const LONGEST_S: f64 = 600.0;

/// The drive on inverter, motor, load and sensors of a configuration, as the experiments run it. With `prepare.learn` it has learned
/// first, with the shaft locked.
#[pyclass(module = "induction_drive")]
pub struct Rig(pub rig::Rig);

/// The quantities of a point without a reference.
fn seen(point: &Point) -> Seen<'_> {
    Seen { point, reference: f64::NAN, actual: f64::NAN }
}

#[pymethods]
impl Rig {
    #[new]
    #[pyo3(signature = (config, seed=1))]
    fn new(py: Python<'_>, config: &Config, seed: u64) -> PyResult<Self> {
        py.detach(|| rig::Rig::from_config(&config.values, seed)).map(Self).map_err(raised)
    }

    /// Starts in a mode, `torque`, `speed`, `position` or `vf`, and runs until the drive regulates.
    fn start(&mut self, py: Python<'_>, mode: &str) -> PyResult<()> {
        let Command::Start(mode) = named(&format!("start {mode}"), 0.0)? else { return Ok(()) };
        let rig = &mut self.0;
        py.detach(|| rig.start(mode)).map_err(raised)
    }

    /// Couples another load, as `Plant.set_load` does.
    #[pyo3(signature = (mode, value=0.0))]
    fn set_load(&mut self, mode: &str, value: f64) -> PyResult<()> {
        self.0.set_load(plant::load(mode, value)?).map_err(raised)
    }

    /// Runs for this time and returns arrays with a value for each control period, 1/6000 s: `time_s`, and the columns of a scenario that
    /// need no reference. `fault` says afterwards whether the drive has tripped.
    fn run<'py>(&mut self, py: Python<'py>, seconds: f64) -> PyResult<Bound<'py, PyDict>> {
        check("seconds", seconds, (0.0, LONGEST_S), "s")?;
        let rig = &mut self.0;
        let points = py.detach(|| {
            let mut points = Vec::with_capacity((seconds * RATE_HZ) as usize + 1);
            rig.run(seconds, |point| points.push(*point));
            points
        });
        let column = |of: &dyn Fn(&Point) -> f64| {
            points.iter().map(of).collect::<Vec<f64>>().into_pyarray(py)
        };
        let arrays = PyDict::new(py);
        arrays.set_item("time_s", column(&|point| point.t))?;
        for quantity in QUANTITIES {
            if !(quantity.of)(&seen(&Point::default())).is_nan() {
                arrays.set_item(quantity.name, column(&|point| (quantity.of)(&seen(point))))?;
            }
        }
        Ok(arrays)
    }
}
