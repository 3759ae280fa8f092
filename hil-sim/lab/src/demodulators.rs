//! The five demodulations on one motor.

pub(super) mod demodulation;
mod signal;
pub(super) mod tracked;

use sim_bench::learning;
use sim_bench::steady::{OperatingPoint, SteadyRun, steady_run};

use crate::injection_map::take_saliency;
use crate::prelude::*;
use demodulation::{DEMODULATIONS, Demodulation, ReferenceKind};
use signal::{SETTLED_S, SignalQuality, signal_quality};
use tracked::StepsRun;

/// q-axis currents of the table, A.
const IQ_A: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// q-axis current for the measurement of the delay and for the runs at constant speed, A.
const DELAY_IQ_A: f64 = 1.0;
const RUN_IQ_A: f64 = 1.5;
/// Speeds, rpm.
const SPEEDS_RPM: [f64; 2] = [0.0, 150.0];

/// Results of one demodulation.
struct DemodulationResults {
    demodulation: Demodulation,
    seen: Vec<SignalQuality>,
    isotropic: Vec<SignalQuality>,
    /// Delay, samples; none if the saliency makes no difference.
    delay: Option<f64>,
    /// Results of each kind of reference and controller that it has.
    tracked: Vec<(ReferenceKind, ClosedLoop)>,
}

impl DemodulationResults {
    fn of(demodulation: Demodulation, context: &Context<'_>) -> Result<Self, Error> {
        let (config, seed) = (context.config, context.seed);
        let mut isotropic = config.clone();
        take_saliency(&mut isotropic);
        let at_each = |config: &Config| {
            let config = demodulation.config(config);
            let quality = |&iq: &f64| signal_quality(Rig::oriented(&config, seed, iq, SETTLED_S)?);
            IQ_A.par_iter().map(quality).collect::<Result<Vec<_>, _>>()
        };
        let learned = learning::reference_of(demodulation.0, &demodulation.config(config), seed)?;
        let track = |config: &Config| -> Result<ClosedLoop, Error> {
            let case = |&rpm: &f64| OperatingPoint { rpm, iq: RUN_IQ_A, seed };
            let turning = SPEEDS_RPM.par_iter().map(|rpm| steady_run(config, case(rpm), 1.0));
            let turning = turning.collect::<Result<_, _>>()?;
            Ok(ClosedLoop { steps: tracked::steps(config, seed)?, turning })
        };
        let drive = |&kind| Some((kind, demodulation.drive(kind, config, learned)?));
        let drives = ReferenceKind::VALUES.iter().filter_map(drive);
        let mut found = Self {
            demodulation,
            seen: at_each(config)?,
            isotropic: at_each(&isotropic)?,
            delay: None,
            tracked: drives
                .map(|(kind, config)| Ok((kind, track(&config)?)))
                .collect::<Result<_, Error>>()?,
        };
        if found.isotropic_share() < 0.5 {
            found.delay = Some(signal::delay(demodulation.config(config), DELAY_IQ_A, seed)?);
        }
        Ok(found)
    }

    fn at_one_ampere(&self) -> (&SignalQuality, &SignalQuality) {
        let one = IQ_A.iter().position(|&iq| iq == DELAY_IQ_A).unwrap_or(0);
        (&self.seen[one], &self.isotropic[one])
    }

    /// Share of the signal that is also present without saliency.
    fn isotropic_share(&self) -> f64 {
        let (seen, isotropic) = self.at_one_ampere();
        (isotropic.signal / seen.signal).abs()
    }
}

struct ClosedLoop {
    steps: StepsRun,
    /// Runs of one second at constant speed and torque, by speed.
    turning: Vec<SteadyRun>,
}

/// Runs the experiment: Section 5.2 names two ways to extract the injection current better.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let found = context.in_parallel("demodulators", &DEMODULATIONS, |_, &demodulation| {
        DemodulationResults::of(demodulation, context)
    })?;

    let mut outcome = Outcome::default();
    outcome.tables.push(seen_table(&found));
    outcome.tables.push(tracked_table(&found));
    for f in &found {
        let (m, key) = (&mut outcome.metrics, f.demodulation.key());
        let (seen, _) = f.at_one_ampere();
        m.set(format!("{key}_delay_samples"), f.delay.unwrap_or(f64::NAN));
        m.set(format!("{key}_noise_deg"), degrees(seen.noise / seen.slope));
        m.set(format!("{key}_isotropic_share"), f.isotropic_share());
        for (kind, t) in &f.tracked {
            let name = |what: &str| format!("{key}_{}_{what}", kind.word());
            m.set(name("steps_lost"), f64::from(u8::from(t.steps.lost)));
            m.set(name("steps_rms_deg"), t.steps.stats.rms());
            m.set(name("steps_max_deg"), t.steps.stats.largest());
            for (rpm, run) in SPEEDS_RPM.iter().zip(&t.turning) {
                let rms = if run.lost { f64::NAN } else { run.error.rms() };
                m.set(name(&format!("{rpm}rpm_rms_deg")), rms);
            }
        }
    }
    let envelope = outcome.metrics.get("envelope_retuned_steps_lost") == Some(0.0);
    outcome.compared.push(named("envelope_promising").simulated(envelope));
    Ok(outcome)
}

fn degrees(radians: f64) -> f64 {
    radians.to_degrees().abs()
}

fn seen_table(found: &[DemodulationResults]) -> Table {
    let rows = found.iter().flat_map(|f| {
        IQ_A.iter().zip(&f.seen).zip(&f.isotropic).map(|((iq, s), i)| {
            [
                ("demodulation", Cell::from(f.demodulation.name())),
                ("iq (A)", Cell::fixed(*iq, 1)),
                ("unit", Cell::from(f.demodulation.unit())),
                ("signal", Cell::fixed(s.signal * 1e3, 2)),
                ("slope (per rad)", Cell::fixed(s.slope * 1e3, 1)),
                ("noise, rms", Cell::fixed(s.noise * 1e3, 3)),
                ("noise as angle (°)", Cell::fixed(degrees(s.noise / s.slope), 2)),
                ("signal without saliency", Cell::fixed(i.signal * 1e3, 2)),
                ("as angle (°)", Cell::fixed(degrees(i.signal / s.slope), 1)),
                ("slope without saliency", Cell::fixed(i.slope * 1e3, 1)),
            ]
        })
    });
    texts::table("demodulators", "seen").records(rows)
}

fn tracked_table(found: &[DemodulationResults]) -> Table {
    let mut table = texts::table_with("demodulators", "tracked", &[("iq_a", RUN_IQ_A)]);
    let shown = |lost: bool, x: f64| if lost { "lost".into() } else { Cell::fixed(x, 2) };
    for f in found {
        for (kind, ClosedLoop { steps, turning }) in &f.tracked {
            let mut row = vec![
                ("demodulation".to_owned(), Cell::from(f.demodulation.name())),
                ("reference".to_owned(), kind.word().into()),
                ("delay (samples)".to_owned(), Cell::fixed_or_dash(f.delay, 1)),
                ("torque steps, rms (°)".to_owned(), shown(steps.lost, steps.stats.rms())),
                ("largest (°)".to_owned(), shown(steps.lost, steps.stats.largest())),
            ];
            for (rpm, run) in SPEEDS_RPM.iter().zip(turning) {
                row.push((format!("{rpm} rpm, mean (°)"), shown(run.lost, run.error.mean())));
                row.push((format!("{rpm} rpm, rms (°)"), shown(run.lost, run.error.rms())));
            }
            table.record(row);
        }
    }
    table
}
