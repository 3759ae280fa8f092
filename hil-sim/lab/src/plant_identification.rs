//! The plants of the current loop, identified through the drive's own loop, and the controllers that follow from them.

use drive_core::Dq;
use drive_core::filter::{LPF, LpfState};
use drive_settings::tuning::{design_current_loop, motor_plant, rule_3_8};

use crate::identification::arx::{Arx, Orders, fit};
use crate::identification::signals::{self, Prbs};
use crate::prelude::*;
use crate::recomputed::plant;

/// Amplitude of the pseudo-random voltage, V: assumed, because the source gives none. It changes the current by about
/// 0.3 A.
const PRBS_V: f32 = 30.0;
/// Repetitions of the sequence.
const PRBS_PERIODS: usize = 8;
/// Duration of each level of the steps, s.
const LEVEL_S: f64 = 0.05;
/// Samples of a record with a constant part.
const SAMPLES: usize = 4000;
/// Samples shown in a figure.
const SHOWN: usize = 600;
/// Delays under trial, in samples beyond one.
const DELAYS: [usize; 3] = [0, 1, 2];

#[derive(Clone, Copy, PartialEq)]
enum Axis {
    D,
    Q,
}

impl Axis {
    fn of(self, x: Dq) -> f64 {
        f64::from(if self == Self::D { x.d } else { x.q })
    }
}

/// Voltage and current of an axis as seen by the drive.
#[derive(Default)]
struct Record {
    u: Vec<f64>,
    y: Vec<f64>,
    /// Means that were subtracted from voltage and current.
    mean: [f64; 2],
}

impl Record {
    fn push(&mut self, rig: &mut Rig, axis: Axis) {
        rig.step();
        let telemetry = rig.drive.telemetry();
        self.u.push(axis.of(telemetry.voltage));
        self.y.push(axis.of(telemetry.current));
    }

    /// Returns the voltage after the same filter that the current has passed. The same equation then holds between the
    /// two, and the plant is that of the motor.
    fn alike(&self) -> Vec<f64> {
        let mut state = LpfState::default();
        let filtered =
            |u: &f64| f64::from(LPF.step(&mut state, AlphaBeta::new(*u as f32, 0.0)).alpha);
        self.u.iter().map(filtered).collect()
    }

    /// Subtracts the means, which gives the plant about the operating point.
    fn without_mean(mut self) -> Self {
        for (x, kept) in [&mut self.u, &mut self.y].into_iter().zip(&mut self.mean) {
            let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
            x.iter_mut().for_each(|x| *x -= mean);
            *kept += mean;
        }
        self
    }
}

/// An excitation of the source, and the printed plant.
struct Trial {
    name: &'static str,
    key: &'static str,
    figure: &'static str,
    /// The place where its plant is printed.
    printed: &'static str,
    axis: Axis,
    record: fn(&mut Rig) -> Result<Record, Error>,
}

#[rustfmt::skip] // a trial a line
const TRIALS: [Trial; 3] = [
    Trial { name: "steps 0, 2, -2, 0 A on q", key: "steps", figure: "Figure 22", printed: "Eq. 3.34", axis: Axis::Q, record: steps },
    Trial { name: "pseudo-random on d", key: "d", figure: "Figure 31", printed: "Eq. 3.41", axis: Axis::D, record: |rig| prbs(rig, Axis::D) },
    Trial { name: "pseudo-random on q at 2 A", key: "q", figure: "Figure 32", printed: "Eq. 3.42", axis: Axis::Q, record: at_2_a },
];

/// Pseudo-random voltage on q, at a q-axis current of 2 A.
fn at_2_a(rig: &mut Rig) -> Result<Record, Error> {
    let level = printed("Figure 32", "reference of i_q");
    rig.settle(&Command::Torque(level as f32), 1.0)?;
    prbs(rig, Axis::Q)
}

fn steps(rig: &mut Rig) -> Result<Record, Error> {
    let mut record = Record::default();
    for level in source::column("S1", "Figure 22", "reference of i_q") {
        rig.command(&Command::Torque(level as f32))?;
        for _ in 0..(LEVEL_S * RATE_HZ) as usize {
            record.push(rig, Axis::Q);
        }
    }
    Ok(record)
}

fn prbs(rig: &mut Rig, axis: Axis) -> Result<Record, Error> {
    let mut sequence = Prbs::default();
    let mut record = Record::default();
    for _ in 0..PRBS_PERIODS * Prbs::PERIOD {
        let volts = PRBS_V * sequence.step() as f32;
        let voltage = if axis == Axis::D { Dq::new(volts, 0.0) } else { Dq::new(0.0, volts) };
        rig.command(&Command::TestVoltage(voltage))?;
        record.push(rig, axis);
    }
    rig.command(&Command::TestVoltage(Dq::ZERO))?;
    Ok(record.without_mean())
}

/// A first-order plant (b1 + b2 z^-1) z^-d / (z - p) with k = b1 + b2, and the rms residual of the current, A.
#[derive(Clone, Copy)]
struct IdentifiedPlant {
    plant: FirstOrder,
    b: [f64; 2],
    delay: usize,
    condition: f64,
    rms: f64,
}

impl IdentifiedPlant {
    /// Fits the plant, with two coefficients of the voltage if the delay is not a whole number of samples: the
    /// current's analog filter has 0.18.
    fn fit(u: &[f64], y: &[f64], inputs: usize, delay: usize) -> Result<Self, Error> {
        let refused = |reason| Error::Refused(format!("least squares: {reason}"));
        let Arx { a, b, condition, rms } =
            fit(u, y, Orders { outputs: 1, inputs, delay }).map_err(refused)?;
        let b = [b[0], b.get(1).copied().unwrap_or(0.0)];
        let plant = FirstOrder { k: b[0] + b[1], p: -a[0] };
        Ok(Self { plant, b, delay, condition, rms })
    }
}

fn bench(context: &Context<'_>) -> Result<Rig, Error> {
    let mut config = context.config.clone();
    config.drive.angle_source = AngleSource::Encoder;
    config.load.mode = LoadMode::Locked;
    Rig::started(&config, context.seed, Mode::Torque)
}

/// Runs the experiment: Sections 3.7, 3.8 and 3.10, appendix A.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let motor = context.config.drive.motor.into();
    let motor = motor_plant(&motor, 1.0 / RATE_HZ).map_err(Error::refused)?;
    let mut outcome = Outcome::default();
    let values = [("k", motor.k), ("p", motor.p)];
    let mut plants = texts::table_with("plant-identification", "plants", &values);
    for trial in &TRIALS {
        let mut rig = bench(context)?;
        let record = (trial.record)(&mut rig)?;
        let printed = IdentifiedPlant::fit(&record.u, &record.y, 1, 0)?;
        let u = record.alike();
        let with = |&delay: &usize| IdentifiedPlant::fit(&u, &record.y, 2, delay);
        let found = DELAYS.iter().map(with).collect::<Result<Vec<_>, _>>()?;
        let best = found.iter().copied().reduce(|a, b| if b.rms < a.rms { b } else { a });
        let best = best.ok_or_else(|| Error::Internal("no delay was tried".to_owned()))?;
        for (how, one) in [("as printed", printed), ("filtered alike", best)] {
            plants.record([
                ("data", Cell::from(trial.name)),
                ("voltage", Cell::from(how)),
                ("d", Cell::fixed(one.delay as f64, 0)),
                ("k (A/V)", Cell::significant(one.plant.k, 4)),
                ("p", Cell::fixed(one.plant.p, 4)),
                ("condition", Cell::significant(one.condition, 2)),
                ("left (mA rms)", Cell::fixed(1e3 * one.rms, 1)),
            ]);
        }
        let rule = rule_3_8(best.plant, 1.0 / RATE_HZ).map_err(Error::refused)?;
        let unknown = "the motor on the day of the test, and the amplitude of the sequence";
        for (quantity, value) in [("gain", best.plant.k), ("pole", best.plant.p)] {
            let ours = beside(trial.printed, quantity).unknown(unknown);
            outcome.compared.push(ours.simulated(value));
        }
        let design =
            design_current_loop(best.plant, motor, 1.0 / RATE_HZ).map_err(Error::refused)?;
        let key = trial.key;
        for (name, value) in [
            ("k_a_per_v", best.plant.k),
            ("p", best.plant.p),
            ("delay_samples", best.delay as f64),
            ("condition", best.condition),
            ("left_rms_a", best.rms),
            ("kc_v_per_a", rule.k_c),
            ("zc", rule.z_c),
            ("kc_reduced_v_per_a", design.k_c),
        ] {
            outcome.metrics.set(format!("{key}_{name}"), value);
        }
        outcome.figures.push(figure(trial, &record, &u, &best));
    }
    outcome.tables.push(plants);
    remark(context, &mut outcome)?;
    Ok(outcome)
}

/// Draws the measured current beside the response of the identified plant to the same voltage.
fn figure(trial: &Trial, record: &Record, u: &[f64], found: &IdentifiedPlant) -> Figure {
    let axis = if trial.axis == Axis::D { "d" } else { "q" };
    let count = record.y.len().min(if trial.key == "steps" { usize::MAX } else { SHOWN });
    let mut modelled = Vec::with_capacity(count);
    for k in 0..count {
        let past = k.checked_sub(2 + found.delay);
        modelled.push(match (past, modelled.last()) {
            (Some(past), Some(&last)) => {
                found.plant.p * last + found.b[0] * u[past + 1] + found.b[1] * u[past]
            }
            _ => record.y[k],
        });
    }
    let over_time = |x: &[f64], mean: f64| -> Vec<(f64, f64)> {
        let at = |(k, x): (usize, &f64)| (1e3 * k as f64 / RATE_HZ, x + mean);
        x.iter().take(count).enumerate().map(at).collect()
    };
    let [u_mean, y_mean] = record.mean;
    let voltage = Panel::new("time (ms)", format!("v_{axis} (V)"))
        .with(Series::line("voltage of the loop", over_time(&record.u, u_mean)));
    let current = Panel::new("time (ms)", format!("i_{axis} (A)"))
        .with(Series::line("measured", over_time(&record.y, y_mean)))
        .with(Series::reference("identified", over_time(&modelled, y_mean)));
    let name = format!("identification-{}", trial.key);
    let title = format!("Identification of the plant: {}", trial.name);
    Figure::new(name, title, trial.figure).panel(voltage).panel(current)
}

/// Error of the pole of Eq. 3.34 that appendix A finds with 50 mA of noise, if voltage and current keep their means for the last part of
/// the record. It is infinite if the least squares refuse the record.
fn with_constant(share: f64, seed: u64) -> f64 {
    let plant = plant("Eq. 3.34");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (mut sequence, mut current) = (Prbs::default(), 0.0);
    let (mut u, mut y) = (Vec::new(), Vec::new());
    for n in 0..SAMPLES {
        let is_still = n as f64 >= (1.0 - share) * SAMPLES as f64;
        let volts = if is_still { 0.0 } else { f64::from(PRBS_V) * sequence.step() };
        u.push(volts);
        y.push(current + signals::noise(&mut rng, 0.05).re);
        current = plant.p * current + plant.k * volts;
    }
    let found = fit(&u, &y, Orders { outputs: 1, inputs: 1, delay: 0 });
    found.map_or(f64::INFINITY, |found| (found.a[0] + plant.p).abs())
}

/// Adds the remarks, and the verdict of the same least squares on data without excitation.
fn remark(context: &Context<'_>, outcome: &mut Outcome) -> Result<(), Error> {
    let mut rig = bench(context)?;
    rig.wait(1.0);
    let mut still = Record::default();
    for _ in 0..500 {
        still.push(&mut rig, Axis::Q);
    }
    let errors = [0.0, 0.5, 0.9].map(|share| with_constant(share, context.seed));
    outcome.compared.push(named("constants_degrade").recomputed(errors.is_sorted_by(|a, b| a < b)));
    let bits = (Prbs::PERIOD as f64 + 1.0).log2();
    outcome.compared.push(beside("section 3.10", "bits of the pseudo-random sequence").used(bits));
    let still = still.without_mean();
    let noise = IdentifiedPlant::fit(&still.u, &still.y, 1, 0)?;
    let values = [("condition", noise.condition), ("k", noise.plant.k)];
    texts::add_remarks(outcome, "plant-identification", &values);
    Ok(())
}
