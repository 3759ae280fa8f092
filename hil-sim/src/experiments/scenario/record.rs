//! The record of a run, and its evaluation.

use drive_core::carrier::CARRIER_SAMPLES;

use super::file::{Metric, Over, PanelText, Statistic};
use super::quantity::{Named, QUANTITIES, Quantity, Seen};
use super::{Part, Reference, Scenario, Shaft};
use crate::outcome::Step;
use crate::prelude::*;

/// Time between two references, s: they change at the rate of a host, not of the control.
const PACE_S: f64 = CARRIER_SAMPLES as f64 / RATE_HZ;
/// A part begins with the first reference that is not earlier than the part by more than this, s, because sums of times are rounded.
const DUST_S: f64 = 1e-9;
/// Time after the first reference in which the angle settles from the position of the magnetising, and the last time of
/// a part in which the drive has settled; s.
const SETTLING_S: f64 = 0.5;

/// The samples of a run. Times count from the first reference, positions from the position of the shaft at that time.
pub struct Record {
    /// The samples, and the reference in force at each of them.
    pub points: Vec<Point>,
    references: Vec<f64>,
    /// The configuration of the run, and its parts.
    pub config: Config,
    parts: Vec<Part>,
    reference: &'static Reference,
    /// Beginnings of the parts, s.
    begun: Vec<f64>,
    /// The first reference that the drive has limited: its time, s, its value, and the limited value.
    pub limited: Option<(f64, f64, f32)>,
    /// The fault with which the drive has stopped itself.
    pub fault: Option<String>,
}

impl Scenario {
    /// Runs the scenario until its end, or until the drive stops itself.
    ///
    /// # Errors
    /// If the configuration is refused, or the drive refuses a command or does not start.
    pub fn record(&self, context: &Context<'_>) -> Result<Record, Error> {
        let reference = self.reference();
        let (parts, seconds) = self.stretched(context.seconds);
        let config = self.configured(context.config)?;
        let mut rig = Rig::started(&config, context.seed, reference.mode)?;
        let (start, origin) = (rig.time(), rig.plant.mechanical_angle() / TAU);
        let blocks = ((seconds * RATE_HZ).round() as usize).div_ceil(CARRIER_SAMPLES);
        let progress = context.progress.bar("simulating", blocks as u64);
        let mut record = Record {
            points: Vec::with_capacity(blocks * CARRIER_SAMPLES),
            references: Vec::with_capacity(blocks * CARRIER_SAMPLES),
            config,
            parts,
            reference,
            begun: Vec::new(),
            limited: None,
            fault: None,
        };
        for block in 0..blocks {
            let t = block as f64 * PACE_S;
            while let Some(part) =
                record.parts.get(record.begun.len()).filter(|p| p.begin <= t + DUST_S)
            {
                record.begun.push(rig.time() - start);
                if let Some(stop) = part.stop {
                    rig.command(&Command::Stop(stop))?;
                }
                if part.start {
                    rig.command(&Command::Start(reference.mode))?;
                }
            }
            let part = record.parts[record.begun.len() - 1];
            let value = part.at(part.reference, t);
            let regulates = rig.drive.state().regulates();
            let wanted = (reference.command)(value as f32);
            if regulates && let Accepted::Limited(to) = rig.command(&wanted)? {
                record.limited.get_or_insert((t, value, to));
            }
            if let Some(load) = self.load(&part, t) {
                rig.set_load(load)?;
            }
            rig.run(PACE_S, |p| {
                let (t, turns) = (p.t - start, p.turns - origin);
                // A drive that does not regulate has no angle.
                let angle_error_deg = if regulates { p.angle_error_deg } else { f64::NAN };
                record.points.push(Point { t, turns, angle_error_deg, ..*p });
                record.references.push(value);
            });
            progress.inc(1);
            record.fault = rig.fault();
            if record.fault.is_some() {
                break;
            }
        }
        Ok(record)
    }
}

impl Record {
    /// Time of the last sample, s.
    fn end(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.t)
    }

    fn value(&self, quantity: &Quantity, k: usize) -> f64 {
        let (point, reference) = (&self.points[k], self.references[k]);
        (quantity.of)(&Seen { point, reference, actual: (self.reference.actual)(point) })
    }

    /// Returns the values of a quantity in the samples that count, with their times.
    fn values(&self, of: Named, over: Over) -> impl Iterator<Item = (f64, f64)> {
        let after = SETTLING_S.min(0.1 * self.end());
        let settled = |t: f64| {
            let part = self.begun.partition_point(|&begin| begin <= t).saturating_sub(1);
            let seconds = self.parts[part].seconds;
            t >= self.begun[part] + seconds - SETTLING_S.min(0.5 * seconds)
        };
        let counts = move |t: f64| match over {
            Over::All => true,
            Over::AfterStart => t >= after,
            Over::Settled => settled(t),
        };
        let all = (0..self.points.len()).filter(move |&k| counts(self.points[k].t));
        let values = all.map(move |k| (self.points[k].t, self.value(of.0, k)));
        values.filter(|(_, value)| value.is_finite())
    }

    /// Computes a number from the values of a quantity.
    pub fn statistic(&self, metric: &Metric) -> f64 {
        let values = || self.values(metric.of, metric.over).map(|(_, value)| value);
        let stats = || Stats::of(values());
        match metric.statistic {
            Statistic::Rms => stats().rms(),
            Statistic::Mean => stats().mean(),
            Statistic::Largest => stats().largest(),
            Statistic::Highest => values().fold(f64::NAN, f64::max),
            Statistic::Last => values().last().unwrap_or(f64::NAN),
            Statistic::Overshoot => {
                let reference = self.references.last().copied().unwrap_or(f64::NAN);
                (values().fold(f64::NAN, f64::max) / reference - 1.0).max(0.0) * 100.0
            }
            Statistic::AtInjection => {
                let turn = |k: usize| Complex64::cis(TAU * k as f64 / CARRIER_SAMPLES as f64);
                let values: Vec<f64> = values().collect();
                let amplitude = |values: &[f64]| {
                    let sum: Complex64 = (0..).zip(values).map(|(k, x)| turn(k) * *x).sum();
                    2.0 * sum.norm() / values.len() as f64
                };
                values.chunks((SETTLING_S * RATE_HZ) as usize).map(amplitude).fold(0.0, f64::max)
            }
            Statistic::Settling => {
                let beyond = |(_, value): &(f64, f64)| value.abs() > metric.within;
                self.values(metric.of, metric.over).filter(beyond).last().map_or(0.0, |(t, _)| t)
            }
        }
    }

    /// Adds the metrics of a scenario, and `lost` if it is judged.
    pub fn metrics(&self, scenario: &Scenario, into: &mut Metrics) {
        for metric in scenario.text.metrics.iter().flatten() {
            into.set(metric.name.as_str(), self.statistic(metric));
        }
        let judge = scenario.text.judge.as_deref().unwrap_or_default();
        let beyond = |bound: &Metric| {
            self.values(bound.of, bound.over).any(|(_, value)| value.abs() > bound.within)
        };
        if !judge.is_empty() {
            let lost = self.fault.is_some() || judge.iter().any(beyond);
            into.set("lost", f64::from(u8::from(lost)));
        }
    }

    /// Computes means over the second half of each part with a constant reference.
    pub fn levels(&self) -> Vec<Step> {
        let of = |part: &Part| {
            let (from, to) = (part.begin + 0.5 * part.seconds, part.begin + part.seconds);
            let mean = |of: fn(&Point) -> f64| {
                let points = self.points.iter().filter(|p| p.t >= from && p.t < to);
                Stats::of(points.map(of)).mean()
            };
            Step {
                iq_ref_a: part.reference.0,
                iq_a: mean(|p| p.iq),
                torque_nm: mean(|p| p.torque),
                angle_error_mean_deg: mean(|p| p.angle_error_deg),
            }
        };
        self.parts.iter().filter(|part| part.reference.0 == part.reference.1).map(of).collect()
    }

    /// Returns a quantity over time as means over this many samples, at the time of the first of them.
    fn line(&self, of: &Quantity, samples: usize) -> Vec<(f64, f64)> {
        let mean = |from: usize| {
            let part = from..self.points.len().min(from + samples);
            let sum = part.clone().map(|k| self.value(of, k)).sum::<f64>();
            (self.points[from].t, sum / part.len() as f64)
        };
        (0..self.points.len()).step_by(samples).map(mean).collect()
    }

    /// Returns means over injection periods of the quantity with this name.
    pub fn means(&self, name: &str) -> Vec<(f64, f64)> {
        self.line(named(name).0, CARRIER_SAMPLES)
    }

    /// Draws the figure of a scenario: its panels, and one for each of its columns.
    pub fn figure(&self, scenario: &Scenario, config: &Config) -> Figure {
        let text = &scenario.text;
        let title = scenario.filled(&text.title, config);
        let mut figure = Figure::new(text.figure.as_str(), title, text.source.as_str());
        let samples = if text.samples == 0 { CARRIER_SAMPLES } else { text.samples };
        let synchronous = self.config.drive.injection.demodulator == DemodulatorKind::Synchronous;
        let axes = |label: &str| Panel::new("time (s)", label);
        let is_shown = |panel: &&PanelText| panel.synchronous.is_none_or(|is| is == synchronous);
        for panel in text.panel.iter().filter(is_shown) {
            let label = panel.lines.first().map_or("", |line| line.of.0.label);
            let axes = axes(panel.label.as_deref().unwrap_or(label));
            figure = figure.panel(panel.lines.iter().fold(axes, |axes, line| {
                let points = match line.of.0.name {
                    "reference" | "reference_deg" => self.wanted(scenario, line.of.0, samples),
                    _ => self.line(line.of.0, samples),
                };
                let draw = if line.dashed { Series::reference } else { Series::line };
                axes.with(draw(line.name.clone(), points))
            }));
        }
        for Named(of) in &text.columns {
            figure = figure.panel(axes(of.label).with(Series::line("", self.line(of, samples))));
        }
        figure.events(self.events(scenario))
    }

    /// Returns the parts that have begun, with their beginnings, s.
    fn begun(&self) -> impl Iterator<Item = (&Part, f64)> {
        self.parts.iter().zip(self.begun.iter().copied())
    }

    /// Returns the reference over time: its corners, or the values of a profile in rows. Beside single samples it ends
    /// with the last of them.
    fn wanted(&self, scenario: &Scenario, of: &Quantity, samples: usize) -> Vec<(f64, f64)> {
        let wanted: Vec<(f64, f64)> = if scenario.from_rows {
            let values = self.references.iter().step_by(CARRIER_SAMPLES);
            (0..).map(|block| f64::from(block) * PACE_S).zip(values.copied()).collect()
        } else {
            let corners = |(part, begin): (&Part, f64)| {
                [(begin, part.reference.0), (begin + part.seconds, part.reference.1)]
            };
            self.begun().flat_map(corners).collect()
        };
        let end = if samples == 1 { self.end() } else { f64::INFINITY };
        let value =
            |reference| (of.of)(&Seen { point: &Point::default(), reference, actual: f64::NAN });
        wanted.into_iter().map(|(t, reference)| (t.min(end), value(reference))).collect()
    }

    /// Returns changes of the load, steps of the q-axis current, and finally a fault.
    fn events(&self, scenario: &Scenario) -> Vec<(f64, String)> {
        let (mut events, mut acting) = (Vec::new(), 0.0);
        if scenario.shaft == Shaft::Free && !scenario.from_rows {
            for (part, begin) in self.begun() {
                match part.load.0 {
                    torque if torque == acting => {}
                    0.0 => events.push((begin, "load off".to_owned())),
                    torque => events.push((begin, format!("load {torque:.2} Nm"))),
                }
                acting = part.load.1;
            }
        }
        if self.reference.mode == Mode::Torque && !scenario.from_rows {
            let steps =
                self.parts.windows(2).filter(|two| two[0].reference.1 != two[1].reference.0);
            let text = |part: &Part| (part.begin, format!("{:.2} A", part.reference.0));
            events.extend(steps.map(|two| text(&two[1])).filter(|(t, _)| *t < self.end()));
            events.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        events.extend(self.fault.iter().map(|fault| (self.end(), fault.clone())));
        events
    }
}

/// Returns a quantity by its name in the program.
fn named(name: &str) -> Named {
    Named(QUANTITIES.iter().find(|known| known.name == name).unwrap_or(&QUANTITIES[0]))
}

impl Metric {
    /// Makes a metric of all samples.
    pub fn of(name: impl Into<String>, of: &str, statistic: Statistic) -> Self {
        Self { name: name.into(), of: named(of), statistic, over: Over::All, within: 0.0 }
    }
}
