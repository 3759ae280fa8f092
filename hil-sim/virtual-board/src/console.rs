//! The firmware's console, as far as it is needed to know what a line means.

#[path = "../../../src/console/grammar.rs"]
pub mod grammar;
#[path = "../../../src/console/keys.rs"]
pub mod keys;
