//! Third-party motors: each goes from its nameplate alone through commissioning and saliency self-commissioning to runs
//! in four quadrants and with disturbances.

use std::collections::BTreeMap;
use std::f64::consts::{SQRT_2, TAU};

use drive_commission::Refusal;
use drive_settings::{Flux, SettingsError};

use super::battery::{Summary, trial};
use super::commission::{Outside, Session, unaware};
use super::course::{Kind, Refused, Trial, allowed_a, nominal_limit_a};
use super::disturbed;
use super::drawn_machine::Circuit;
use super::saliency::Probe;
use crate::config::plate::rated;
use crate::prelude::*;
use crate::stats::exact;

const RUNS: u32 = 30;
/// Disturbances in the two parts of a record: none, and all of them at random up to this share of their full sizes.
const DRAWN: [f64; 2] = [0.0, 0.5];
/// Smallest saliency sensitivity, 1/rad, at which a motor counts as trackable, and its largest good angle error, degrees rms.
const ENOUGH: f64 = 0.035;
const GOOD_DEG: f64 = 2.0;
/// Highest rated frequency of an ordinary motor, Hz.
const SLOW_HZ: f64 = 60.0;
/// Faults that state the failure, but not its cause in this motor.
const UNNAMED: [Fault; 10] = [
    Fault::OverCurrentA,
    Fault::OverCurrentB,
    Fault::OverCurrentC,
    Fault::SensorSaturatedA,
    Fault::SensorSaturatedB,
    Fault::CurrentNotAsPredicted,
    Fault::LostAngle,
    Fault::LostLock,
    Fault::NonFiniteState,
    Fault::NothingLearned,
];

/// The random motors.
pub struct ForeignMotors {
    seed: u64,
}

/// A line of the verdict: its name, the motors among which it counts, and the condition.
type Class<'a> = (&'a str, &'a [&'a Record], fn(&Record) -> bool);

/// Stage at which a motor was refused, the words of the refusal, and whether they name the cause.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Refusing {
    stage: String,
    why: String,
    named: bool,
}

/// Result of a motor.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Record {
    refused: Option<Refusing>,
    /// Rated frequency, Hz.
    #[serde(with = "exact")]
    hertz: f64,
    /// Errors of the commissioning in percent, as [`Circuit::values`].
    errors: Vec<f64>,
    /// Saliency sensitivity of the motor at the drive's magnetising current, without load, 1/rad.
    slope: Option<f64>,
    /// Largest q-axis current relative to the d-axis current, and injected voltage relative to the dc-link voltage.
    ratios: Option<(f64, f64)>,
    /// Its runs without and with disturbances.
    runs: [Vec<Trial>; 2],
}

/// Makes a refusal as [`qualify`] returns it.
fn refused(stage: &str, why: impl ToString, named: bool) -> Result<Option<Refusing>, Error> {
    Ok(Some(Refusing { stage: stage.to_owned(), why: why.to_string(), named }))
}

/// Whether settings were refused because of a key of the nameplate.
fn by_plate(error: &SettingsError) -> bool {
    matches!(error, SettingsError::Range { name, .. } if name.starts_with("nameplate."))
}

fn is_named(state: State) -> bool {
    state.fault().is_some_and(|fault| !UNNAMED.contains(&fault))
}

/// Returns a random motor with its inverter and sensors. The nameplate is log-uniform over its range. The circuit is in
/// the usual range, per unit, and its rated current, slip and power are those of the nameplate. The inertia constant is
/// 0.1 to 1 s (`motulator-2kw2` has 0.08 s, Krause's 3 hp 0.7 s). Saturation of teeth, yoke and leakage goes up to that
/// of the saturation models. The size of the switches corresponds to the range of the sensors. The sensors reach 2 to 3
/// times the rated peak current without errors, with 12 bits and the noise of the dissertation's sensors in proportion
/// to the rated current.
fn drawn(seed: u64) -> Config {
    let mut random = seeded(seed);
    let mut between = |low: f64, high: f64| random.random_range(low..=high);
    let mut log = |low: f64, high: f64| between(low.ln(), high.ln()).exp();
    let [volts, watts, hertz] =
        [(24.0, 690.0), (50.0, 30e3), (25.0, 400.0)].map(|(a, b)| log(a, b));
    let circuit = [(0.02, 0.1), (0.015, 0.08), (0.05, 0.15), (0.05, 0.15), (1.0, 4.0)];
    let [r_s, r_r, x_s, x_r, x_m] = circuit.map(|(a, b)| log(a, b));
    let (inertia_s, range) = (log(0.1, 1.0), log(2.0, 3.0));
    let pole_pairs = between(1.0, 7.0).min(6.0) as u32;
    let (slip, power) = rated([r_s, r_r, x_s, x_r, x_m]);
    let (amperes, speed) =
        (watts / (3_f64.sqrt() * volts * power), TAU * hertz / f64::from(pole_pairs));
    let z = volts / (3_f64.sqrt() * amperes);
    let l = z / (TAU * hertz);
    let mut config = Config::default();
    let (m, plate) = (&mut config.motor, &mut config.drive.nameplate);
    (m.r_s, m.r_r, m.l_ls, m.l_lr, m.l_m) = (r_s * z, r_r * z, x_s * l, x_r * l, x_m * l);
    (m.pole_pairs, m.inertia) = (pole_pairs, 2.0 * inertia_s * watts / speed.powi(2));
    m.friction = 0.005 * watts / speed.powi(2);
    (plate.power_w, plate.voltage_v, plate.current_a) =
        (watts as f32, volts as f32, amperes as f32);
    plate.frequency_hz = hertz as f32;
    plate.speed_rpm = ((1.0 - slip) * speed * 60.0 / TAU) as f32;
    config.drive.sequence.flux = Flux::High;
    config.drive.injection.synchronous.allow_unlearned = false;
    config.inverter.dc_link_v = SQRT_2 * volts;
    config.drive.inverter.dc_link_v = config.inverter.dc_link_v as f32;
    let (per_ampere, sensors) = (1.0 / config.amperes(1.0), &mut config.measurement);
    config.inverter.smoothing_a *= range * SQRT_2 * amperes / sensors.range_a;
    sensors.range_a = range * SQRT_2 * amperes;
    sensors.noise_a = Some(0.005 / per_ampere);
    sensors.dc_link_range_v = Some(1.45 * config.inverter.dc_link_v);
    let iron = &mut config.iron;
    iron.psi_n = Some(volts * (2.0_f64 / 3.0).sqrt() / (TAU * hertz));
    (iron.teeth, iron.teeth_gap) = (Some(between(-0.08, -0.02)), Some(between(0.0, 1.0)));
    iron.saturation = Some(between(1.0, 1.5));
    iron.exponent = Some(between(4.0, 9.0) as u32);
    iron.leakage_saturation = Some(per_ampere * between(0.05, 0.15));
    config.model.plant = PlantModel::R;
    config.calibrate();
    config
}

fn some<'a>(from: &[&'a Record], is: fn(&Record) -> bool) -> Vec<&'a Record> {
    from.iter().copied().filter(|record| is(record)).collect()
}

/// Runs a motor from the nameplate to the last run; returns the refusal that ended it.
fn qualify(config: &mut Config, seed: u64, record: &mut Record) -> Result<Option<Refusing>, Error> {
    if let Err(error) = config.drive.build() {
        return refused(if by_plate(&error) { "nameplate" } else { "settings" }, error, true);
    }
    let session = match or_refusal(Session::run(config, seed, &Outside::NONE))? {
        Ok(session) => session,
        Err(why) => return refused("commission", why, false),
    };
    if let Some((step, why)) = session.refusal() {
        let named = !matches!(why, Refusal::Drive(state) if !is_named(state));
        return refused("commission", format!("{}: {why}", step.word()), named);
    }
    let settings = session.commissioning.settings(&unaware(config));
    config.drive = settings;
    config.drive.inertia = Some(config.motor.inertia as f32);
    let i_d = f64::from(settings.i_d());
    let [found, truth] = session.circuits(config, &settings);
    record.errors = found.errors_pct(&truth).to_vec();
    if let Err(error) = config.drive.build() {
        return refused("settings", error, true);
    }
    record.slope = Probe::new(config)?.slope(i_d, 0.0);
    for (share, runs) in DRAWN.into_iter().zip(&mut record.runs) {
        let mut bench = config.clone();
        bench.disturbed.drawn = share;
        let disturb = |bench: &mut Config, all: &[disturbed::Disturbance]| {
            let sizes = disturbed::sizes(bench, all, seed);
            disturbed::add(bench, all, &sizes);
        };
        disturb(&mut bench, &disturbed::ALWAYS);
        let mut rig = Rig::new(&plant_settings(&bench), &config.drive, seed)?;
        if let Err(why) = or_refusal(rig.learn())? {
            if share == 0.0 {
                return refused("learn", why, is_named(rig.drive.state()));
            }
            *runs = vec![Trial::unlearned(seed, rig.drive.state().fault().map_or(0, Fault::code))];
            continue;
        }
        disturb(&mut bench, &disturbed::AFTER);
        let nominal = nominal_limit_a(&bench);
        let most = allowed_a(&rig.drive, nominal)?;
        let carrier = f64::from(config.drive.carrier_v()) / config.inverter.dc_link_v;
        record.ratios = Some((most / i_d, 100.0 * carrier));
        let half = Kind::LoadStep((500.0 * most / nominal) as u16);
        let kinds = [Kind::Quadrants, Kind::Reversals, Kind::Speed(150), half];
        for (seed, kind) in (0..).map(|n| seed_of(seed, n)).zip(kinds) {
            let done = trial(&bench, &rig.drive, kind, seed);
            let run = done.unwrap_or_else(|why| Trial {
                kind: Some(kind),
                refused: Some(Refused::Otherwise(why.to_string())),
                ..Trial::unlearned(seed, 0)
            });
            runs.push(Trial { histogram: Vec::new(), ..run });
        }
    }
    Ok(None)
}

impl Record {
    fn refused_at(&self, stage: &str) -> bool {
        self.refused.as_ref().is_some_and(|refused| refused.stage == stage)
    }

    /// Angle error of the runs without disturbances, degrees rms.
    fn rms(&self) -> f64 {
        let mut error = Stats::default();
        self.runs[0].iter().for_each(|run| error.add(&run.error));
        error.rms()
    }

    /// Whether the motor completed the saliency self-commissioning, and all runs without disturbances reached their end.
    fn is_whole(&self) -> bool {
        let whole = |run: &Trial| run.refused.is_none() && run.trip.is_none();
        self.refused.is_none() && self.runs[0].iter().all(whole)
    }

    /// Whether the runs are complete and their error is small.
    fn is_good(&self) -> bool {
        self.is_whole() && self.rms() <= GOOD_DEG
    }
}

impl ForeignMotors {
    fn drawn(&self, number: usize) -> Config {
        drawn(seed_of(self.seed, number))
    }
}

impl Study for ForeignMotors {
    type Record = Record;
    const NAME: &'static str = "foreign-motors";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let runs = context.config.extent.runs.unwrap_or(RUNS) as usize;
        Ok((Self { seed: context.seed }, runs))
    }

    fn run(&self, number: usize) -> Result<Record, Error> {
        let (mut config, seed) = (self.drawn(number), seed_of(self.seed, number));
        let hertz = f64::from(config.drive.nameplate.frequency_hz);
        let mut record = Record { hertz, ..Record::default() };
        record.refused = qualify(&mut config, seed, &mut record)?;
        Ok(record)
    }

    fn outcome(&self, _: &Context<'_>, records: Vec<Record>) -> Result<Outcome, Error> {
        let (mut outcome, all) = (Outcome::default(), records.iter().collect::<Vec<_>>());
        let legal = some(&all, |r| !r.refused_at("nameplate"));
        let commissioned = some(&legal, |r| !r.errors.is_empty());
        let refused = some(&legal, |r| r.refused.is_some());
        let salient = some(&commissioned, |r| r.slope.is_some_and(|slope| slope.abs() > ENOUGH));
        let slow = some(&salient, |r| r.hertz <= SLOW_HZ);
        let unnamed = |r: &Record| r.refused.as_ref().is_some_and(|why| !why.named);
        let rows: [Class<'_>; 9] = [
            ("refused by its nameplate", &all, |r| r.refused_at("nameplate")),
            ("refused in other words", &legal, |r| r.refused.is_some()),
            ("without a named cause", &refused, unnamed),
            ("commissioned", &legal, |r| !r.errors.is_empty()),
            ("with a slope", &commissioned, |r| r.slope.is_some_and(|slope| slope.abs() > ENOUGH)),
            ("learned", &salient, |r| r.refused.is_none()),
            ("run to the end", &salient, Record::is_whole),
            ("good", &salient, Record::is_good),
            ("good up to 60 Hz", &slow, Record::is_good),
        ];
        let mut table = texts::table("foreign-motors", "motors");
        for (name, from, is) in rows {
            let count = some(from, is).len();
            let share = 100.0 * count as f64 / from.len() as f64;
            outcome.metrics.set(format!("{}_pct", name.replace(' ', "_")), share);
            table.record([
                ("motors", Cell::from(name)),
                ("number", Cell::from(count.to_string())),
                ("of", Cell::from(from.len().to_string())),
                ("share (%)", Cell::fixed(share, 1)),
            ]);
        }
        outcome.tables.push(table);
        let m = &mut outcome.metrics;
        m.set("motors", all.len() as f64);
        for (n, (name, _)) in Circuit::of([1.0; 5]).values().iter().enumerate() {
            let sizes = sorted(commissioned.iter().map(|r| r.errors[n].abs()));
            m.set(format!("error_median_pct.{name}"), quantile(&sizes, 0.5));
            m.set(format!("error_q95_pct.{name}"), quantile(&sizes, 0.95));
        }
        for (part, word) in ["undisturbed", "disturbed"].into_iter().enumerate() {
            let runs = Summary::of(all.iter().flat_map(|r| &r.runs[part]));
            let mut count = |what: &str, is: fn(&Trial) -> bool| {
                m.set(format!("{word}_{what}"), runs.count(is) as f64);
            };
            count("runs", |_| true);
            count("lost_runs", Trial::is_lost);
            count("silent_runs", Trial::is_silent);
            count("stopped_runs", |run| run.trip.is_some());
            count("refused_runs", |run| run.refused.is_some());
        }
        let (mut whys, mut listed) = (BTreeMap::<String, usize>::new(), Table::new("Motors", &[]));
        for (number, record) in records.iter().enumerate() {
            let mut told = Vec::new();
            if let Some(Refusing { stage, why, .. }) = &record.refused {
                let cause = why.split(" = ").next().and_then(|why| why.split(": slope").next());
                *whys.entry(format!("{stage}: {}", cause.unwrap_or(why))).or_default() += 1;
                told.push(format!("{stage}: {why}"));
            }
            for (word, runs) in ["", "disturbed: "].iter().zip(&record.runs) {
                told.extend(
                    runs.iter().filter_map(|run| Some(format!("{word}{}", run.failure()?))),
                );
            }
            listed.record([
                ("motor", Cell::from(number.to_string())),
                ("settings", Cell::from(self.drawn(number).changes().join(" "))),
                ("slope (1/rad)", Cell::fixed_or_dash(record.slope, 4)),
                ("i_q/i_d", Cell::fixed_or_dash(record.ratios.map(|it| it.0), 2)),
                (
                    "carrier (% of the dc link)",
                    Cell::fixed_or_dash(record.ratios.map(|it| it.1), 1),
                ),
                ("rms (°)", Cell::fixed_or_dash(record.rms(), 2)),
                ("what", Cell::from(told.join("; "))),
            ]);
        }
        let mut refusals = Table::new("Refusals", &["in words", "motors"]);
        whys.iter().for_each(|(why, n)| {
            refusals.row([why, &n.to_string()].map(|it| Cell::from(it.as_str())))
        });
        outcome.tables.extend([refusals, listed]);
        Ok(outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without leakage, magnetising current and stator resistance, the rated slip is the rotor resistance, and the
    /// power is the air-gap power minus that share.
    #[test]
    fn the_nameplate_is_that_of_the_circuit() {
        let (slip, power) = rated([0.0, 0.05, 1e-9, 1e-9, 1e9]);
        assert!((slip - 0.05).abs() < 1e-6 && (power - 0.95).abs() < 1e-6, "{slip} {power}");
    }

    /// A straight beginning and a knee: at the flux of the knee the inductance is the filed one, far below it the unsaturated one.
    #[test]
    fn the_truth_is_the_chord_at_the_direct_current() {
        let config = drawn(7);
        let (m, iron) = (&config.motor, plant_settings(&config).iron.unwrap());
        let of = |i_d: f64| Circuit::at(&config, i_d).coupled;
        let coupled = |l_m: f64| l_m * l_m / (l_m + m.l_lr);
        let knee = of(iron.psi_n / m.l_m) / coupled(m.l_m);
        let straight = of(0.01 * iron.psi_n / m.l_m) / coupled(iron.saturation * m.l_m);
        assert!((knee - 1.0).abs() < 1e-6 && (straight - 1.0).abs() < 1e-6, "{knee} {straight}");
    }

    /// The random values fill the range of the nameplate, and the nameplate is the only reason for a refusal before the motor is known.
    #[test]
    fn a_nameplate_builds_or_is_refused_by_its_own_key() {
        let mut poles = [0; 6];
        for seed in 0..100 {
            let config = drawn(seed);
            poles[config.motor.pole_pairs as usize - 1] += 1;
            let built = config.drive.build().map(drop);
            assert!(built.as_ref().err().is_none_or(by_plate), "{seed}: {built:?}");
        }
        assert!(poles.iter().all(|n| *n > 5), "{poles:?}");
    }

    /// Two motors of 87 and 276 Hz. At the points of most torque the cross-saturation turns the flux of the first one, and the next point
    /// was judged by the voltage from there. The second one slips by 16 Hz at its limit, and was led by the observer while it stood.
    #[test]
    fn a_motor_with_much_slip_learns_and_keeps_its_angle() {
        for number in [257, 266] {
            let (seed, mut record) = (seed_of(64001, number), Record::default());
            let refused = qualify(&mut drawn(seed), seed, &mut record).unwrap();
            assert!(refused.is_none(), "{number}: {refused:?}");
            assert!(record.rms() < 2.5, "{number}: {}", record.rms());
        }
    }
}
