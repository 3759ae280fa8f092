//! The current difference over the injection angle, Figure 19.

use drive_core::filter::LPF_AS_PRINTED;

use crate::prelude::*;

/// Gain of the post-processing filter at dc.
pub(super) const PP: f64 = 0.944_061;

const IQ_A: [f64; 7] = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];
/// Step of phi2 - theta, degrees.
const STEP_DEG: i32 = 15;
/// Time for the filters to settle at each angle, s; the averaging takes the same time.
const SETTLE_S: f64 = 0.08;
const AVERAGE_S: f64 = 0.05;

/// One family of curves.
#[derive(Clone, Copy)]
pub(super) struct Variant {
    pub name: &'static str,
    pub title: &'static str,
    pub demodulator: DemodulatorKind,
    pub saliency: bool,
    pub inject: bool,
    /// Whether the currents are as with LPF as printed, whose gain at dc is below 1.
    pub lpf_as_printed: bool,
    /// Whether the delay of the demodulation is compensated.
    pub compensate: bool,
}

#[rustfmt::skip] // a variant a line
pub(super) const LITERAL: Variant =
    Variant { name: "literal", title: "As printed, motor with saliency", demodulator: DemodulatorKind::Literal, saliency: true, inject: true, lpf_as_printed: false, compensate: false };
#[rustfmt::skip] // a variant a line
const RECTIFIED: Variant =
    Variant { name: "rectified", title: "Rectified, delay compensated, motor with saliency", demodulator: DemodulatorKind::Rectified, compensate: true, ..LITERAL };
#[rustfmt::skip] // a variant a line
const VARIANTS: [Variant; 5] = [
    LITERAL,
    Variant { name: "literal_isotropic", title: "As printed, motor without saliency", saliency: false, ..LITERAL },
    Variant { name: "literal_silent", title: "As printed, no saliency and no injection", saliency: false, inject: false, ..LITERAL },
    RECTIFIED,
    Variant { name: "literal_lpf", title: "As printed, with the currents that LPF of Table 7 gives, no saliency", saliency: false, lpf_as_printed: true, ..LITERAL },
];

/// delta_i in mA (with the synchronous demodulation: thousandths) over phi2 - theta in degrees.
type Curve = Vec<(f64, f64)>;

/// Runs the experiment: Figure 19.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let jobs: Vec<(Variant, f64)> =
        VARIANTS.iter().flat_map(|&v| IQ_A.iter().map(move |&iq| (v, iq))).collect();
    let curves = context.in_parallel("injection-map", &jobs, |_, &(variant, iq)| {
        curve(context.config, context.seed, variant, iq)
    })?;

    let mut outcome = Outcome::default();
    for (variant, family) in VARIANTS.iter().zip(curves.chunks(IQ_A.len())) {
        let level = printed("Figure 19", "current difference at which the curves meet, about");
        let ends = |level: f64| vec![(-180.0, level), (180.0, level)];
        let panel = panel("Δi (mA)", &IQ_A, family)
            .with(Series::limit("printed at ±90°", ends(level)))
            .with(Series::limit("", ends(-level)));
        outcome.figures.push(Figure::new(variant.name, variant.title, "Figure 19").panel(panel));
        for (iq, curve) in [(IQ_A[2], &family[2]), (IQ_A[4], &family[4])] {
            let name = format!("{}_at_90_deg_iq_{iq}a_ma", variant.name);
            outcome.metrics.set(name, at(curve, 90.0));
        }
    }
    let isotropic = &curves[IQ_A.len()..2 * IQ_A.len()];
    let silent = &curves[2 * IQ_A.len()..3 * IQ_A.len()];
    let same =
        Stats::of(isotropic.iter().flatten().zip(silent.iter().flatten()).map(|(a, b)| a.1 - b.1));
    outcome.metrics.set("literal_injection_makes_difference_ma", same.largest());
    // On a motor without saliency, the curves of the printed chain meet at ±90° and are zero at the arc tangent.
    let id = f64::from(context.config.drive.i_d());
    let off = |(iq, curve): (&f64, _)| zero(curve).abs() - (iq / id).atan().to_degrees();
    let largest_off = Stats::of(IQ_A.iter().zip(isotropic).map(off)).largest();
    outcome.metrics.set("zero_off_the_arc_tangent_deg", largest_off);
    // Where the curves of neighbouring currents cross, within 75° of an angle.
    let meets = |degrees: f64| {
        let crossing = |pair: &[Curve]| {
            let apart = |x| (x, at(&pair[0], x + degrees) - at(&pair[1], x + degrees));
            degrees + zero(&(-5..=5).map(|k| f64::from(k * STEP_DEG)).map(apart).collect())
        };
        Stats::of(isotropic[1..].windows(2).map(crossing)).mean()
    };
    let printed_lpf = curves[4 * IQ_A.len() + 1..].iter();
    let leak = Stats::of(printed_lpf.map(|curve| at(curve, 90.0).abs())).mean();
    outcome.compared.extend([
        named("zero_without_iq").simulated(zero(&isotropic[0])),
        named("curves_meet_plus").simulated(meets(90.0)),
        named("curves_meet_minus").simulated(meets(-90.0)),
        named("curves_meet_about").simulated(leak),
        named("zero_at_arc_tangent").simulated(largest_off < 2.0),
        // If the curves meet without any injection as well, no impedance explains the meeting.
        named("impedance_explains").simulated(same.largest() > 0.05 * leak),
    ]);
    let rectified = &curves[3 * IQ_A.len()..4 * IQ_A.len()];
    let error = |curve| at(curve, 90.0) / at(&rectified[2], 90.0) - 1.0;
    let constant = Stats::of(rectified[2..].iter().map(error)).largest();
    outcome.metrics.set("rectified_differs_at_90_deg_pct", 100.0 * constant);
    outcome.compared.push(named("iq_does_not_affect").simulated(constant < 0.2));
    Ok(outcome)
}

/// Draws a family of curves, one for each q-axis current, A.
fn panel(y: impl Into<String>, iq_a: &[f64], family: &[Curve]) -> Panel {
    let line = |(iq, curve): (&f64, &Curve)| Series::line(format!("iq = {iq} A"), curve.clone());
    iq_a.iter().zip(family).map(line).fold(Panel::new("φ̂₂ − θ (° electrical)", y), Panel::with)
}

/// Removes the saliency of the motor.
pub(super) fn take_saliency(config: &mut Config) {
    (config.saliency.a_psi, config.saliency.b1, config.saliency.chi) = (0.0, Some(0.0), 0.0);
}

/// Sweeps the injection angle with the encoder as angle source and the shaft locked. If the injection belongs along the
/// flux, theta is counted from 90° ahead of the flux.
fn curve(config: &Config, seed: u64, variant: Variant, iq: f64) -> Result<Curve, Error> {
    let mut config = config.clone();
    config.drive.injection.demodulator = variant.demodulator;
    config.drive.ignore_delays = !variant.compensate;
    if !variant.saliency {
        take_saliency(&mut config);
    }
    if !variant.inject {
        config.drive.injection.amplitude_v = Some(0.0);
    }
    // The regulated current is that behind LPF, so the real one is larger by its gain at dc.
    let gain = if variant.lpf_as_printed { LPF_AS_PRINTED.dc_gain() } else { 1.0 };
    config.drive.sequence.i_d = Some((f64::from(config.drive.i_d()) / gain) as f32);
    let mut rig = Rig::oriented(&config, seed, iq / gain, 0.3)?;
    let mut curve = Curve::new();
    for x in (-180..=180).step_by(STEP_DEG as usize) {
        // theta = phi + 90° + turn, so phi2 - theta = -90° - turn
        rig.settle(&Command::TurnInjection((-90 - x) as f32), SETTLE_S)?;
        let [delta_i, error] = rig.stats(AVERAGE_S, |p| [p.signal() * 1e3, p.angle_error_deg]);
        curve.push((f64::from(x) + error.mean(), delta_i.mean()));
    }
    Ok(curve)
}

/// Linear interpolation.
fn at(curve: &Curve, x: f64) -> f64 {
    let after = curve.iter().position(|p| p.0 >= x).unwrap_or(curve.len() - 1).max(1);
    let (a, b) = (curve[after - 1], curve[after]);
    a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0)
}

/// Returns the angle between -90° and 90° at which the curve crosses zero in either direction.
fn zero(curve: &Curve) -> f64 {
    curve
        .windows(2)
        .filter(|w| w[0].0 > -100.0 && w[1].0 < 100.0)
        .find(|w| w[0].1.signum() != w[1].1.signum())
        .map_or(f64::NAN, |w| w[0].0 - w[0].1 * (w[1].0 - w[0].0) / (w[1].1 - w[0].1))
}
