//! Digital filters as second-order sections, and sums over the last samples.

pub mod dissertation;
pub mod moving_sum;
pub mod section;
pub mod sos;
