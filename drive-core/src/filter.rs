//! Digital filters as cascades of second-order sections, and moving sums.

pub(crate) mod dissertation;
#[cfg(feature = "printed")]
pub(crate) mod moving_sum;
pub(crate) mod section;
pub(crate) mod sos;

pub use dissertation::{BPF, LPF, LPF_AS_PRINTED, LpfState, PP, lpf_lag_samples};
pub use section::{Section, response};
pub use sos::{Signal, Sos, SosState};
