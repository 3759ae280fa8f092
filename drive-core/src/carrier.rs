//! The injected carrier: generation of its voltage and demodulation of its current.

pub mod asymmetry;
pub mod demodulator;
pub mod drift;
pub mod injection;
mod kind;
mod sample;
pub mod synchronous;

pub use kind::DemodulatorKind;
pub use sample::{CarrierCurrent, CarrierSample, Saliency};
