//! The names that most experiments use.

pub use drive_core::{AlphaBeta, FirstOrder};
pub use rand_xoshiro::Xoshiro256PlusPlus;
pub use rand_xoshiro::rand_core::SeedableRng;
pub use sim_bench::bode::{Bode, RATE, decibels, fictitious, frequencies, omega_t};
pub use sim_bench::outcome::Style;
pub use sim_bench::plant::{ElectricalState as _, EnergyMachine, MachineModel, MachineSettings};
pub use sim_bench::plant::{Mechanics, MechanicsSettings, MotorModel};
pub use sim_bench::prelude::*;

pub use crate::poles::largest_pole;
pub use crate::source::{self, beside, named, printed};
pub use crate::texts;
