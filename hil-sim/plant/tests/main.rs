//! The tests of the plant: one program, a module a subject.

mod common;
mod dc_link;
mod effects_board;
mod effects_motor;
mod energy;
