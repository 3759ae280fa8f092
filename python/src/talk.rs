//! Commands to a drive and its signals, for a drive alone and for one on its motor.

use drive_core::Accepted;
use hil_sim::rig::{RATE_HZ, fault_text};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::drive::{Drive, named};
use crate::rig::Rig;

/// The methods of a class that has a drive.
macro_rules! conversation {
    ($class:ident, $($drive:tt)+) => {
        #[pymethods]
        impl $class {
            /// Gives a command by its name at the console: `torque`, a current in A, `speed` in rpm, `position` in turns, `start torque`,
            /// `stop quick`, `clear` and others. Returns the value in force if the value was limited, else None.
            #[pyo3(signature = (name, value=0.0))]
            fn command(&mut self, name: &str, value: f32) -> PyResult<Option<f32>> {
                let refused = |why| PyRuntimeError::new_err(format!("the drive refuses {name}: {why}"));
                let accepted = self.$($drive)+.command(&named(name, value)?).map_err(refused)?;
                Ok(if let Accepted::Limited(to) = accepted { Some(to) } else { None })
            }

            /// Estimates and references of the last period with the outputs on; angle in electrical turns, frequencies in Hz.
            fn telemetry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
                let (seen, hz, values) = (self.$($drive)+.telemetry(), RATE_HZ as f32, PyDict::new(py));
                for (name, value) in [
                    ("flux_angle_turns", seen.phi.to_turns()),
                    ("flux_hz", seen.flux_freq * hz),
                    ("rotor_hz", seen.rotor_freq * hz),
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

            /// State of the drive in words.
            #[getter]
            fn state(&self) -> String {
                self.$($drive)+.state().to_string()
            }

            /// The fault by which the drive has tripped, with its number, or None.
            #[getter]
            fn fault(&self) -> Option<String> {
                self.$($drive)+.state().fault().map(fault_text)
            }
        }
    };
}
conversation!(Drive, 0);
conversation!(Rig, 0.drive);
