//! The names that most experiments and commands use.

pub use std::collections::BTreeMap;
pub use std::path::{Path, PathBuf};
pub use std::time::{Duration, Instant};

pub use clap::Args;
pub use rand::{Rng, RngExt};
pub use sim_bench::prelude::*;
pub use sim_lab::texts;

pub use crate::config::{Key, RangeKind};
pub use crate::error::{cut, message, parser_text, printable};
pub use crate::input::{Input, OUT};
pub use crate::random::{seeded, sign};
pub use crate::{bounded, report};
