//! Space-vector modulation, and the amplitude modulation that contains the angle.

mod carrier;

use drive_core::Abc;
use drive_core::current::Modulator;
use drive_core::io::PERIOD_S;

use crate::dead_time::steps;
use crate::prelude::*;

/// The modulator of the drive at this dc-link voltage.
struct Inverter {
    modulator: Modulator,
    top: f64,
    vdc: f64,
}

impl Inverter {
    fn compare(&self, wanted: AlphaBeta) -> [f64; 3] {
        let modulated = self.modulator.step(wanted, Abc::ZERO, self.vdc as f32);
        modulated.duties.map(|duty| (f64::from(duty) * self.top).round())
    }

    /// Returns the mean voltage at the motor for these compare values, V.
    fn voltage(&self, compare: [f64; 3]) -> (f64, f64) {
        clarke(compare.map(|c| c / self.top * self.vdc))
    }
}

/// Eq. 2.3, in f64.
fn clarke([a, b, c]: [f64; 3]) -> (f64, f64) {
    ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

fn vector(volts: f64, angle: f64) -> AlphaBeta {
    AlphaBeta::new((volts * angle.cos()) as f32, (volts * angle.sin()) as f32)
}

/// Runs the experiment: Figures 4, 5 and 11, Table 2.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let settings = drive_settings::Inverter::default();
    let inverter = Inverter {
        modulator: Modulator::new(settings.dead_time_s, PERIOD_S, false),
        top: f64::from(settings.top),
        vdc: context.config.inverter.dc_link_v,
    };
    let mut outcome = Outcome::default();
    outcome.figures.push(vectors(&inverter));
    outcome.figures.push(sequence(&inverter, &mut outcome.compared));
    table_2(&inverter, &mut outcome);
    accuracy(&inverter, &mut outcome);
    carrier::add(context, &mut outcome);
    Ok(outcome)
}

/// Draws Figure 4, and the output of the modulator for voltages that are too large.
fn vectors(inverter: &Inverter) -> Figure {
    let around = |n: u32, at: &dyn Fn(f64) -> (f64, f64)| -> Vec<(f64, f64)> {
        (0..=n).map(|k| at(f64::from(k) * TAU / f64::from(n))).collect()
    };
    let on = |length: f64| move |angle: f64| (length * angle.cos(), length * angle.sin());
    let given =
        |volts: f64| around(720, &|angle| inverter.voltage(inverter.compare(vector(volts, angle))));
    let inner = inverter.vdc / 3.0_f64.sqrt();
    let corners = around(6, &on(2.0 / 3.0 * inverter.vdc));
    let hexagon = Series::reference("hexagon", corners.clone());
    let panel = Panel { equal_axes: true, ..Panel::new("α (V)", "β (V)").with(hexagon) };
    let names = ["U_0", "U_60", "U_120", "U_180", "U_240", "U_300"];
    let corners = names.into_iter().zip(corners);
    let corners = corners.map(|(name, corner)| Series::points(name, vec![corner]));
    let panel = corners
        .fold(panel, Panel::with)
        .with(Series::limit("largest circle", around(360, &on(inner))))
        .with(Series::line("asked: 0.9 of the circle", given(0.9 * inner)))
        .with(Series::line("asked: 1.5 of the circle", given(1.5 * inner)));
    texts::figure("modulation", "vectors").panel(panel)
}

/// Compares Table 2 with the voltages that the modulator makes for the corners of the hexagon, and for zero.
fn table_2(inverter: &Inverter, outcome: &mut Outcome) {
    let names = ["U_0", "U_60", "U_120", "U_180", "U_240", "U_300", "O_000", "O_111"];
    for (name, k) in names.into_iter().zip(0..) {
        let volts = if k < 6 { 2.0 / 3.0 * inverter.vdc } else { 0.0 };
        let legs = inverter.compare(vector(volts, f64::from(k) * TAU / 6.0));
        for (n, phases) in ["v_a v_ab", "v_b v_bc", "v_c v_ca"].into_iter().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|k| legs[(n + k) % 3] / inverter.top);
            let values = [(2.0 * a - b - c) / 3.0, a - b];
            let cells = phases.split(' ').zip(values);
            let cell = |(cell, value)| beside(&format!("Table 2, {name}"), cell).used(value);
            outcome.compared.extend(cells.map(cell));
        }
    }
}

/// Draws Figure 5 at 20° and half of the largest circle.
fn sequence(inverter: &Inverter, compared: &mut Vec<Compared>) -> Figure {
    let wanted = vector(0.5 * inverter.vdc / 3.0_f64.sqrt(), 20.0_f64.to_radians());
    let compare = inverter.compare(wanted);
    let switches = compare.iter().filter(|compare| (1.0..inverter.top).contains(*compare));
    compared.push(named("transitions").recomputed(2.0 * switches.count() as f64));
    let period_us = 1e6 * f64::from(PERIOD_S);
    let mut panel = Panel::new("time in the PWM period (µs)", "leg high (1) or low (0), offset");
    for (k, (name, compare)) in ["a", "b", "c"].into_iter().zip(compare).enumerate() {
        let low = 1.5 * (2 - k) as f64;
        let half = 0.5 * period_us * compare / inverter.top;
        let (on, off) = (0.5 * period_us - half, 0.5 * period_us + half);
        let corners = steps(false, &[on, off], period_us, low);
        panel = panel.with(Series::line(format!("leg {name}"), corners));
    }
    texts::figure("modulation", "sequence").panel(panel.y_range(-0.2, 4.2))
}

/// On-times of the two vectors adjacent to a voltage in the first sector, by Table 2, divided by the period.
fn on_times(wanted: (f64, f64), vdc: f64) -> (f64, f64) {
    let second = wanted.1 * 3.0_f64.sqrt() / vdc;
    (1.5 * wanted.0 / vdc - 0.5 * second, second)
}

/// Measures the mean voltage inside the largest circle, the angle of a voltage that is three times too long (off where pulses are
/// dropped or extended because they are too short to be made), and the on-times against those by Table 2. Without dead-time compensation.
fn accuracy(inverter: &Inverter, outcome: &mut Outcome) {
    let circle = inverter.vdc / 3.0_f64.sqrt();
    let (mut error, mut turned, mut time) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..3600 {
        let angle = f64::from(k) * TAU / 3600.0;
        for share in [0.2, 0.5, 0.9] {
            let wanted = vector(share * circle, angle);
            let given = inverter.voltage(inverter.compare(wanted));
            let distance =
                (given.0 - f64::from(wanted.alpha)).hypot(given.1 - f64::from(wanted.beta));
            error = error.max(distance);
        }
        let given = inverter.voltage(inverter.compare(vector(3.0 * circle, angle)));
        let off = given.1.atan2(given.0) - angle;
        turned = turned.max((off / TAU - (off / TAU).round()).abs() * 360.0);
        if angle < TAU / 6.0 {
            let wanted = (0.7 * circle * angle.cos(), 0.7 * circle * angle.sin());
            let [a, b, c] = inverter.compare(vector(0.7 * circle, angle));
            let by_table = on_times(wanted, inverter.vdc);
            let by_counts = ((a - b) / inverter.top, (b - c) / inverter.top);
            time = time.max((by_table.0 - by_counts.0).abs()).max((by_table.1 - by_counts.1).abs());
        }
    }
    outcome.metrics.set("voltage_error_max_v", error);
    outcome.metrics.set("limited_angle_error_max_deg", turned);
    outcome.metrics.set("on_time_difference_max_us", time * 1e6 * f64::from(PERIOD_S));
}
