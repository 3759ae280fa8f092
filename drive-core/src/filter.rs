//! Digital filters as cascades of second-order sections, and moving sums.

pub mod dissertation;
pub mod moving_sum;
pub mod section;
pub mod sos;
