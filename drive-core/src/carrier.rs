//! The high-frequency injection: generation of its voltage and synchronous demodulation of its current.

pub(crate) mod asymmetry;
pub(crate) mod at_start;
pub(crate) mod injection;
mod kind;
mod sample;
pub(crate) mod synchronous;

pub use asymmetry::Asymmetry;
pub use at_start::AtStart;
pub use injection::{
    CARRIER_COS, CARRIER_S, CARRIER_SAMPLES, CARRIER_SIN, CarrierPeriod, Injection,
};
pub use kind::DemodulatorKind;
pub use sample::CarrierSample;
pub(crate) use sample::{CarrierCurrent, Saliency};
