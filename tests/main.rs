//! The procedures of the drive on the simulated bench, and recorded runs: one program, one module per procedure.

mod asymmetry_at_start;
mod command_turns;
mod common;
mod demodulator_truth;
mod edges;
mod encoder_orientation;
mod five_demodulators;
mod homing;
mod learning;
mod lock_monitor;
mod motor_sensor;
mod online_tracking;
mod power_limit;
mod protections;
mod replay;
mod restart;
mod saliency_check;
mod sensorless_position;
mod sensorless_speed;
mod sensorless_torque;
mod silent_sensors;
mod stops;
mod thermal_limit;
mod turning_start;
mod volts_per_hertz;
mod wiring_check;
