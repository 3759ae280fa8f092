//! The tests of the emulated chip: one program, with one module for each subject.

mod blocks;
mod cost;
mod registers;
mod rules;
