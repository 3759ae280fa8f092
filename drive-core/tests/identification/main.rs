//! The identification from the terminals against a machine integrated in `f64`.

mod least_squares;
mod machine;
mod online;
