//! Identification of an induction machine from its stator voltage and current, after C. B.
//! Jacobina, A. M. N. Lima, L. A. de S. Ribeiro, "Estimação linear de parâmetros e velocidade da
//! máquina assíncrona usando um modelo dinâmico discreto corrente-tensão", 1996. Equation, table
//! and figure numbers in this module are those of that paper.
//!
//! At its terminals a machine shows five numbers, [`Parameters`]. Sampled data with a voltage held over each period
//! show four complex numbers, [`CurrentVoltage`]. The steps between them:
//!
//! ```text
//! signals -> trial (machine, noise, filters) -> batch (least squares) -> models (A, B, C, D, S)
//! ```
//!
//! All of it is complex arithmetic: the machine is symmetric, so a vector with components d and q obeys one complex
//! equation. The real form of Eq. 19 to 24 has the same solution, to within 1e-12.

pub mod arx;
pub mod batch;
pub mod bench_tests;
pub mod claims;
pub mod model;
pub mod models;
pub mod output_error;
pub mod printed;
pub mod ratios;
pub mod signals;
pub mod structured;
pub mod study;
pub mod trial;

pub use batch::{Data, Regression};
pub use model::{Continuous, CurrentVoltage, Delta, FirstOrderTheta, Parameters, Step};
pub use models::{Estimate, NotIdentifiable, Value, model_b, model_c, model_d};
pub use trial::{Noise, Signal, Trial};

pub use sim_bench::plant::Complex;
