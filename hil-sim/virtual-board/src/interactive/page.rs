//! The results of a session: a page with plots, and the same data as one JSON object.

use hil_sim::outcome::{Figure, Panel, Series};
use hil_sim::{Config, Outcome};

use super::record::{CURVES, Record};
use super::session::Session;
use super::transcript::{Source, events, faults};

/// Name of the page's files.
pub const NAME: &str = "board";
/// Introduction of the page.
pub const ABOUT: &str = "The firmware's image on an emulated STM32G474, with the simulated motor at its \
                         pins and a pseudo-terminal at its serial port.";

/// Makes the results of a session.
pub fn outcome(config: &Config, session: &Session) -> Outcome {
    let Session { board, record, lines, .. } = session;
    let mut outcome = Outcome::default();
    let m = &mut outcome.metrics;
    m.set("simulated_s", board.time());
    m.set("control_interrupts", record.interrupts as f64);
    m.set("resets", board.resets.len() as f64);
    let judged = record.error.count() > 0;
    m.set("angle_error_rms_deg", if judged { record.error.rms() } else { 0.0 });
    m.set("angle_error_max_deg", record.error.largest());
    m.set("phase_current_peak_a", record.peak_current);
    m.set("worst_interrupt_cycles", f64::from(record.worst_cycles));
    outcome.faults = faults(lines);
    outcome.figures.push(figure(record).events(events(lines)));
    let texts =
        [("Console: time (s), > typed, < said, # the board", false), ("Log: time (s)", true)];
    for (title, is_log) in texts {
        let lines = lines.iter().filter(|line| (line.source == Source::Log) == is_log);
        outcome.texts.push((title.into(), lines.map(|line| format!("{line}\n")).collect()));
    }
    outcome.remarks.push(
        "Torque, flux, speed and dc link are the simulated motor's and inverter's. References, measured \
         and estimated quantities are the drive's, read from its RAM while the outputs are on. \
         The angle error is shown and judged while the outputs are on and the rotor flux is above \
         0.05 Wb."
            .into(),
    );
    outcome.remarks.extend(hil_sim::experiments::assumptions(config));
    outcome
}

fn figure(record: &Record) -> Figure {
    let panel = |axis: &str, series| Panel::new("time (s)", axis).with(series);
    let error = Series::line("true minus estimated flux angle", record.error_deg());
    let mut panels = vec![panel("angle error (° electrical)", error)];
    for (place, (axis, name, drawn, ..)) in CURVES.into_iter().enumerate() {
        let series = drawn(name, record.curve(place));
        match panels.last_mut() {
            Some(same) if same.y_label == axis => same.series.push(series),
            _ => panels.push(panel(axis, series)),
        }
    }
    let outputs = panel("outputs on", Series::line("", record.outputs())).y_range(-0.1, 1.1);
    panels.push(Panel { switch: true, ..outputs });
    let figure = Figure::new("session", "A session with the drive", "");
    panels.into_iter().fold(figure, Figure::panel)
}
