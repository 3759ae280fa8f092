//! Dead time and its compensation, section 3.9.

use crate::prelude::*;

/// Held speed, rpm: the fundamental is at 5 Hz plus slip.
const SPEED_RPM: f64 = 150.0;
const IQ_A: f64 = 1.0;
/// Revolutions of the flux that are evaluated.
const TURNS: f64 = 8.0;
/// Harmonics of the current vector that are caused by six voltage steps a period.
const HARMONICS: [i32; 4] = [-5, 7, -11, 13];

/// Results of one run.
struct Case {
    /// Voltage error along phase a, V, and current of phase a, A, over the angle of the current of phase a, degrees.
    error: Vec<(f64, f64)>,
    current: Vec<(f64, f64)>,
    error_rms: f64,
    /// Amplitude of each harmonic relative to the fundamental.
    harmonics: [f64; 4],
}

/// Runs the experiment: Figures 28 and 29.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let cases = [case(context, false)?, case(context, true)?];
    let names = [("without compensation", "uncompensated"), ("with compensation", "compensated")];
    let mut outcome = Outcome::default();
    let heads =
        ["", "voltage error (V rms)", "5th (%)", "7th (%)", "11th (%)", "13th (%)", "all four (%)"];
    let mut table = Table::new("Distortion of voltage and current", &heads).note(format!(
        "Every switching edge simulated, {SPEED_RPM} rpm held, iq = {IQ_A} A, encoder, no \
         injection. The current loop itself removes part of the distortion of the current."
    ));
    let mut voltage = Panel::new("angle of the current (°)", "voltage error along phase a (V)");
    let mut current = Panel::new("angle of the current (°)", "current of phase a (A)");
    for (c, (name, key)) in cases.iter().zip(names) {
        let total = c.harmonics.iter().map(|h| h * h).sum::<f64>().sqrt();
        outcome.metrics.set(format!("voltage_error_{key}_rms_v"), c.error_rms);
        outcome.metrics.set(format!("current_distortion_{key}_pct"), total * 100.0);
        let mut row = vec![Cell::from(name), Cell::fixed(c.error_rms, 3)];
        row.extend(c.harmonics.iter().chain([&total]).map(|h| Cell::fixed(h * 100.0, 3)));
        table.row(row);
        voltage = voltage.with(Series::line(name, c.error.clone()));
        current = current.with(Series::line(name, c.current.clone()));
    }
    outcome.tables.push(table);
    let i = &context.config.inverter;
    let lost = i.dc_link_v * i.dead_time_s * RATE_HZ;
    outcome.metrics.set("lost_voltage_per_phase_v", lost);
    let clean = cases[1].error_rms < 0.1 * cases[0].error_rms;
    outcome.compared.push(named("dead_time_corrected").simulated(clean));
    let figure = texts::figure("dead-time", "dead_time");
    outcome.figures.push(figure.panel(voltage).panel(current));
    outcome.figures.extend(edges(context));
    texts::add_remarks(&mut outcome, "dead-time", &[]);
    Ok(outcome)
}

/// Returns the points of a level over microseconds: its first value, and the instants at which it changes.
pub(super) fn steps(high: bool, changes: &[f64], end: f64, offset: f64) -> Vec<(f64, f64)> {
    let (mut level, mut line) = (f64::from(high), Vec::new());
    line.push((0.0, level + offset));
    for &at in changes {
        line.push((at, level + offset));
        level = 1.0 - level;
        line.push((at, level + offset));
    }
    line.push((end, level + offset));
    line
}

/// Draws a rising edge of a leg (Figure 28), and a pulse of a leg (Figure 29), with the delays of the simulated inverter.
fn edges(context: &Context<'_>) -> [Figure; 2] {
    let inverter = plant_settings(context.config).inverter;
    let (delay, dead) = (inverter.propagation_us, inverter.dead_time_us);
    let (edge, end) = (2.0, 10.0);
    let (first, second) = (edge + delay, edge + delay + dead);
    let mut panel = Panel::new("time (µs)", "off, on; offset").y_range(-0.2, 7.2);
    for (name, high, change, offset) in [
        ("command", false, edge, 6.0),
        ("gate, low side", true, first, 4.5),
        ("gate, high side", false, second, 3.0),
        ("voltage, current into the motor", false, second, 1.5),
        ("voltage, current out of the motor", false, first, 0.0),
    ] {
        panel = panel.with(Series::line(name, steps(high, &[change], end, offset)));
    }
    let (on, off, end, half) = (10.0, 40.0, 60.0, 0.5 * dead);
    let mut pulse = Panel::new("time (µs)", "low, high; offset").y_range(-0.2, 5.7);
    for (name, changes, offset) in [
        ("ideal pulse", [on, off], 4.5),
        ("actual, current into the motor", [on + delay + dead, off + delay], 3.0),
        ("actual, current out of the motor", [on + delay, off + delay + dead], 1.5),
        ("compensated, current into the motor", [on + delay + half, off + delay + half], 0.0),
    ] {
        pulse = pulse.with(Series::line(name, steps(false, &changes, end, offset)));
    }
    [
        texts::figure("dead-time", "edge").panel(panel),
        texts::figure("dead-time", "pulse").panel(pulse),
    ]
}

fn case(context: &Context<'_>, compensate: bool) -> Result<Case, Error> {
    let mut config = context.config.clone();
    config.drive.angle_source = AngleSource::Encoder;
    config.inverter.switched = true;
    config.drive.inverter.compensate = compensate;
    // No compensation knows the residual voltage drop; this experiment is about the dead time alone.
    config.inverter.residual_v = Some(0.0);
    config.load.mode = LoadMode::Speed;
    config.load.speed_rpm = SPEED_RPM;
    let mut rig = Rig::started(&config, context.seed, Mode::Torque)?;
    rig.settle(&Command::Torque(config.amperes(IQ_A) as f32), 0.5)?;

    const BINS: usize = 120;
    let mut sums = [(0.0, 0.0, 0u32); BINS];
    let mut error_stats = Stats::default();
    // Mean of i e^(-j n angle) over the run: complex amplitude of harmonic n.
    let mut amplitudes = [Complex64::ZERO; 5];
    let mut wanted = Complex64::ZERO;
    // The run covers whole revolutions of the flux, so that the fundamental leaks into no harmonic.
    let mut turned = 0.0;
    let mut last = rig.plant.rotor_flux_angle();
    while turned < TURNS * 360.0 {
        let i = rig.plant.current();
        let angle = i.im.atan2(i.re);
        let phi = rig.plant.rotor_flux_angle();
        turned += wrapped_degrees(phi - last);
        last = phi;
        if rig.drive.state().fault().is_some() {
            return Err(Error::Refused(format!("the drive is {}", rig.drive.state())));
        }
        rig.step();
        // The voltage of this period was computed from the previous sample.
        let error = rig.plant.applied_voltage() - wanted;
        let t = rig.drive.telemetry();
        let lead = TAU * (f64::from(t.phi.to_turns()) + 1.5 * f64::from(t.flux_freq));
        wanted = Complex64::new(t.voltage.d.into(), t.voltage.q.into()) * Complex64::cis(lead);

        error_stats.push(error.norm());
        let bin = &mut sums[((angle / TAU).rem_euclid(1.0) * BINS as f64) as usize % BINS];
        *bin = (bin.0 + error.re, bin.1 + i.re, bin.2 + 1);
        for (sum, n) in amplitudes.iter_mut().zip([1].iter().chain(&HARMONICS)) {
            *sum += i * Complex64::cis(-f64::from(*n) * phi);
        }
    }
    let points = |of: fn(&(f64, f64, u32)) -> f64| {
        let centre = |k: usize| (k as f64 + 0.5) * 360.0 / BINS as f64 - 180.0;
        let bin = |k: usize| &sums[(k + BINS / 2) % BINS];
        (0..BINS).map(|k| (centre(k), of(bin(k)) / f64::from(bin(k).2))).collect()
    };
    Ok(Case {
        error: points(|b| b.0),
        current: points(|b| b.1),
        error_rms: error_stats.rms(),
        harmonics: std::array::from_fn(|k| amplitudes[k + 1].norm() / amplitudes[0].norm()),
    })
}
