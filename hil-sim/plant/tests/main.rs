//! The tests of the plant: one program, with one module for each subject.

mod common;
mod dc_link;
mod duties;
mod effects_board;
mod effects_motor;
mod energy;
mod inverter;
mod machine;
mod outputs_off;
mod phase_model;
mod saliency;
mod sensors;
