//! Settings of an induction motor drive in SI units, and the design of its controllers.
//!
//! [`Settings::build`] computes the [`Coefficients`](drive_core::Coefficients) of the control from them, outside its
//! interrupt: it checks every value against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.
//!
//! | module | contents |
//! |---|---|
//! | the root | [`Settings`] and its parts; [`SETTINGS`], the table of all their rows |
//! | [`entry`], [`value`] | a row of the table; the value of a setting and its text |
//! | [`rules`] | settings that follow from others unless they are set |
//! | [`tuning`] | design of the current, speed and position controllers |
//!
//! A setting is declared once, by one row: field, default, unit, range, rule, help, who may change it, and whether learned
//! values depend on it.
#![cfg_attr(not(test), no_std)]

extern crate induction_drive_core as drive_core;

mod settings;
#[cfg(test)]
mod tests;
pub mod tuning;

pub use settings::*;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
