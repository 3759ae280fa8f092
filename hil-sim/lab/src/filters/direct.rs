//! The filters in direct form (Eq. C.1) with the printed coefficients, for comparison.

use crate::prelude::*;

/// Returns numerator and denominator of a filter of Table 7 or 8.
pub fn printed(table: &str, filter: &str) -> [Vec<f64>; 2] {
    ["b", "a"].map(|part| source::column("S1", table, &format!("{part} ({filter})")))
}

/// Evaluates a polynomial in z⁻¹ at an angle in rad/sample.
pub fn value(part: &[f64], omega_t: f64) -> Complex64 {
    let delay = Complex64::cis(-omega_t);
    part.iter().rev().fold(Complex64::ZERO, |sum, &c| sum * delay + c)
}

/// Frequency response, Eq. C.2.
pub fn response(filter: &[Vec<f64>; 2], omega_t: f64) -> Complex64 {
    value(&filter[0], omega_t) / value(&filter[1], omega_t)
}

/// Returns the reference: the filter in `f64`, direct form I.
pub fn reference([b, a]: &[Vec<f64>; 2]) -> impl FnMut(f64) -> f64 {
    let (mut x, mut y) = (vec![0.0; b.len()], vec![0.0; b.len()]);
    move |input| {
        x.rotate_right(1);
        y.rotate_right(1);
        x[0] = input;
        y[0] = 0.0;
        let forward: f64 = b.iter().zip(&x).map(|(b, x)| b * x).sum();
        let back: f64 = a.iter().zip(&y).skip(1).map(|(a, y)| a * y).sum();
        y[0] = forward - back;
        y[0]
    }
}

/// A way to compute a filter in `f32`: its name, its name in the metrics, and its output for an input.
pub type Form = (&'static str, &'static str, Box<dyn FnMut(f32) -> f32>);

/// Returns the three direct forms in `f32`.
pub fn f32_forms(filter: &[Vec<f64>; 2]) -> [Form; 3] {
    let [b, a] = filter.each_ref().map(|part| part.iter().map(|&c| c as f32).collect::<Vec<_>>());
    [
        ("direct form I, f32", "direct_1", Box::new(form_1(b.clone(), a.clone()))),
        ("direct form II, f32", "direct_2", Box::new(form_2(b.clone(), a.clone()))),
        ("transposed form II, f32", "transposed_2", Box::new(form_2_transposed(b, a))),
    ]
}

fn form_1(b: Vec<f32>, a: Vec<f32>) -> impl FnMut(f32) -> f32 {
    let (mut x, mut y) = (vec![0.0_f32; b.len()], vec![0.0_f32; b.len()]);
    move |input| {
        x.rotate_right(1);
        y.rotate_right(1);
        x[0] = input;
        let forward = b.iter().zip(&x).fold(0.0_f32, |sum, (b, x)| sum + b * x);
        y[0] = a.iter().zip(&y).skip(1).fold(forward, |sum, (a, y)| sum - a * y);
        y[0]
    }
}

fn form_2(b: Vec<f32>, a: Vec<f32>) -> impl FnMut(f32) -> f32 {
    let mut w = vec![0.0_f32; b.len()];
    move |input| {
        w.rotate_right(1);
        w[0] = a.iter().zip(&w).skip(1).fold(input, |sum, (a, w)| sum - a * w);
        b.iter().zip(&w).fold(0.0_f32, |sum, (b, w)| sum + b * w)
    }
}

fn form_2_transposed(b: Vec<f32>, a: Vec<f32>) -> impl FnMut(f32) -> f32 {
    // The last state is always zero.
    let mut s = vec![0.0_f32; b.len()];
    move |input| {
        let output = b[0] * input + s[0];
        for n in 1..b.len() {
            s[n - 1] = b[n] * input - a[n] * output + s[n];
        }
        output
    }
}
