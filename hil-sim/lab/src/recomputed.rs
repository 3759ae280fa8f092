//! Comparison of this project's constants with those of Barroso 2017, and results that follow from his numbers without a printed formula.

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Abc, Line};
use drive_settings::tuning::{bisected, rule_3_8};
use sim_bench::plant::{InverterSettings, MeasurementSettings};

use crate::prelude::*;

/// Control period, s.
pub const PERIOD_S: f64 = 1.0 / RATE;
/// The injection frequency, Hz.
pub const CARRIER_HZ: f64 = RATE / CARRIER_SAMPLES as f64;

/// Returns a printed plant: gain and pole.
pub fn plant(place: &str) -> FirstOrder {
    FirstOrder { k: printed(place, "gain"), p: printed(place, "pole") }
}

/// Runs the experiment: Chapters 2 to 4.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    constants(&mut outcome);
    let bound = printed("Figure 13", "bound of the relative difference");
    let within = |hz: &f64| 100.0 * (fictitious(*hz) / hz - 1.0) <= bound;
    let limit = (1..30_000).map(|n| 0.1 * f64::from(n)).take_while(within).last();
    outcome.compared.push(named("difference_small_up_to").of_print(limit.unwrap_or(f64::NAN)));
    // Frequency at which a plant with this pole has lost 3 dB.
    let fast = |pole: &str| {
        let plant = FirstOrder { k: 1.0, p: printed("section 2.6", pole) };
        let gain = |omega_t: f64| plant.response(omega_t).norm() / plant.response(0.0).norm();
        bisected((0.0, 3.0), 40, &|omega_t| gain(omega_t) > 0.5_f64.sqrt()).0
    };
    let twice = (fast("pole p_1") / fast("pole p_2") - 2.0).abs() < 0.5;
    outcome.compared.push(named("twice_as_fast").recomputed(twice));
    outcome.figures.push(figure_13());
    position_loop(&mut outcome);
    Ok(outcome)
}

/// Returns a constant that the program has twice, in plant, bench or laboratory and in the drive; not a number if the two differ.
pub fn both(plant: f64, drive: f32) -> f64 {
    if (f64::from(drive) / plant - 1.0).abs() < 1e-6 { plant } else { f64::NAN }
}

/// Compares the constants of the program with the printed values.
fn constants(outcome: &mut Outcome) {
    let (drive, config, motor) =
        (Settings::default(), Config::default(), MachineSettings::default());
    let plate = config.drive.nameplate;
    let three = |plant: f64, bench: f64, drive: f32| both(both(plant, bench as f32), drive);
    let (bench, inverter) = (config.motor, InverterSettings::default());
    let of_plant = both(motor.lls, motor.llr as f32);
    let leakage = three(of_plant, both(bench.l_ls, bench.l_lr as f32), drive.motor.l_ls);
    let pii = drive.injection.printed;
    let (channels, plant) = ([Line::CHANNEL_A, Line::CHANNEL_B], MeasurementSettings::default());
    let [d, q] = [drive.identified_d(), drive.identified_q()];
    let of_a = Abc { a: 1.0, ..Abc::ZERO }.to_alpha_beta().alpha;
    let of_two = |a, b| f64::from(AlphaBeta::from_two_phases(a, b).beta);
    #[rustfmt::skip] // a constant a line
    let constants = [
        ("Eq. 2.3", "i_alpha of i_a", of_a.into()),
        ("Eq. 2.4", "i_beta of i_a", of_two(1.0, 0.0)),
        ("Eq. 2.4", "i_beta of i_b", of_two(0.0, 1.0)),
        ("Figure 13", "sampling frequency", RATE / 1e3),
        ("section 3.2", "switching frequency of the inverter", RATE / 1e3),
        ("Figure 13", "frequency at which the difference is stated", CARRIER_HZ),
        ("section 3.10", "frequency of injection", CARRIER_HZ),
        ("Table 3", "rated power", 1e-3 * f64::from(plate.power_w)),
        ("Table 3", "poles", 2.0 * f64::from(drive.motor.pole_pairs)),
        ("Table 3", "rated voltage, star", plate.voltage_v.into()),
        ("Table 3", "rated current, star", plate.current_a.into()),
        ("Table 3", "rated frequency", plate.frequency_hz.into()),
        ("Table 3", "rated speed", plate.speed_rpm.into()),
        ("Eq. 3.3", "f_c", both(config.measurement.filter_hz, plant.filter_hz as f32)),
        ("Eq. 3.5", "slope of I_A", both(plant.lsb_a, channels[0].gain)),
        ("Eq. 3.5", "offset of I_A", both(-plant.range_a, channels[0].offset)),
        ("Eq. 3.5", "slope of I_B", channels[1].gain.into()),
        ("Eq. 3.5", "offset of I_B", channels[1].offset.into()),
        ("Figure 19", "current difference at which the curves meet, about", 1e3 * f64::from(pii.reference_a)),
        ("section 3.10", "reference of the direct current in all tests", 1e3 * f64::from(config.drive.i_d())),
        ("Figure 28", "delay from the command to the first switch", inverter.propagation_us),
        ("Figure 28", "further delay to the second switch", both(inverter.dead_time_us, 1e6 * drive.inverter.dead_time_s)),
        ("section 3.6.1", "r_s", three(motor.rs, bench.r_s, drive.motor.r_s)),
        ("section 3.6.2", "r_r", three(motor.rr, bench.r_r, drive.motor.r_r)),
        ("section 3.6.2", "L_l1 = L_l2", 1e3 * leakage),
        ("section 3.6.3", "L_m", 1e3 * three(motor.lm, bench.l_m, drive.motor.l_m)),
        ("Eq. 3.41", "gain", d.k),
        ("Eq. 3.41", "pole", d.p),
        ("Eq. 3.42", "gain", q.k),
        ("Eq. 3.42", "pole", q.p),
        ("Eq. 3.44", "k_s", pii.k_s.into()),
        ("Eq. 3.44", "z_s", pii.z_s.into()),
    ];
    outcome.compared.extend(source::used("S1", constants));
}

/// Analyses Eq. 4.1 with Eq. 4.2: (z - 1)² (z - p) + k_c k (z - z_c).
fn position_loop(outcome: &mut Outcome) {
    let (plant, zero) = (plant("Eq. 4.1"), printed("Eq. 4.2", "zero"));
    let gain = printed("Eq. 4.2", "gain") * plant.k;
    let pole = largest_pole(&[-2.0 - plant.p, 1.0 + 2.0 * plant.p + gain, -plant.p - gain * zero]);
    outcome.metrics.set("position_loop_largest_pole", pole);
    // The rule of section 3.8 considers one integrator, as if the other did not exist.
    if let Ok(rule) = rule_3_8(plant, 1.0 / printed("Eq. 4.1", "f_s")) {
        outcome.compared.push(beside("Eq. 4.2", "gain").recomputed(rule.k_c));
        outcome.compared.push(beside("Eq. 4.2", "zero").recomputed(rule.z_c));
    }
    let unknown = "inertia, friction and the unit of the position";
    let of = |quantity| beside("Eq. 4.1", quantity).unknown(unknown);
    outcome.compared.extend(["gain", "pole"].map(of));
}

/// Draws the fictitious over the real frequency.
fn figure_13() -> Figure {
    let points = |of: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
        (1..=280).map(|n| 10.0 * f64::from(n)).map(|hz| (hz, of(hz))).collect()
    };
    let at = printed("Figure 13", "frequency up to which the difference stays below the bound");
    let mark = |x: f64| vec![(x, 0.0), (x, 10.0)];
    let frequencies = Panel::new("real frequency (Hz)", "fictitious frequency (Hz)")
        .with(Series::line("Eq. 2.18", points(&fictitious)))
        .with(Series::reference("equal", points(&|hz| hz)));
    let difference = Panel::new("real frequency (Hz)", "difference (%)")
        .y_range(0.0, 10.0)
        .with(Series::line("Eq. 2.18", points(&|hz| 100.0 * (fictitious(hz) / hz - 1.0))))
        .with(Series::limit("1 %, printed at 460 Hz", vec![(0.0, 1.0), (2800.0, 1.0)]))
        .with(Series::limit("", mark(at)))
        .with(Series::reference("the carrier", mark(CARRIER_HZ)));
    texts::figure("printed-numbers", "w-frequency").panel(frequencies).panel(difference)
}
