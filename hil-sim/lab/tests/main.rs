//! The tests of the laboratory: one program, a module a subject.

mod arx;
mod faults;
mod laboratory;
mod model;
mod recursive;
mod structured;
