//! The names that most experiments use.

pub use drive_core::{AngleSource, Command, Drive, Fault, Mode, State};
pub use drive_settings::value::Words;
pub use rand::{Rng, RngExt};
pub use serde::{Deserialize, Serialize};
pub use sim_bench::columns;
pub use sim_bench::config::{PlantModel, built, check_model};
pub use sim_bench::outcome::Column;
pub use sim_bench::plant::Load;
pub use sim_bench::prelude::*;
pub use sim_bench::rig::{Point, fault_text, tracks, wrapped_degrees};
pub use sim_bench::statistics::{Study, or_refusal, seed_of, whole};

pub use crate::random::{seeded, sign};
