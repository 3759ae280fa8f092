//! Where the printed numbers do not follow from the printed parameters.

use drive_core::FirstOrder;
use drive_settings::tuning::EquivalentCircuit;
use sim_bench::bode::{RATE, largest_pole};
use sim_bench::prelude::*;

use super::PERIOD_S;

/// The printed values beside those that the printed parameters give.
pub fn table(motor: &EquivalentCircuit, physical: FirstOrder) -> Table {
    let l_r = motor.l_m + motor.l_lr;
    let l_s = motor.l_m + motor.l_ls;
    let ratio = motor.l_m / l_r;
    let resistance = motor.r_s + motor.r_r * ratio * ratio;
    let sigma = 1.0 - motor.l_m * motor.l_m / (l_s * l_r);
    let time_constant = sigma * l_s / resistance;
    // Eq. 4.1 under Eq. 4.2: (z - 1)^2 (z - p) + k_c k (z - z_c).
    let (p, gain) = (0.95782, 6.466 * 0.01716);
    let position_pole = largest_pole(&[-2.0 - p, 1.0 + 2.0 * p + gain, -p - gain * 0.974]);
    // A pole p in the w plane: v = 2/T (1 - p)/(1 + p), rad/s.
    let in_w = |p: f64| 2.0 * RATE * (1.0 - p) / (1.0 + p);

    let mut table = Table::new(
        "What differs from print, with the motor of this configuration",
        &["quantity", "printed", "computed", "remark"],
    );
    #[rustfmt::skip] // a row a line
    let rows: [(&str, Option<f64>, f64, &str); 11] = [
        ("k_FT, Eq. 3.20 (A/V)", Some(0.01973), 1.0 / resistance, "1/(r_s + r_r (L_m/L_r)²)"),
        ("σ, Eq. 3.21", Some(0.2515), sigma, ""),
        ("T_FT, Eq. 3.22 (ms)", Some(1.0157), 1e3 * time_constant, "follows from k_FT"),
        ("k_FTD, Eq. 3.33 (A/V)", Some(0.003237), PERIOD_S / (sigma * l_s), "k_FT cancels"),
        ("p_FTD, Eq. 3.32", Some(0.8359), 1.0 - PERIOD_S / time_constant, "follows from T_FT"),
        ("gain with an exact hold (A/V)", None, physical.k, "Eq. 3.25 is the forward difference"),
        ("pole with an exact hold", None, physical.p, ""),
        ("pole of 3.33, fictitious (Hz)", Some(1073.0), in_w(0.8359), "printed as Hz, is rad/s"),
        ("pole of 3.34, fictitious (Hz)", Some(376.0), in_w(0.93916), "printed as Hz, is rad/s"),
        ("pole of 3.42, fictitious (Hz)", Some(300.88), in_w(0.9503), "printed as Hz, is rad/s; 3.41 has 300.75"),
        ("largest |z|, Eq. 4.1 under 4.2", None, position_pole, "the printed position loop is unstable"),
    ];
    for (name, printed, computed, remark) in rows {
        let printed = Cell::or_dash(printed.map(|printed| Cell::significant(printed, 5)));
        table.row([name.into(), printed, Cell::significant(computed, 5), remark.into()]);
    }
    table
}
