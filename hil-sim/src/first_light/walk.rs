//! Walks through the table: one step after the other, each judged, until one leaves doubt.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Options;
use super::evidence::{Evidence, Record, SCHEMA, Verdict};
use super::person::Person;
use super::table::{Act, Board, Limits, Read, Ready, Table};
use super::wire::Wire;
use crate::console::link::is_off;
use crate::prelude::*;

/// `command.timeout_s` while a step may switch the power stage on: a drive that receives nothing for this time stops by itself.
pub const TIMEOUT_S: u32 = 2;
/// Beginnings of unsolicited lines that end a step, unless the step waits for them.
const DOUBTS: [&str; 5] =
    ["* fault ", "* induction-drive", "* error", "* stopped: no command", "* refused"];
/// Longest wait for an expected line, unless the step sets another, s.
const PATIENCE_S: f64 = 15.0;
/// Longest time in which a controller answers after a restart, s.
const STARTS_S: u32 = 20;
/// Longest time until a drive is off after `stop`, s.
const STOPS_S: u32 = 10;
/// Time between two checks of the received lines, s.
const LOOK_S: f64 = 0.2;

/// A walk through the table with a drive and a person.
pub struct Walk<'a, W, P> {
    table: &'a Table,
    board: &'a Board,
    wire: W,
    person: P,
    options: Options,
    interrupted: Arc<AtomicBool>,
    /// The test record; its last attempt is the one at the present step.
    evidence: Evidence,
    state: StepState,
}

/// State of the present step.
#[derive(Default)]
struct StepState {
    /// Lines received since the last line was sent.
    said: Vec<String>,
    /// Unsolicited lines that end the step, unless it waits for them.
    doubts: Vec<String>,
    /// Last readings, by the text next to them.
    readings: BTreeMap<String, f64>,
    patience_s: f64,
}

/// Reason why a step was not passed.
struct Failure(Verdict, String);
type Checked<T = ()> = Result<T, Failure>;

fn doubt<T>(why: impl Into<String>) -> Checked<T> {
    Err(Failure(Verdict::Stopped, why.into()))
}

/// Returns the answer of a person who is present.
fn there<T>(answer: Option<T>) -> Checked<T> {
    answer.ok_or_else(|| Failure(Verdict::Interrupted, "interrupted by the person".to_owned()))
}

impl<'a, W: Wire, P: Person> Walk<'a, W, P> {
    /// Begins, or continues the test record of a file; `interrupted` ends it.
    ///
    /// # Errors
    /// [`Error::Refused`] if the drive does not answer, or if board or build differ from those of options and test record.
    pub fn new(
        table: &'a Table,
        (mut wire, person): (W, P),
        options: Options,
        interrupted: Arc<AtomicBool>,
    ) -> Result<Self, Error> {
        let (board, build) = identity(&mut wire).map_err(Error::Refused)?;
        let (found, bench) = (format!("board {board}, build {build}"), options.bench.clone());
        let new = Evidence { schema: SCHEMA, bench, board, build, steps: Vec::new() };
        let evidence = Evidence::open(&options.evidence)?.unwrap_or(new);
        evidence.is_of(&found).map_err(Error::Refused)?;
        let board = table.board(&evidence.board)?;
        if let Some(wanted) = options.board.as_ref().filter(|wanted| **wanted != board.name) {
            let image = &board.name;
            return Err(Error::Refused(format!("--board {wanted}: the image is for {image}")));
        }
        let state = StepState::default();
        Ok(Self { table, board, wire, person, options, interrupted, evidence, state })
    }

    /// Returns the test record so far.
    pub fn evidence(&self) -> &Evidence {
        &self.evidence
    }

    /// Walks to the end.
    ///
    /// # Errors
    /// As [`Walk::step`].
    pub fn run(&mut self) -> Result<(), Error> {
        while self.step()? {}
        Ok(())
    }

    /// Walks through the next step; returns false if there is none.
    ///
    /// # Errors
    /// [`Error::Lost`] for a step that was not passed; the errors of the table and of the file.
    pub fn step(&mut self) -> Result<bool, Error> {
        let Some(ready) = self.table.next(&self.evidence)? else { return Ok(false) };
        let (number, step, _) = ready.place();
        let skip = self.options.skip_learning && step.optional;
        let begun = if skip { Verdict::Skipped } else { Verdict::Interrupted };
        // Written before anything is done, so that a step that breaks off leaves a trace in the file.
        self.evidence.steps.push(Record::new(&step.name, begun));
        self.evidence.write(&self.options.evidence)?;
        if skip {
            return Ok(true);
        }
        let mut end = self.walk(&ready);
        if step.switches_on() || end.is_err() {
            let off = self.switch_off();
            if let Err(Failure(_, why)) = &off {
                self.find(&format!("{why}; without lines the drive stops after {TIMEOUT_S} s"));
            }
            end = end.and(off);
        }
        let Failure(verdict, why) = end.err().unwrap_or(Failure(Verdict::Passed, String::new()));
        let reason = format!("{why}\n{}", self.board.fill(&step.otherwise));
        (self.evidence.record().verdict, self.evidence.record().why) = (verdict, why);
        self.evidence.write(&self.options.evidence)?;
        match verdict {
            Verdict::Passed => Ok(true),
            _ => Err(Error::Lost { name: format!("step {number}, {}", step.name), reason }),
        }
    }

    fn walk(&mut self, ready: &Ready) -> Checked {
        let (number, step, first) = ready.place();
        if let Some(part) = first {
            self.person.tell(&format!("\n{}\n{}", part.title, self.board.fill(&part.before)));
        }
        self.person.tell(&format!("\nStep {number}: {}", step.name));
        let patience_s = step.patience_s.unwrap_or(PATIENCE_S);
        self.state = StepState { patience_s, ..StepState::default() };
        self.wire.unasked();
        if step.switches_on() {
            self.send(&format!("set command.timeout_s {TIMEOUT_S}"))?;
            self.send("save")?;
        }
        step.acts.iter().try_for_each(|act| self.act(act))?;
        self.state.doubts.first().map_or(Ok(()), |line| doubt(line.clone()))
    }

    /// Sends `stop`, and removes the limit on the time without lines.
    fn switch_off(&mut self) -> Checked {
        // The drive refuses `stop` in a fault, in which the outputs are already off.
        let _ = self.send("stop");
        for _ in 0..STOPS_S {
            self.send("status")?;
            if self.state.said.iter().any(|line| is_off(line)) {
                self.state.doubts.clear();
                return self.send("set command.timeout_s 0").and_then(|()| self.send("save"));
            }
            self.wire.wait(1.0);
        }
        doubt(format!("not off {STOPS_S} s after `stop`"))
    }

    fn act(&mut self, act: &Act) -> Checked {
        let board = self.board;
        match act {
            Act::Hand(what) => there(self.person.hand(&board.fill(what)))?,
            Act::Restart(what) => {
                there(self.person.hand(&board.fill(what)))?;
                self.starts_again()?;
            }
            Act::Send(line) => {
                self.send(&board.fill(line))?;
                if line == "reboot" {
                    self.starts_again()?;
                }
            }
            Act::Often { line, times } => (0..*times).try_for_each(|_| self.send(line))?,
            Act::Setting(key) => {
                let value = there(self.person.measure(key, "by the nameplate"))?;
                self.send(&format!("set {key} {value}"))?;
            }
            Act::Wait(seconds) => self.wire.wait(*seconds),
            Act::Hear(text) => self.hear(text)?,
            Act::Never(text) => {
                if let Some(line) = self.state.said.iter().find(|line| line.contains(text)) {
                    return doubt(format!("`{text}` in `{line}`"));
                }
            }
            Act::See(what) => {
                let what = board.fill(what);
                let so = there(self.person.see(&what))?;
                self.find(&format!("{what}: {}", if so { "yes" } else { "no" }));
                if !so {
                    return doubt(format!("not so: {what}"));
                }
            }
            Act::Measure { what, unit, is } => {
                let value = there(self.person.measure(what, unit))?;
                self.judge(what, value, unit, is, 0.0)?;
            }
            Act::Read(read) => self.read(read)?,
            Act::Noise(signal) => self.noise(signal)?,
        }
        self.look()
    }

    fn find(&mut self, what: &str) {
        self.person.tell(&format!("  {what}"));
        self.evidence.record().found.push(what.to_owned());
    }

    fn note(&mut self, line: &str) {
        self.evidence.record().console += &format!("{line}\n");
    }

    fn send(&mut self, line: &str) -> Checked {
        self.drain();
        self.note(&format!("> {line}"));
        let answer = self.wire.ask(line).or_else(|why| doubt(why.to_string()))?;
        answer.lines.iter().for_each(|line| self.note(line));
        if answer.lines.len() == 1 {
            self.person.tell(&format!("  {line}: {}", answer.lines[0]));
        }
        self.state.said.clone_from(&answer.lines);
        answer.error().map_or(Ok(()), |error| doubt(format!("`{line}`: {error}")))
    }

    /// Stores the unsolicited lines.
    fn drain(&mut self) {
        for line in self.wire.unasked() {
            self.person.tell(&format!("  {line}"));
            self.note(&line);
            if DOUBTS.iter().any(|doubt| line.starts_with(doubt)) || line.contains(": refused") {
                self.state.doubts.push(line.clone());
            }
            self.state.said.push(line);
        }
    }

    /// Fails for an unexpected unsolicited line, and if the person interrupts.
    fn look(&mut self) -> Checked {
        self.drain();
        if self.interrupted.load(Ordering::Relaxed) {
            return there(None);
        }
        // A later action may wait for a fault.
        match self.state.doubts.first() {
            Some(line) if !line.starts_with("* fault ") => doubt(line.clone()),
            _ => Ok(()),
        }
    }

    fn hear(&mut self, text: &str) -> Checked {
        let mut left = self.state.patience_s;
        loop {
            self.look()?;
            if self.state.said.iter().any(|line| line.contains(text)) {
                self.state.doubts.retain(|line| !line.contains(text));
                return Ok(());
            }
            if let Some(line) = self.state.doubts.first() {
                return doubt(line.clone());
            }
            // An answer without an `ok` is already complete.
            let waits = self.state.said.iter().any(|line| line.starts_with("ok"));
            if !waits || left <= 0.0 {
                return doubt(format!("not `{text}`, but `{}`", self.state.said.join("; ")));
            }
            left -= LOOK_S;
            self.wire.wait(LOOK_S);
        }
    }

    fn starts_again(&mut self) -> Checked {
        self.wire.reopen().or_else(|why| doubt(why.to_string()))?;
        for _ in 0..STARTS_S {
            self.wire.wait(1.0);
            if let Ok((board, build)) = identity(&mut self.wire) {
                self.drain();
                self.state.doubts.clear();
                let found = format!("board {board}, build {build}");
                return self.evidence.is_of(&found).or_else(doubt);
            }
        }
        doubt(format!("the controller does not answer within {STARTS_S} s"))
    }

    /// Reads a number in the last answer.
    fn read(&mut self, read: &Read) -> Checked {
        let place = read.place();
        let Some(value) = self.state.said.iter().find_map(|line| read.of(line)) else {
            return doubt(format!("no number at `{place}`"));
        };
        let before = self.state.readings.insert(place.to_owned(), value);
        let from = if read.rise { before.unwrap_or(f64::NAN) } else { 0.0 };
        self.judge(place, value, &read.unit, &read.is, from)
    }

    /// Checks that a number is between its limits, which are relative to `from`.
    fn judge(&mut self, what: &str, value: f64, unit: &str, is: &Limits, from: f64) -> Checked {
        let [least, most] = is.each_ref().map(|end| from + self.board.number(end));
        let what = what.trim_matches([' ', ',']);
        let found = format!("{what}: {value:.4} {unit}; allowed: {least:.4} to {most:.4} {unit}");
        self.find(&found);
        if (least..=most).contains(&value) { Ok(()) } else { doubt(found) }
    }

    /// Judges mean and noise of a signal in the printed trace.
    fn noise(&mut self, signal: &str) -> Checked {
        let mut rows = self.state.said.iter().map(|line| line.split(',').collect::<Vec<_>>());
        let column = rows.by_ref().find_map(|row| row.iter().position(|name| *name == signal));
        let values: Vec<f64> = rows.filter_map(|row| row.get(column?)?.parse().ok()).collect();
        let mean = Stats::of(values.iter().copied()).mean();
        let rms = Stats::of(values.iter().map(|value| value - mean)).rms();
        let limits = |ends: [&str; 2]| ends.map(str::to_owned);
        let (about, noise) = (limits(["0-MEAN", "MEAN"]), limits(["0", "NOISE"]));
        self.judge(&format!("mean of {signal}"), mean, "A", &about, 0.0)?;
        self.judge(&format!("noise of {signal}"), rms, "A rms", &noise, 0.0)
    }
}

/// Returns board and build of a drive.
fn identity(wire: &mut impl Wire) -> Result<(String, String), String> {
    let mut ask = |line: &str| wire.ask(line).map_err(|why| why.to_string());
    let said = [ask("board")?, ask("version")?].map(|answer| answer.lines.join("\n"));
    let between = |text: &str, from: &str, to: char| {
        let rest = text.split_once(from)?.1;
        Some(rest.split_once(to)?.0.to_owned())
    };
    let found = between(&said[0], "board ", ':').zip(between(&said[1], ", build ", ';'));
    found.ok_or_else(|| format!("no board and build in `{}`", said.join(" ")))
}
