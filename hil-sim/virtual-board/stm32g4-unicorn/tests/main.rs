//! The tests of the emulated chip: one program, with one module for each subject.

mod circuit;
mod cost;
mod registers;
mod rules;
