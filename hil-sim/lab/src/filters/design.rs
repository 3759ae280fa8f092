//! Filter design from a specification: analog prototypes and the bilinear transformation, in f64. No crate designs
//! elliptic filters.
//!
//! Elliptic functions are computed by Landen's transformation (Orfanidis, Lecture notes on elliptic filter design,
//! 2006); arguments are in quarter periods.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::prelude::*;

const J: Complex64 = Complex64::I;
const ONE: Complex64 = Complex64::ONE;

/// A low-pass with its pass band up to 1 rad/s.
pub struct Prototype {
    zeros: Vec<Complex64>,
    poles: Vec<Complex64>,
    /// Gain at dc.
    dc: f64,
}

/// The band of a filter, with edges in Hz.
#[derive(Clone, Copy)]
pub enum Band {
    /// A low-pass.
    Low(f64),
    /// A band-pass.
    Pass(f64, f64),
    /// A band-stop.
    Stop(f64, f64),
}

/// Ripple factor of an attenuation in dB.
pub fn ripple(db: f64) -> f64 {
    (10f64.powf(0.1 * db) - 1.0).sqrt()
}

/// Moduli of Landen's sequence below k.
fn landen(k: f64) -> Vec<f64> {
    let step = |k: &f64| {
        let below = (k / (1.0 + (1.0 - k * k).sqrt())).powi(2);
        (below > 1e-16).then_some(below)
    };
    std::iter::successors(step(&k), step).collect()
}

/// Value at modulus k of the function whose value at modulus 0, a cosine or sine, is `w`.
fn ascend(w: Complex64, k: f64) -> Complex64 {
    landen(k).iter().rev().fold(w, |w, v| (1.0 + v) * w / (ONE + *v * w * w))
}

fn cd(u: Complex64, k: f64) -> Complex64 {
    ascend((u * FRAC_PI_2).cos(), k)
}

fn sn(u: Complex64, k: f64) -> Complex64 {
    ascend((u * FRAC_PI_2).sin(), k)
}

/// Inverse of [`sn`].
fn asn(w: Complex64, k: f64) -> Complex64 {
    let sequence = landen(k);
    let moduli = std::iter::once(k).chain(sequence.iter().copied());
    let w = sequence.iter().zip(moduli).fold(w, |w, (v, above)| {
        2.0 * w / ((1.0 + v) * (ONE + (ONE - above * above * w * w).sqrt()))
    });
    ONE - w.acos() / FRAC_PI_2
}

/// Middles of the `n` parts of two quarter periods that lie in the upper half plane.
fn middles(n: usize) -> impl Iterator<Item = f64> {
    (0..n / 2).map(move |i| (2 * i + 1) as f64 / n as f64)
}

/// Returns roots and their conjugates.
fn pairs(half: impl Iterator<Item = Complex64>) -> Vec<Complex64> {
    half.flat_map(|root| [root, root.conj()]).collect()
}

/// Designs an elliptic filter with a ripple of `pass` dB and an attenuation of `stop` dB.
pub fn elliptic(n: usize, pass: f64, stop: f64) -> Prototype {
    let k1 = ripple(pass) / ripple(stop);
    // The modulus from the degree equation, by the complementary modulus.
    let k1_complement = (1.0 - k1 * k1).sqrt();
    let product: f64 = middles(n).map(|u| sn(u.into(), k1_complement).re).product();
    let complement = k1_complement.powi(n as i32) * product.powi(4);
    let k = (1.0 - complement * complement).sqrt();
    let v0 = -J * asn(J / ripple(pass), k1) / n as f64;
    let zeros = pairs(middles(n).map(|u| J / (k * cd(u.into(), k))));
    let mut poles = pairs(middles(n).map(|u| J * cd(Complex64::from(u) - J * v0, k)));
    if n % 2 == 1 {
        poles.push(J * sn(J * v0, k));
    }
    let dc = if n.is_multiple_of(2) { 10f64.powf(-0.05 * pass) } else { 1.0 };
    Prototype { zeros, poles, dc }
}

/// Poles of a Chebyshev filter of the first kind.
fn chebyshev_poles(n: usize, ripple: f64) -> Vec<Complex64> {
    let v0 = (1.0 / ripple).asinh() / n as f64;
    let pole = |u: f64| J * (Complex64::from(u * FRAC_PI_2) - J * v0).cos();
    let mut poles = pairs(middles(n).map(pole));
    if n % 2 == 1 {
        poles.push(Complex64::from(-v0.sinh()));
    }
    poles
}

/// Designs a Chebyshev filter of the first kind, with a ripple of `pass` dB.
pub fn chebyshev_1(n: usize, pass: f64) -> Prototype {
    let dc = if n.is_multiple_of(2) { 10f64.powf(-0.05 * pass) } else { 1.0 };
    Prototype { zeros: Vec::new(), poles: chebyshev_poles(n, ripple(pass)), dc }
}

/// Designs a Chebyshev filter of the second kind, with an attenuation of `stop` dB above `edge` rad/s.
pub fn chebyshev_2(n: usize, stop: f64, edge: f64) -> Prototype {
    let poles = chebyshev_poles(n, 1.0 / ripple(stop)).into_iter().map(|p| edge / p).collect();
    let zeros = pairs(middles(n).map(|u| J * edge / (u * FRAC_PI_2).cos()));
    Prototype { zeros, poles, dc: 1.0 }
}

/// Designs a Butterworth filter with an attenuation of `pass` dB at 1 rad/s.
pub fn butterworth(n: usize, pass: f64) -> Prototype {
    let radius = ripple(pass).powf(-1.0 / n as f64);
    let pole =
        |i: usize| Complex64::from_polar(radius, PI * (0.5 + (2 * i + 1) as f64 / (2 * n) as f64));
    Prototype { zeros: Vec::new(), poles: (0..n).map(pole).collect(), dc: 1.0 }
}

impl Prototype {
    /// Returns numerator and denominator at the control rate; the edges are exact.
    pub fn digital(&self, band: Band) -> [Vec<f64>; 2] {
        let warped = |hz: f64| (PI * hz / RATE).tan();
        // Roots in the plane of the band, and the position of zeros at infinity.
        let moved = |root: Complex64| -> Vec<Complex64> {
            let both = |low: f64, high: f64, moved: &dyn Fn(f64) -> Complex64| {
                let (low, high) = (warped(low), warped(high));
                let half = moved(0.5 * (high - low));
                let apart = (half * half - low * high).sqrt();
                vec![half + apart, half - apart]
            };
            match band {
                Band::Low(edge) => vec![root * warped(edge)],
                Band::Pass(low, high) => both(low, high, &|half_width| half_width * root),
                Band::Stop(low, high) => both(low, high, &|half_width| half_width / root),
            }
        };
        let plane = |roots: &[Complex64]| -> Vec<Complex64> {
            roots.iter().flat_map(|&r| moved(r)).map(|s| (ONE + s) / (ONE - s)).collect()
        };
        let (mut zeros, poles) = (plane(&self.zeros), plane(&self.poles));
        // In a low-pass, zeros at infinity move to half the sampling rate.
        zeros.resize(poles.len(), -ONE);
        let [b, a] = [&zeros, &poles].map(|roots| expanded(roots));
        let centre = match band {
            Band::Pass(low, high) => 2.0 * (warped(low) * warped(high)).sqrt().atan(),
            _ => 0.0,
        };
        let [above, below] = [&b, &a].map(|part| super::direct::value(part, centre).norm());
        let gain = self.dc * below / above;
        [b.iter().map(|b| gain * b).collect(), a]
    }
}

/// Returns the real polynomial with these roots, highest power first.
fn expanded(roots: &[Complex64]) -> Vec<f64> {
    let mut polynomial = vec![ONE];
    for root in roots {
        polynomial.push(Complex64::ZERO);
        for k in (1..polynomial.len()).rev() {
            let before = polynomial[k - 1];
            polynomial[k] -= root * before;
        }
    }
    polynomial.iter().map(|c| c.re).collect()
}
