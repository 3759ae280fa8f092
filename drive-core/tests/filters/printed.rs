//! The filters as printed: Tables 7 and 8, and the difference equation C.1.

use nalgebra::DMatrix;
use num_complex::Complex64;

/// A filter of Table 7 or 8 for Eq. C.1: numerator and denominator in falling powers of z, as printed.
pub struct Printed<const N: usize> {
    b: [f64; N],
    a: [f64; N],
}

pub const TABLE_7_LPF: Printed<9> = Printed {
    b: [
        0.738615833587383,
        -4.971982137583815,
        15.50148217060981,
        -28.98410634650692,
        35.43907690259563,
        -28.98410634650692,
        15.50148217060981,
        -4.971982137583815,
        0.738615833587383,
    ],
    a: [
        1.0,
        -6.311293551201974,
        18.46331078509279,
        -32.43610484934781,
        37.32214807164715,
        -28.7756581786344,
        14.5364179364932,
        -4.413169859261352,
        0.621866049065974,
    ],
};

pub const TABLE_8_BPF: Printed<5> = Printed {
    b: [
        0.02218769906303914,
        -0.02791079414758331,
        0.01263993354917355,
        -0.02791079414758331,
        0.02218769906303914,
    ],
    a: [
        1.0,
        -2.998_996_481_422_489,
        3.957_068_061_698_251,
        -2.583_022_544_970_399,
        0.744_322_313_016_577_5,
    ],
};

pub const TABLE_8_PP: Printed<5> = Printed {
    b: [
        0.00107990678715093,
        -0.00373680819442586,
        0.00535736614345009,
        -0.00373680819442586,
        0.00107990678715093,
    ],
    a: [
        1.0,
        -3.864_373_656_689_287,
        5.612_670_700_601_41,
        -3.630_999_600_151_319,
        0.882_748_700_857_614_4,
    ],
};

impl<const N: usize> Printed<N> {
    pub fn response(&self, omega_t: f64) -> Complex64 {
        let z = Complex64::cis(omega_t);
        let of = |c: &[f64; N]| {
            c.iter().fold(Complex64::default(), |sum, c| sum * z + Complex64::new(*c, 0.0))
        };
        of(&self.b) / of(&self.a)
    }

    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self { b: self.b.map(&f), a: self.a.map(f) }
    }

    /// Returns the coefficients rounded to `f32`.
    pub fn rounded(&self) -> Self {
        self.map(|c| f64::from(c as f32))
    }

    /// Returns the magnitude of the largest pole, by the eigenvalues of the companion matrix.
    pub fn largest_pole(&self) -> f64 {
        let companion = |row: usize, column: usize| {
            if row == 0 { -self.a[column + 1] } else { f64::from(row == column + 1) }
        };
        let poles = DMatrix::from_fn(N - 1, N - 1, companion).complex_eigenvalues();
        poles.iter().fold(0.0, |m, p| m.max(p.norm()))
    }
}

/// Eq. C.1 in double precision.
pub struct Direct64<'a, const N: usize> {
    of: &'a Printed<N>,
    u: [f64; N],
    y: [f64; N],
}

impl<'a, const N: usize> Direct64<'a, N> {
    pub fn new(of: &'a Printed<N>) -> Self {
        Self { of, u: [0.0; N], y: [0.0; N] }
    }

    pub fn step(&mut self, u: f64) -> f64 {
        self.u.rotate_right(1);
        self.y.rotate_right(1);
        self.u[0] = u;
        self.y[0] = 0.0;
        let sum = |c: &[f64; N], x: &[f64; N]| c.iter().zip(x).map(|(c, x)| c * x).sum::<f64>();
        self.y[0] = sum(&self.of.b, &self.u) - sum(&self.of.a, &self.y);
        self.y[0]
    }
}

/// Direct implementation of Eq. C.1 in single precision.
pub struct Direct32<const N: usize> {
    b: [f32; N],
    a: [f32; N],
    u: [f32; N],
    y: [f32; N],
}

impl<const N: usize> Direct32<N> {
    pub fn new(of: &Printed<N>) -> Self {
        let single = |c: [f64; N]| c.map(|c| c as f32);
        Self { b: single(of.b), a: single(of.a), u: [0.0; N], y: [0.0; N] }
    }

    pub fn step(&mut self, u: f32) -> f32 {
        self.u.rotate_right(1);
        self.y.rotate_right(1);
        self.u[0] = u;
        self.y[0] = 0.0;
        let mut y = 0.0;
        for i in 0..N {
            y += self.b[i] * self.u[i] - self.a[i] * self.y[i];
        }
        self.y[0] = y;
        y
    }
}
