//! A drive that has learned its motor, at sixteen operating points: for the motor of the configuration, or for random
//! machines around it.

use super::drawn_machine::around;
use super::steady::{OperatingPoint, SteadyRun, judged, prepared};
use crate::prelude::*;

/// q-axis currents of the operating points, A on the dissertation's motor; both signs.
const IQ_A: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// Speeds, rpm on four poles.
const SPEEDS_RPM: [f64; 2] = [0.0, 150.0];
/// Time of each run, s, after the settling.
const RUN_S: f64 = 2.0;
/// Largest angle error of a good machine in every run, degrees: rms, largest.
const GOOD_DEG: (f64, f64) = (4.0, 14.0);
/// Number of random machines, unless `runs` sets another.
const MACHINES: u32 = 100;
/// Number of machines in the table, worst first.
const LISTED: usize = 20;

/// A machine and its runs, or the reason why there are none.
struct Machine {
    config: Config,
    runs: Result<Vec<SteadyRun>, String>,
}

impl Machine {
    fn worst(&self, of: impl Fn(&SteadyRun) -> f64) -> f64 {
        self.runs.iter().flatten().map(of).fold(0.0, f64::max)
    }

    fn rms(&self) -> f64 {
        self.worst(|run| run.error.rms())
    }

    fn largest(&self) -> f64 {
        self.worst(|run| run.error.largest())
    }

    fn lost(&self) -> usize {
        self.runs.iter().flatten().filter(|run| run.lost).count()
    }

    fn is_good(&self) -> bool {
        self.runs.as_ref().is_ok_and(|runs| good(runs))
    }

    /// Describes the outcome in words.
    fn verdict(&self) -> String {
        match (&self.runs, self.lost()) {
            (Err(why), _) => why.clone(),
            (Ok(_), 0) if self.is_good() => "good".into(),
            (Ok(_), 0) => "angle error too large".into(),
            (Ok(_), lost) => format!("{lost} runs lost"),
        }
    }
}

/// Whether all runs are good.
pub(super) fn good(runs: &[SteadyRun]) -> bool {
    let within = |run: &SteadyRun| {
        !run.lost && run.error.rms() <= GOOD_DEG.0 && run.error.largest() <= GOOD_DEG.1
    };
    runs.iter().all(within)
}

/// Starts a drive that has learned again for each operating point.
pub(super) fn runs(
    learned: &Rig,
    config: &Config,
    seed: u64,
    seconds: f64,
) -> Result<Vec<SteadyRun>, Error> {
    let both = |&iq: &f64| [1.0, -1.0].map(|sign| sign * config.amperes(iq));
    let cases = SPEEDS_RPM.iter().flat_map(|&speed| {
        let rpm = config.rpm(speed);
        IQ_A.iter().flat_map(both).map(move |iq| OperatingPoint { rpm, iq, seed })
    });
    cases.map(|case| judged(learned.clone(), case, seconds)).collect()
}

/// Returns a random machine around the motor; its drive knows the circuit.
fn drawn(config: &Config, seed: u64) -> Config {
    let mut random = seeded(seed);
    let mut drawn = around(config, &mut random, config.spread.machine);
    let (m, drive) = (&drawn.motor, &mut drawn.drive.motor);
    (drive.r_s, drive.r_r) = (m.r_s as f32, m.r_r as f32);
    (drive.l_ls, drive.l_lr, drive.l_m) = (m.l_ls as f32, m.l_lr as f32, m.l_m as f32);
    drawn
}

/// The machines, each with all its runs.
pub struct Machines {
    config: Config,
    seed: u64,
    seconds: f64,
    draws: bool,
}

impl Machines {
    /// Returns configuration and seed of a machine.
    fn drawn(&self, number: usize) -> (Config, u64) {
        let seed = seed_of(self.seed, number);
        (if self.draws { drawn(&self.config, seed) } else { self.config.clone() }, seed)
    }
}

impl Study for Machines {
    /// The runs, or the refusal of the drive.
    type Record = Result<Vec<SteadyRun>, String>;
    const NAME: &'static str = "machines";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let mut config = context.config.clone();
        config.prepare.learn = true;
        let draws = config.spread.machine > 1.0;
        let seconds = context.seconds.unwrap_or(RUN_S);
        let runs = if draws { config.extent.runs.unwrap_or(MACHINES) as usize } else { 1 };
        Ok((Self { config, seed: context.seed, seconds, draws }, runs))
    }

    fn run(&self, number: usize) -> Result<Self::Record, Error> {
        let (config, seed) = self.drawn(number);
        let learned = prepared(&config, seed);
        or_refusal(learned.and_then(|rig| runs(&rig, &config, seed, self.seconds)))
    }

    fn outcome(&self, _: &Context<'_>, records: Vec<Self::Record>) -> Result<Outcome, Error> {
        let with_config = |(number, runs)| Machine { config: self.drawn(number).0, runs };
        let mut machines: Vec<Machine> = records.into_iter().enumerate().map(with_config).collect();
        machines.sort_by(|a, b| {
            let key = |m: &Machine| (m.runs.is_err(), m.lost());
            key(b).cmp(&key(a)).then(b.rms().total_cmp(&a.rms()))
        });

        let mut outcome = Outcome::default();
        for machine in &machines {
            match &machine.runs {
                Ok(runs) => outcome.faults.extend(runs.iter().filter_map(SteadyRun::lost_text)),
                Err(why) => outcome.faults.push(why.clone()),
            }
        }
        let learned = || machines.iter().filter(|machine| machine.runs.is_ok());
        let good = machines.iter().filter(|machine| machine.is_good()).count();
        let rms = sorted(learned().map(Machine::rms));
        let m = &mut outcome.metrics;
        m.set("machines", machines.len() as f64);
        m.set("learned", rms.len() as f64);
        m.set("good", good as f64);
        m.set("good_share", good as f64 / machines.len() as f64);
        m.set("lost_runs", machines.iter().map(Machine::lost).sum::<usize>() as f64);
        if let Some(worst) = rms.last() {
            m.set("worst_rms_median_deg", rms[rms.len() / 2]);
            m.set("worst_rms_deg", *worst);
            m.set("largest_deg", machines.iter().map(Machine::largest).fold(0.0, f64::max));
        }
        let title = if self.draws { "Machines, the worst first" } else { "The motor" };
        let saliency = |m: &Machine| plant_settings(&m.config).saliency;
        let sigma_l_s = |m: &Machine| f64::from(m.config.drive.motor.sigma_l_s());
        let columns = columns![|_, m: &Machine|
            "r_s (ohm)" => Cell::fixed(m.config.motor.r_s, 3);
            "r_r (ohm)" => Cell::fixed(m.config.motor.r_r, 3);
            "σL_s (mH)" => Cell::fixed(1e3 * sigma_l_s(m), 2);
            "L_m (mH)" => Cell::fixed(1e3 * m.config.motor.l_m, 1);
            "a (%)" => Cell::fixed(100.0 * saliency(m).a_psi, 2);
            "b (%/A)" => Cell::fixed(100.0 * saliency(m).b1, 2);
            "carrier (V)" => Cell::fixed(m.config.drive.carrier_v().into(), 1);
            "worst rms (°)" => Cell::fixed(m.rms(), 2);
            "largest (°)" => Cell::fixed(m.largest(), 2);
            "verdict" => Cell::from(m.verdict());
        ];
        let (rms, most) = GOOD_DEG;
        let note = format!("Good: every run within {rms}° rms and {most}° at most, none lost.");
        let listed = machines.iter().take(LISTED).enumerate();
        outcome.tables.push(Table::of(title, &columns, listed).note(note));
        let points = |of: fn(&Machine) -> f64| {
            learned().map(|m| (-100.0 * m.config.saliency.a_psi, of(m))).collect()
        };
        let panel = Panel::new("saliency fixed to the flux (%)", "angle error (°)")
            .with(Series::points("largest", points(Machine::largest)))
            .with(Series::points("rms", points(Machine::rms)));
        outcome.figures.push(texts::figure("machines", "machines").panel(panel));
        Ok(outcome)
    }
}
