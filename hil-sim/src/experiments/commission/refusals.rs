//! Tests whether defects of motor, wiring, sensors and board are refused by name.

use drive_commission::{Meaning, Refusal, Step};
use drive_core::Sample;

use super::session::{Outside, Session, unaware};
use crate::config::{FluxLevel, OpenPhase};
use crate::experiments::drawn_machine::drawn;
use crate::plant::{Channel, CurrentFault};
use crate::prelude::*;

const RUNS: u32 = 50;

/// A defect.
struct Defect {
    name: &'static str,
    /// Makes the defect in the configuration of bench and drive.
    make: fn(&mut Config),
    /// Makes the defect on the bench.
    on_bench: fn(&mut Rig),
    /// Makes the defect in the sensor readings.
    sensors: fn(&mut Sample),
    /// Whether this refusal names the defect.
    named: fn(&Refusal) -> bool,
    /// The step that is aborted.
    abort: Option<Step>,
}

#[rustfmt::skip] // as the rows below
const NONE: Defect =
    Defect { name: "", make: |_| {}, on_bench: |_| {}, sensors: |_| {}, named: |_| false, abort: None };

/// ADC counts of the channels without current.
const ZERO: [u16; 2] = [2022, 2015];

fn meant(refusal: &Refusal, meaning: Meaning) -> bool {
    matches!(refusal, Refusal::Value { meaning: m, .. } if *m == meaning)
}

/// Scales the resistances and inductances of a motor by a common factor.
fn scaled(config: &mut Config, factor: f64) {
    let m = &mut config.motor;
    for value in [&mut m.r_s, &mut m.r_r, &mut m.l_ls, &mut m.l_lr, &mut m.l_m] {
        *value *= factor;
    }
    config.saliency.psi_n = None;
}

/// Makes a motor with saturation of the main flux.
fn saturating(config: &mut Config) {
    config.saliency = Config::default().saliency;
    (config.model.plant, config.model.flux_level) = (PlantModel::M4, FluxLevel::High);
}

fn stopped(refusal: &Refusal) -> bool {
    matches!(refusal, Refusal::Drive(State::Off))
}

#[rustfmt::skip] // a row a defect
const DEFECTS: &[Defect] = &[
    Defect { name: "sensors exchanged", sensors: |s| (s.current_a, s.current_b) = (s.current_b, s.current_a), named: |r| matches!(r, Refusal::Wiring(Fault::WiringExchanged)), ..NONE },
    Defect { name: "sensor a reversed", sensors: |s| s.current_a = 2 * ZERO[0] - s.current_a, named: |r| matches!(r, Refusal::Wiring(Fault::WiringPolarityA)), ..NONE },
    Defect { name: "sensor b reversed", sensors: |s| s.current_b = 2 * ZERO[1] - s.current_b, named: |r| matches!(r, Refusal::Wiring(Fault::WiringPolarityB)), ..NONE },
    Defect { name: "sensor b in phase c", sensors: |s| s.current_b = ZERO[0] + ZERO[1] + ZERO[1] - s.current_a - s.current_b, named: |r| matches!(r, Refusal::Wiring(Fault::WiringExchanged)), ..NONE },
    Defect { name: "phase a open", make: |c| c.inverter.open_phase = OpenPhase::A, named: |r| *r == Refusal::PhaseOpen(0), ..NONE },
    Defect { name: "phase b open", make: |c| c.inverter.open_phase = OpenPhase::B, named: |r| *r == Refusal::PhaseOpen(1), ..NONE },
    Defect { name: "phase c open", make: |c| c.inverter.open_phase = OpenPhase::C, named: |r| *r == Refusal::PhaseOpen(2), ..NONE },
    Defect { name: "sensor a open", on_bench: |r| r.plant.set_current_fault(Channel::A, CurrentFault::Open), named: |r| *r == Refusal::SensorOpen(0), ..NONE },
    Defect { name: "sensor b open", on_bench: |r| r.plant.set_current_fault(Channel::B, CurrentFault::Open), named: |r| *r == Refusal::SensorOpen(1), ..NONE },
    Defect { name: "no motor (1000 times the impedance)", make: |c| { scaled(c, 1000.0); c.motor.r_s = c.motor.r_s.min(1000.0); c.motor.r_r = c.motor.r_r.min(1000.0); c.motor.l_m = c.motor.l_m.min(100.0); c.motor.l_ls = c.motor.l_ls.clamp(5.0, 10.0); c.motor.l_lr = c.motor.l_ls; }, named: |r| *r == Refusal::NoMotor, ..NONE },
    Defect { name: "motor ten times too small", make: |c| scaled(c, 10.0), named: |r| meant(r, Meaning::TooSmall), ..NONE },
    Defect { name: "motor ten times too large", make: |c| scaled(c, 0.1), named: |r| meant(r, Meaning::TooLarge), ..NONE },
    Defect { name: "dc link 28 % of the plate's peak", make: |c| { c.inverter.dc_link_v = 150.0; c.drive.inverter.dc_link_v = 150.0; }, named: |r| meant(r, Meaning::BusTooLow), ..NONE },
    Defect { name: "dc link below its limit", make: |c| { c.inverter.dc_link_v = 100.0; }, named: |r| matches!(r, Refusal::Drive(State::Fault(Fault::DcLinkUnderVoltage))), ..NONE },
    Defect { name: "noise 50 mA", make: |c| c.measurement.noise_a = Some(0.05), named: |r| meant(r, Meaning::Noise), ..NONE },
    Defect { name: "offset 0.25 A", make: |c| c.measurement.offset_b = 0.25, named: |r| matches!(r, Refusal::Drive(State::Fault(Fault::OffsetB))), ..NONE },
    Defect { name: "gain of a 10 % off", make: |c| c.measurement.gain_error_a = 0.1, named: |r| meant(r, Meaning::Mismatch) || meant(r, Meaning::Turning), ..NONE },
    Defect { name: "shaft at 10 rpm", make: |c| { c.load.mode = LoadMode::Speed; c.load.speed_rpm = 10.0; }, named: |r| meant(r, Meaning::Mismatch) || meant(r, Meaning::Turning), ..NONE },
    Defect { name: "shaft at -30 rpm", make: |c| { c.load.mode = LoadMode::Speed; c.load.speed_rpm = -30.0; }, named: |r| meant(r, Meaning::Mismatch) || meant(r, Meaning::Turning), ..NONE },
    Defect { name: "shaft at 1000 rpm", make: |c| { c.load.mode = LoadMode::Speed; c.load.speed_rpm = 1000.0; }, named: |r| meant(r, Meaning::Mismatch) || meant(r, Meaning::Turning), ..NONE },
    Defect { name: "aborted in sensors", abort: Some(Step::Sensors), named: stopped, ..NONE },
    Defect { name: "aborted in wiring", abort: Some(Step::Wiring), named: stopped, ..NONE },
    Defect { name: "aborted in levels", abort: Some(Step::Levels), named: stopped, ..NONE },
    Defect { name: "aborted in leakage", abort: Some(Step::Leakage), named: stopped, ..NONE },
    Defect { name: "aborted in staircase", make: saturating, abort: Some(Step::Staircase), named: stopped, ..NONE },
    Defect { name: "aborted in current-loop", abort: Some(Step::CurrentLoop), named: stopped, ..NONE },
];

/// Longest time from the beginning of a step to its abort, control periods.
fn abort_within(step: Step) -> u32 {
    match step {
        Step::Sensors | Step::CurrentLoop => 1200,
        Step::Wiring => 800,
        _ => 6000,
    }
}

/// The sessions: `runs` with each defect.
pub struct Refusals {
    config: Config,
    seed: u64,
    runs: usize,
}

/// A session with a defect.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// The answer.
    answer: String,
    /// Whether the answer names the defect; and whether the outputs are off and the settings unchanged.
    named: bool,
    unchanged: bool,
    seconds: f64,
    largest_a: f64,
}

impl Study for Refusals {
    type Record = Record;
    const NAME: &'static str = "commission-refusals";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let mut config = context.config.clone();
        config.prepare.learn = false;
        let runs = config.extent.runs.unwrap_or(RUNS) as usize;
        Ok((Self { config, seed: context.seed, runs }, DEFECTS.len() * runs))
    }

    fn run(&self, number: usize) -> Result<Record, Error> {
        let defect = &DEFECTS[number / self.runs];
        let seed = seed_of(self.seed, number);
        let mut config = drawn(&self.config, seed);
        (defect.make)(&mut config);
        config.calibrate();
        let settings = unaware(&config);
        let within = |step| (step, seeded(seed).random_range(1..abort_within(step)));
        let Defect { on_bench, sensors, abort, .. } = *defect;
        let outside = Outside { on_bench, sensors, abort: abort.map(within) };
        let session = Session::run(&config, seed, &outside)?;
        let refusal = session.refusal().map(|(_, refusal)| refusal);
        let off = session.rig.drive.state().is_off();
        Ok(Record {
            answer: refusal.map_or("accepted".into(), |refusal| refusal.to_string()),
            named: refusal.is_some_and(|refusal| (defect.named)(&refusal)),
            unchanged: off && session.commissioning.settings(&settings) == settings,
            seconds: session.seconds,
            largest_a: session.rig.peak_a,
        })
    }

    fn outcome(&self, _: &Context<'_>, records: Vec<Record>) -> Result<Outcome, Error> {
        let most = |of: fn(&Record) -> f64, all: &[Record]| all.iter().map(of).fold(0.0, f64::max);
        let count = |is: fn(&Record) -> bool, all: &[Record]| {
            all.iter().filter(|record| is(record)).count() as f64
        };
        let answer = |all: &[Record]| {
            let other = all.iter().rfind(|record| !record.named).or(all.last());
            other.map_or(String::new(), |record| record.answer.clone())
        };
        let columns = columns![|n, all: &&[Record]|
            "defect" => Cell::from(DEFECTS[n].name);
            "machines" => Cell::fixed(all.len() as f64, 0);
            "named" => Cell::fixed(count(|r| r.named, all), 0);
            "unchanged" => Cell::fixed(count(|r| r.unchanged, all), 0);
            "within (s)" => Cell::fixed(most(|r| r.seconds, all), 1);
            "largest (A)" => Cell::fixed(most(|r| r.largest_a, all), 2);
            "last other answer, or an answer" => Cell::from(answer(all));
        ];
        let parts: Vec<&[Record]> = records.chunks(self.runs).collect();
        let mut outcome = Outcome::default();
        outcome.metrics.set("sessions", records.len() as f64);
        outcome.metrics.set("named", count(|r| r.named, &records));
        outcome.metrics.set("unchanged", count(|r| r.unchanged, &records));
        outcome.tables.push(Table::of("Refusals", &columns, parts.iter().enumerate()));
        Ok(outcome)
    }
}
