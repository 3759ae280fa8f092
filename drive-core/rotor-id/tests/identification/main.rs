//! Tests of the identification from the terminals, on a machine integrated in `f64`.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

mod least_squares;
mod machine;
mod online;
