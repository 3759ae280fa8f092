//! Which machine the tables were made with: numbers that follow from the print and do not depend on
//! the noise, beside the same numbers of two machines.

use super::models::model_b;
use super::printed::{PERIODS, TABLE_1, TABLE_4, TABLES_2_3_B, TABLES_2_3_C};
use super::{CurrentVoltage, FirstOrderTheta, Parameters};

/// A number that does not depend on the noise, as printed and for two machines.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// Its name.
    pub quantity: &'static str,
    /// Sampling period, s.
    pub h: f64,
    /// By the tables.
    pub printed: f64,
    /// Value for [`Parameters::PX`] at 375 rad/s.
    pub px: f64,
    /// Value for [`Parameters::RBV`].
    pub rbv: f64,
}

fn coefficients(machine: Parameters, h: f64) -> CurrentVoltage {
    machine.at(375.0).continuous().series(h, 5).current_voltage()
}

/// h_1b and h_0b are small and estimated with the same absolute error: their relative errors have the
/// ratio |h_0b / h_1b|. Geometric mean of the four columns of Tables 1 and 4 that share a period; the
/// ratio does not depend on the speed.
fn gains(period: usize) -> f64 {
    let column = |table: &[[f64; 6]; 8], k: usize| table[5][k] / table[7][k];
    let all = [&TABLE_1, &TABLE_4].map(|t| column(t, period) * column(t, period + 3));
    (all[0] * all[1]).powf(0.25)
}

/// Eq. 34 and 38 differ by the factor (1 + f_11)/2 and use the same h_1a: their errors differ by
/// (1 - f_11) / 2. Mean of both signals, where B is biased upwards.
fn inductances(period: usize) -> f64 {
    let b_minus_c = |k: usize| TABLES_2_3_B[2][k] - TABLES_2_3_C[2][k];
    // The larger: absolute values in the tables can only shrink the difference.
    0.01 * b_minus_c(period).max(b_minus_c(period + 3))
}

/// The error of tau_r by Model B is almost all bias. Mean of both signals.
fn time_constants(period: usize) -> f64 {
    0.005 * (TABLES_2_3_B[1][period] + TABLES_2_3_B[1][period + 3])
}

/// All nine.
pub fn all() -> Vec<Ratio> {
    let mut ratios = Vec::new();
    for (period, h) in PERIODS.into_iter().enumerate() {
        let mut add = |quantity, printed, of: &dyn Fn(Parameters) -> f64| {
            let (px, rbv) = (of(Parameters::PX), of(Parameters::RBV));
            ratios.push(Ratio { quantity, h, printed, px, rbv });
        };
        add("h_0b / h_1b", gains(period), &|machine| {
            let c = coefficients(machine, h);
            (c.h0.im / c.h1.im).abs()
        });
        add("(1 - f_11) / 2", inductances(period), &|machine| {
            let c = coefficients(machine, h);
            0.5 * (1.0 - (c.f1 + c.h0 / c.h1).re)
        });
        add("error of tau_r by Model B", time_constants(period), &|machine| {
            let theta = FirstOrderTheta::from(coefficients(machine, h).delta());
            model_b(&theta, h).tau_r.map_or(f64::NAN, |tau_r| 1.0 - tau_r / machine.tau_r)
        });
    }
    ratios
}
