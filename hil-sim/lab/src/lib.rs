//! The laboratory: experiments that repeat figures and tables of the two sources, and the identification of the 1996 paper.
//! The command line and the experiments of a drive in use are in `hil-sim`.
#![deny(clippy::use_debug)]

pub mod adc_calibration;
pub mod angle_identification;
pub mod as_printed;
pub mod dead_time;
pub mod demodulators;
pub mod filters;
pub mod identification;
pub mod identify_continuous;
pub mod identify_discrete;
pub mod identify_machine;
pub mod identify_recursive;
pub mod identify_trace;
pub mod identify_validate;
pub mod injection_map;
pub mod learn_reference;
pub mod measured_motors;
pub mod measured_start;
pub mod modulation;
pub mod motor_tests;
pub mod online_tracking;
pub mod perturbation;
pub mod pi_design;
pub mod plant_identification;
pub mod poles;
mod prelude;
pub mod recomputed;
pub mod saliency;
pub mod source;
pub mod texts;
pub mod warming_rotor;
