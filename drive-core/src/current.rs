//! The current loop and the inverter: PI control, dead-time compensation, modulation.

pub(crate) mod dead_time;
pub(crate) mod inverter_drop;
pub(crate) mod modulation;
pub(crate) mod pi;
pub(crate) mod voltage_limit;

pub use dead_time::DeadTime;
pub use inverter_drop::InverterDrop;
pub use modulation::Modulator;
pub use pi::{DIRECT_SHARE, DIRECT_SHARE_WITHOUT_CARRIER, DqPi, Pi, PiState};
pub use voltage_limit::VoltageLimit;
