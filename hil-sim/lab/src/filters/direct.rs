//! The filters in direct form (Eq. C.1) with the printed coefficients, to compare with.
#![expect(clippy::excessive_precision, reason = "the digits are those of the source")]

use num_complex::Complex64;

/// Table 7: numerator, denominator.
#[rustfmt::skip] // a table
pub const LPF: [[f64; 9]; 2] = [
    [
        0.738615833587383, -4.971982137583815, 15.501482170609810,
        -28.984106346506920, 35.439076902595630, -28.984106346506920,
        15.501482170609810, -4.971982137583815, 0.738615833587383,
    ],
    [
        1.0, -6.311293551201974, 18.463310785092791,
        -32.436104849347807, 37.322148071647149, -28.775658178634401,
        14.536417936493200, -4.413169859261352, 0.621866049065974,
    ],
];

/// Table 8: numerator, denominator.
#[rustfmt::skip] // a table
pub const BPF: [[f64; 5]; 2] = [
    [
        0.02218769906303914, -0.02791079414758331, 0.01263993354917355,
        -0.02791079414758331, 0.02218769906303914,
    ],
    [
        1.0, -2.99899648142248898, 3.95706806169825098,
        -2.58302254497039918, 0.74432231301657747,
    ],
];

/// Table 8: numerator, denominator.
#[rustfmt::skip] // a table
pub const PP: [[f64; 5]; 2] = [
    [
        0.00107990678715093, -0.00373680819442586, 0.00535736614345009,
        -0.00373680819442586, 0.00107990678715093,
    ],
    [
        1.0, -3.86437365668928701, 5.61267070060141027,
        -3.63099960015131895, 0.88274870085761437,
    ],
];

/// Each coefficient rounded to `f32`.
pub fn rounded<const N: usize>(filter: &[[f64; N]; 2]) -> [[f64; N]; 2] {
    filter.map(|part| part.map(|c| f64::from(c as f32)))
}

/// Frequency response, Eq. C.2.
pub fn response<const N: usize>(filter: &[[f64; N]; 2], omega_t: f64) -> Complex64 {
    let delay = Complex64::cis(-omega_t);
    let value = |part: &[f64; N]| {
        let zero = Complex64::new(0.0, 0.0);
        part.iter().rev().fold(zero, |sum, &c| sum * delay + Complex64::new(c, 0.0))
    };
    value(&filter[0]) / value(&filter[1])
}

/// The reference: the filter in `f64`, direct form I.
pub fn reference<const N: usize>(filter: [[f64; N]; 2]) -> impl FnMut(f64) -> f64 {
    let ([b, a], mut x, mut y) = (filter, [0.0; N], [0.0; N]);
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

/// A way to compute a filter in `f32`: its name, and its output for an input.
pub type Form = (&'static str, Box<dyn FnMut(f32) -> f32>);

/// The three direct forms in `f32`.
pub fn f32_forms<const N: usize>(filter: [[f64; N]; 2]) -> [Form; 3] {
    let [b, a] = filter.map(|part| part.map(|c| c as f32));
    [
        ("direct form I, f32", Box::new(form_1(b, a))),
        ("direct form II, f32", Box::new(form_2(b, a))),
        ("transposed form II, f32", Box::new(form_2_transposed(b, a))),
    ]
}

fn form_1<const N: usize>(b: [f32; N], a: [f32; N]) -> impl FnMut(f32) -> f32 {
    let (mut x, mut y) = ([0.0_f32; N], [0.0_f32; N]);
    move |input| {
        x.rotate_right(1);
        y.rotate_right(1);
        x[0] = input;
        let forward = b.iter().zip(&x).fold(0.0_f32, |sum, (b, x)| sum + b * x);
        y[0] = a.iter().zip(&y).skip(1).fold(forward, |sum, (a, y)| sum - a * y);
        y[0]
    }
}

fn form_2<const N: usize>(b: [f32; N], a: [f32; N]) -> impl FnMut(f32) -> f32 {
    let mut w = [0.0_f32; N];
    move |input| {
        w.rotate_right(1);
        w[0] = a.iter().zip(&w).skip(1).fold(input, |sum, (a, w)| sum - a * w);
        b.iter().zip(&w).fold(0.0_f32, |sum, (b, w)| sum + b * w)
    }
}

fn form_2_transposed<const N: usize>(b: [f32; N], a: [f32; N]) -> impl FnMut(f32) -> f32 {
    // The last state is always zero.
    let mut s = [0.0_f32; N];
    move |input| {
        let output = b[0] * input + s[0];
        for n in 1..N {
            let next = if n + 1 < N { s[n] } else { 0.0 };
            s[n - 1] = b[n] * input - a[n] * output + next;
        }
        output
    }
}
