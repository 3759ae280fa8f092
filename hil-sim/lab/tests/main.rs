//! The tests of the identification of the 1996 paper: one program, a module a subject.

mod arx;
mod faults;
mod model;
mod recursive;
mod structured;
