//! From converter codes to currents, from currents to voltages, from voltages to compare values.

pub mod dead_time;
pub mod inverter_drop;
pub mod modulation;
pub mod pi;
pub mod sensing;
