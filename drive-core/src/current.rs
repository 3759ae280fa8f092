//! The current loop and the inverter: PI control, dead-time compensation, modulation.

pub mod dead_time;
pub mod inverter_drop;
pub mod modulation;
pub mod pi;
pub mod voltage_limit;
