//! Tests of the filters of Appendix C against the printed tables.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

mod precision;
mod printed;
mod responses;
mod states;

use core::f64::consts::{PI, TAU};

use induction_drive_core::filter::Section;
use num_complex::Complex64;

const RATE: f64 = 6000.0;

fn rad(hz: f64) -> f64 {
    TAU * hz / RATE
}

/// Returns the largest distance between two responses from dc to half the sampling rate.
fn largest_distance(one: impl Fn(f64) -> Complex64, other: impl Fn(f64) -> Complex64) -> f64 {
    (0..=6000)
        .map(|n| PI * f64::from(n) / 6000.0)
        .fold(0.0, |m, w| m.max((one(w) - other(w)).norm()))
}

/// Whether both poles lie inside the unit circle (Jury: |a2| < 1 and |a1| < 1 + a2).
fn is_stable(s: &Section) -> bool {
    let (a1, a2) = (f64::from(s.a1), f64::from(s.a2));
    a2 < 1.0 && a1 < 1.0 + a2 && -a1 < 1.0 + a2
}

/// Returns the magnitude in dB.
fn db(response: Complex64) -> f64 {
    20.0 * libm::log10(response.norm())
}
