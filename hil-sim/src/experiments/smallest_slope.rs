//! The smallest saliency sensitivity at which a drive that has learned still works: the source of the motor's saliency
//! is weakened step by step, and the stress test runs at each step.

use super::battery::{Battery, Summary, Trial};
use super::saliency::Probe;
use crate::prelude::*;

/// Number of steps of the saliency's share, starting with the strongest.
const STEPS: u32 = 20;
const LEAST_SHARE: f64 = 0.05;
/// Runs at each step, unless `runs` sets another number: two of each kind.
const RUNS: u32 = 24;

/// Results for a motor whose saliency has a share of its full strength.
struct Step<'a> {
    share: f64,
    /// Saliency sensitivity dq/de without load at the drive's magnetising current, 1/rad.
    slope: Option<f64>,
    summary: Summary<'a>,
}

impl Step<'_> {
    /// Whether each run was accepted, and none was lost, had an undetected error or stopped.
    fn works(&self) -> bool {
        let fails = |trial: &Trial| {
            let ended = trial.refused_by().is_some() || trial.trip.is_some();
            ended || trial.is_lost() || trial.is_silent()
        };
        self.summary.count(fails) == 0
    }
}

/// The runs of all steps, one step after the other.
pub struct SmallestSlope {
    /// Share, configuration and stress test of each step.
    steps: Vec<(f64, Config, Battery)>,
    /// Number of runs of each step.
    each: usize,
}

impl Study for SmallestSlope {
    type Record = Trial;
    const NAME: &'static str = "smallest-slope";

    fn new(context: &Context<'_>) -> Result<Self, Error> {
        let each = context.config.extent.runs.unwrap_or(RUNS);
        let step = |n| {
            let share = 1.0 - (1.0 - LEAST_SHARE) * f64::from(n) / f64::from(STEPS - 1);
            let mut config = weakened(context.config, share);
            config.prepare.learn = true;
            config.extent.runs = Some(each);
            let context = Context { config: &config, progress: Progress::hidden(), ..*context };
            let battery = Battery::new(&context)?;
            Ok((share, config, battery))
        };
        let steps = (0..STEPS).map(step).collect::<Result<_, Error>>()?;
        Ok(Self { steps, each: each as usize })
    }

    fn runs(&self) -> usize {
        self.steps.len() * self.each
    }

    fn run(&self, number: usize) -> Result<Trial, Error> {
        self.steps[number / self.each].2.run(number % self.each)
    }

    fn outcome(&self, _: &Context<'_>, trials: Vec<Trial>) -> Result<Outcome, Error> {
        let mut steps = Vec::new();
        for ((share, config, _), trials) in self.steps.iter().zip(trials.chunks(self.each)) {
            let slope = Probe::new(config)?.slope(config.drive.i_d().into(), 0.0);
            steps.push(Step { share: *share, slope, summary: Summary::of(trials) });
        }
        let row = |step: &Step<'_>| {
            let works = if step.works() { "yes" } else { "no" };
            let limit = step.summary.limit_share().map(|share| 100.0 * share);
            let head = [
                ("share", Cell::fixed(step.share, 2)),
                ("slope (1/rad)", Cell::fixed_or_dash(step.slope, 4)),
                ("works", Cell::from(works)),
                ("limit (%)", Cell::fixed_or_dash(limit, 0)),
            ];
            head.into_iter().chain(step.summary.cells())
        };
        let mut outcome = Outcome::default();
        let table = texts::table("smallest-slope", "steps").records(steps.iter().map(row));
        outcome.tables.push(table);
        let m = &mut outcome.metrics;
        if let Some(last) = steps.iter().take_while(|step| step.works()).last() {
            m.set("smallest_share", last.share);
            if let Some(slope) = last.slope {
                m.set("smallest_slope_per_rad", slope);
            }
        }
        m.set("silent_runs", Summary::of(&trials).count(Trial::is_silent) as f64);
        let points = |name: &str, of: fn(&Summary<'_>) -> f64| {
            let regulated = steps.iter().filter(|step| step.summary.error().count() > 0);
            let points = regulated.filter_map(|step| Some((step.slope?, of(&step.summary))));
            Series::points(name, points.collect())
        };
        let panel = Panel::new("slope dq/de (1/rad)", "angle error (°)")
            .with(points("largest", |s| s.error().largest()))
            .with(points("99 %", |s| s.p99_deg()))
            .with(points("rms", |s| s.error().rms()));
        outcome.figures.push(texts::figure("smallest-slope", "slope").panel(panel));
        Ok(outcome)
    }
}

/// Returns the same motor with a share of the source of its saliency.
fn weakened(config: &Config, share: f64) -> Config {
    let (mut weaker, plant) = (config.clone(), plant_settings(config));
    match plant.iron {
        Some(iron) => {
            weaker.iron.teeth = Some(share * iron.teeth);
            weaker.iron.saturation = Some(1.0 + share * (iron.saturation - 1.0));
        }
        None => weaker.saliency.a_psi = share * plant.saliency.a_psi,
    }
    weaker
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sensitivity of model A at standstill is twice its saliency; with linear teeth and with saturation it
    /// decreases with its source.
    #[test]
    fn a_weaker_source_is_a_smaller_slope() {
        let slope = |plant: &str, share: f64| {
            let mut config = Config::default();
            config.set("plant", plant).unwrap();
            let probe = Probe::new(&weakened(&config, share)).unwrap();
            probe.slope(probe.i_d, 0.0).unwrap()
        };
        for share in [1.0, 0.3] {
            let expected = -2.0 * 0.035 * share;
            assert!((slope("a", share) / expected - 1.0).abs() < 0.05, "{}", slope("a", share));
        }
        for plant in ["r", "g7", "m6"] {
            assert!(slope(plant, 0.5).abs() < 0.8 * slope(plant, 1.0).abs(), "{plant}");
        }
    }
}
