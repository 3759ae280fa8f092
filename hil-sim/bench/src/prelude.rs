//! The names that most experiments use.

pub use std::f64::consts::TAU;

pub use drive_core::printed::DemodulatorKind;
pub use drive_core::{Accepted, AngleSource, Command, Drive, Fault, Mode, State, Stop};
pub use drive_settings::value::Words;
pub use drive_settings::{Flux, Settings};
pub use num_complex::Complex64;
pub use rayon::prelude::*;
pub use serde::{Deserialize, Serialize};

pub use crate::columns;
pub use crate::config::{
    Config, LoadMode, PlantModel, built, check_model, open_phase, plant_settings,
};
pub use crate::error::Error;
pub use crate::experiment::{Context, Experiment, LOST_DEG, assumptions, is_lost};
pub use crate::outcome::{Cell, Column, Compared, Figure, Metrics, Outcome, Panel, Series, Table};
pub use crate::plant::{Load, Plant};
pub use crate::progress::Progress;
pub use crate::rig::{Point, RATE_HZ, Rig, fault_text, wrapped_degrees};
pub use crate::statistics::{Study, or_refusal, seed_of, whole};
pub use crate::stats::{Stats, quantile, sorted};
