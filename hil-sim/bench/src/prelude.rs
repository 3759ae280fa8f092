//! The names that most experiments use.

pub use crate::config::{Config, LoadMode, plant_settings};
pub use crate::error::Error;
pub use crate::experiment::{
    BENCH, Context, DRIVE, Experiment, FREE_SHAFT, LOST_DEG, SPEED_LOOP, TRACKING, TURNING,
    assumptions,
};
pub use crate::outcome::{Cell, Compared, Figure, Metrics, Outcome, Panel, Series, Table};
pub use crate::rig::{RATE_HZ, Rig};
pub use crate::stats::{Stats, quantile, sorted};
