//! The tests of the laboratory: one program, with one module for each subject.

mod arx;
mod faults;
mod laboratory;
mod model;
mod recursive;
mod reference;
mod structured;
