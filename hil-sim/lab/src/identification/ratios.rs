//! Identification of the machine with which the tables were made: numbers that follow from the print and do not depend
//! on the noise, beside the same numbers of two machines.

use super::printed::{self, Case, PERIODS, SPEEDS};
use super::{CurrentVoltage, FirstOrderTheta, Parameters, Signal, model_b};

/// A number that does not depend on the noise, as printed and for two machines.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// Its name.
    pub quantity: &'static str,
    /// Sampling period, s.
    pub h: f64,
    /// Value from the tables.
    pub printed: f64,
    /// Value for [`Parameters::PX`] at 375 rad/s.
    pub px: f64,
    /// Value for [`Parameters::RBV`].
    pub rbv: f64,
}

fn coefficients(machine: Parameters, h: f64) -> CurrentVoltage {
    machine.at(375.0).continuous().series(h, 5).current_voltage()
}

/// h_1b and h_0b are small and are estimated with the same absolute error, so their relative errors have the ratio
/// |h_0b / h_1b|. Returns the geometric mean of the four columns of Tables 1 and 4 with the same period; the ratio does
/// not depend on the speed.
fn gains(period: usize) -> f64 {
    let at = |case, parameter| printed::error("A", case, parameter).unwrap_or(f64::NAN);
    let of = |speed| {
        let cases = Signal::ALL.map(|signal| Case { speed, signal, period });
        cases.map(|case| at(case, "h_1b") / at(case, "h_0b"))
    };
    SPEEDS.map(of).iter().flatten().product::<f64>().powf(0.25)
}

/// Printed errors of a model at 375 rad/s, with both signals.
fn fast(model: &str, period: usize, parameter: &str) -> [f64; 2] {
    let case = |signal| Case { speed: SPEEDS[0], signal, period };
    Signal::ALL.map(|signal| printed::error(model, case(signal), parameter).unwrap_or(f64::NAN))
}

/// Eq. 34 and 38 differ by the factor (1 + f_11)/2 and use the same h_1a, so their errors differ by (1 - f_11) / 2.
/// Returns the mean of both signals, where B is biased upwards.
fn inductances(period: usize) -> f64 {
    let [b, c] = ["B", "C"].map(|model| fast(model, period, "sigma_l_s"));
    // The larger value, because absolute values in the tables can only reduce the difference.
    0.01 * (b[0] - c[0]).max(b[1] - c[1])
}

/// The error of tau_r by Model B is almost entirely bias. Returns the mean of both signals.
fn time_constants(period: usize) -> f64 {
    0.005 * fast("B", period, "tau_r").iter().sum::<f64>()
}

/// Returns all nine ratios.
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
