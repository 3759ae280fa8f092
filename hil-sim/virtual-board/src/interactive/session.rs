//! A session: the board runs in small slices of time; between them bytes are exchanged.

use std::f64::consts::TAU;
use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use drive_stream::{Piece, Splitter};
use hil_sim::{board::LogLevel, rig::RATE_HZ};
use induction_drive::console::line::UNASKED;

use super::script::{ANSWER_S, Script, Step, failure};
use super::transcript::{Assembler, Line, Source};
use super::{flash_file::FlashFile, own::Own, pty::Pty, record::Record};
use crate::board::{Board, Period, TICKS_PER_PERIOD as PERIOD};
use crate::shadow::Shadow;
use stm32g4_unicorn::chip::TICKS_PER_S;
use stm32g4_unicorn::periph::Reset;

/// Number of control periods between two exchanges with the inputs: 5 ms, which a person does not notice.
const SLICE: u32 = 30;
/// Time before a control interrupt at which the board is examined, ticks: the previous interrupt has ended, and the
/// motor is in the state in which it was sampled for that interrupt.
const BEFORE: u64 = PERIOD / 8;
/// Delay beyond which lost time is not made up for, because the board would run too fast.
const LATE: Duration = Duration::from_millis(100);

/// Time without a line after which a session without a person shows its time.
const SIGN_OF_LIFE: Duration = Duration::from_secs(10);

/// Time without a line after which an answer, or what belongs to an awaited text, is complete, s: longer than any line takes on the wire.
const SILENCE_S: f64 = 0.06;
/// The reason why a session has ended, in words.
type End = &'static str;
const TIME_IS_OVER: End = "the time is over";

/// Inputs of a session besides the pseudo-terminal.
pub struct Inputs {
    /// Lines typed at the terminal.
    pub terminal: Receiver<String>,
    /// Whether Ctrl-C was pressed.
    pub stop: Arc<AtomicBool>,
    /// The script, if there is one.
    pub script: Option<Script>,
    /// Simulated time at which the session ends, s.
    pub seconds: Option<f64>,
    /// Whether simulated time follows the clock.
    pub paced: bool,
    /// The file that stores the flash, if there is one.
    pub flash: Option<FlashFile>,
    /// Least urgent lines of the log that are stored and shown.
    pub log: LogLevel,
    /// Whether the flux is shown.
    pub flux: bool,
    /// Gets every line when it comes.
    pub show: fn(&Line),
}

/// A board with its inputs and outputs.
pub struct Session {
    /// The board.
    pub board: Board,
    /// The drive on the host, as long as its compare values must be those of the board.
    pub shadow: Option<Shadow>,
    pty: Pty,
    bus: Pty,
    inputs: Inputs,
    seen: Seen,
    /// Dc-link voltage at the beginning, V.
    dc_link_v: f64,
    /// All lines so far, and how many of them were shown at which time.
    pub lines: Vec<Line>,
    shown: (usize, Instant),
    /// Time of the clock at a simulated time, s.
    clock: (Instant, f64),
    /// All curves so far.
    pub record: Record,
    /// Delay of the board behind the clock, s.
    pub behind_s: f64,
}

/// State of the inputs and outputs of a session.
#[derive(Default)]
struct Seen {
    typed: Assembler,
    said: Assembler,
    /// Separates the frames of a stream.
    wire: Splitter,
    resets: usize,
    /// Whether any gate was on in the last period, and the names of the active outputs of the terminal strip.
    gates_on: bool,
    outputs: String,
    last: Option<Period>,
    /// The text that a script waits for, and whether it has come.
    awaited: Option<String>,
    has_come: bool,
    end: Option<End>,
}

impl Session {
    /// Makes a session with a board that has just been powered up.
    pub fn new(board: Board, pty: Pty, bus: Pty, inputs: Inputs) -> Self {
        Self {
            dc_link_v: board.plant.dc_link(),
            clock: (Instant::now(), board.time()),
            board,
            shadow: None,
            pty,
            bus,
            inputs,
            seen: Seen::default(),
            lines: Vec::new(),
            shown: (0, Instant::now()),
            record: Record::default(),
            behind_s: 0.0,
        }
    }

    /// Runs until something ends the session.
    ///
    /// # Errors
    /// The board or the script cannot continue.
    pub fn run(&mut self) -> Result<()> {
        let end = self.until_end();
        // The flash may have changed in the last slice.
        let end = self.keep_flash().and(end);
        for (rest, source) in
            [(self.seen.typed.rest(), Source::Typed), (self.seen.said.rest(), Source::Said)]
        {
            rest.into_iter().for_each(|text| self.add(source, text));
        }
        let why = end.as_ref().map_or_else(|error| format!("{error:#}"), |end| (*end).to_owned());
        self.add(Source::Board, format!("end: {why}"));
        self.show();
        end.map(drop)
    }

    /// Plays the script, if there is one, and runs to the end.
    fn until_end(&mut self) -> Result<End> {
        if let Some(script) = self.inputs.script.clone() {
            self.follow(&script)?;
        }
        loop {
            if let Some(end) = self.seen.end {
                return Ok(end);
            }
            self.turn()?;
        }
    }

    /// Plays a script; a strict one fails at the first wrong answer.
    fn follow(&mut self, script: &Script) -> Result<()> {
        for (step, exchange) in &script.lines {
            let said = self.play(step)?;
            let is_cut_short = self.seen.end == Some(TIME_IS_OVER);
            let wrong = failure(exchange, &said).or(is_cut_short.then(|| TIME_IS_OVER.to_owned()));
            if let Some(why) = wrong {
                let why =
                    format!("script, line {}: `{}`: {why}", exchange.number, exchange.request);
                ensure!(!script.strict, why);
                self.add(Source::Board, why);
            }
            if self.seen.end.is_some() {
                return Ok(());
            }
        }
        // If the session has a time, it ends later.
        let ends = script.quits || self.inputs.seconds.is_none();
        self.seen.end = ends.then_some(if script.quits { "quit" } else { "of the script" });
        Ok(())
    }

    /// Plays a step of a script; returns the lines that the drive says meanwhile, and behind `-> ` those of the board.
    ///
    /// # Errors
    /// The board cannot continue.
    pub fn play(&mut self, step: &Step) -> Result<Vec<String>> {
        let (from, began) = (self.lines.len(), self.board.time());
        (self.seen.awaited, self.seen.has_come) = (step.until.clone(), false);
        step.typed.iter().for_each(|line| self.type_line(line));
        step.own.iter().try_for_each(|own| self.carry_out(own))?;
        let answers = |line: &Line| line.source == Source::Said && !line.text.starts_with(UNASKED);
        let mut latest = began + step.within;
        while self.seen.end.is_none() {
            let (now, since) = (self.board.time(), &self.lines[from..]);
            let is_silent = now > since.last().map_or(began, |line| line.time) + SILENCE_S;
            let has_come = self.seen.has_come;
            let is_answered = has_come || step.asks && since.iter().any(answers);
            if is_answered && is_silent || now >= latest {
                break;
            }
            self.turn()?;
            // The lines that belong to an awaited text follow it.
            if self.seen.has_come && !has_come {
                latest = self.board.time() + ANSWER_S;
            }
        }
        if let Some(text) = step.until.as_ref().filter(|_| !self.seen.has_come) {
            self.add(Source::Board, format!("nothing said `{text}` within {} s", step.within));
        }
        let said = self.lines[from..].iter().filter_map(|line| match line.source {
            Source::Said => Some(line.text.clone()),
            Source::Board => Some(format!("-> {}", line.text)),
            Source::Typed | Source::Log => None,
        });
        Ok(said.collect())
    }

    /// Runs for a slice, and waits for the clock.
    fn turn(&mut self) -> Result<()> {
        let end = self.slice();
        self.show();
        self.seen.end = end?;
        if self.inputs.paced {
            let (clock, since) = self.clock;
            let due = Duration::from_secs_f64(self.board.time() - since);
            let passed = clock.elapsed();
            if passed > due + LATE {
                self.behind_s += (passed - due).as_secs_f64();
                self.clock = (Instant::now(), self.board.time());
            }
            std::thread::sleep(due.saturating_sub(passed));
        }
        Ok(())
    }

    /// Shows the new lines, or the time if there was none for long.
    fn show(&mut self) {
        let (shown, at) = self.shown;
        let alone = self.inputs.script.is_some() || !self.inputs.paced;
        if self.lines.len() > shown {
            self.lines[shown..].iter().for_each(self.inputs.show);
            self.shown = (self.lines.len(), Instant::now());
        } else if alone && at.elapsed() >= SIGN_OF_LIFE {
            self.shown.1 = Instant::now();
            let text = "simulating".to_owned();
            (self.inputs.show)(&Line { time: self.board.time(), source: Source::Board, text });
        }
    }

    /// Reads the inputs, runs for a slice and shows the outputs; returns the reason of the end, if the session ends.
    fn slice(&mut self) -> Result<Option<End>> {
        let now = self.board.time();
        if self.inputs.stop.load(Ordering::Relaxed) {
            return Ok(Some("interrupted"));
        }
        if self.inputs.seconds.is_some_and(|seconds| now >= seconds) {
            return Ok(Some(TIME_IS_OVER));
        }
        let typed = self.pty.read()?;
        self.send(&typed);
        let asked = self.bus.read()?;
        self.board.send_bus(&asked);
        // If the terminal is closed, script and pseudo-terminal continue.
        while let Ok(line) = self.inputs.terminal.try_recv() {
            match Own::parse(&line) {
                Ok(None) => self.type_line(&line),
                Ok(Some(Own::Quit)) => return Ok(Some("quit")),
                Ok(Some(own)) => self.carry_out(&own)?,
                Err(why) => self.add(Source::Board, format!("error: {why}")),
            }
        }
        // The loader's answers are awaited.
        let slice = if self.board.loader.is_some() { SLICE / 10 } else { SLICE };
        let interrupts = self.record.interrupts;
        let went = (0..slice).try_for_each(|_| self.period());
        self.hear()?;
        if self.inputs.flux && self.record.interrupts > interrupts {
            let drive = f64::from(self.board.telemetry().phi.to_turns()).rem_euclid(1.0);
            let plant = &self.board.plant;
            let (motor, flux) = (plant.rotor_flux_angle() / TAU, plant.rotor_flux().norm());
            // A reader that has gone away does not stop the session.
            let _ = writeln!(std::io::stdout(), "flux {drive:.4} {motor:.4} {flux:.3}");
        }
        self.keep_flash()?;
        went.map(|()| None)
    }

    fn type_line(&mut self, line: &str) {
        self.send(line.as_bytes());
        self.send(b"\n");
        self.shadow.iter_mut().for_each(|shadow| shadow.type_line(line));
    }

    /// Executes a command of the board.
    fn carry_out(&mut self, own: &Own) -> Result<()> {
        match own {
            Own::Quit => self.seen.end = Some("quit"),
            Own::Help => Own::help().for_each(|line| self.add(Source::Board, line)),
            Own::Reset => self.board.reset(Reset::Pin),
            Own::Unplug => self.board.unplug(),
            Own::Wires(wires) => {
                let set = self.board.set_wires(wires);
                set.err().into_iter().for_each(|why| self.add(Source::Board, why.to_string()));
            }
            Own::Stage(on) => {
                self.board.supply_stage(*on, if *on { self.dc_link_v } else { 1.0 })?;
            }
        }
        Ok(())
    }

    fn keep_flash(&mut self) -> Result<()> {
        let Some(file) = &mut self.inputs.flash else { return Ok(()) };
        let chip = self.board.chip();
        file.follow(&chip.flash, chip.now)
    }

    fn send(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.board.send(bytes);
            if self.board.loader.is_some() {
                return;
            }
            for line in self.seen.typed.push(bytes) {
                // If the person asks for more of the log, it is shown.
                let level = line.trim().strip_prefix("log ").and_then(LogLevel::named);
                self.inputs.log = level.unwrap_or(self.inputs.log);
                self.add(Source::Typed, line);
            }
        }
    }

    /// Runs until just before the next control interrupt.
    fn period(&mut self) -> Result<()> {
        let now = self.board.chip().now;
        let next = self.seen.last.map_or(0, |period| period.began + 2 * PERIOD - BEFORE);
        // Without control interrupts (start, resets), one period at a time.
        let end = if (now + 1..now + 2 * PERIOD).contains(&next) { next } else { now + PERIOD };
        self.board.run_ticks(end - now)?;
        let gates_on = self.board.gates().any_on();
        if gates_on != self.seen.gates_on {
            self.seen.gates_on = gates_on;
            self.add(Source::Board, if gates_on { "gates: on" } else { "gates: off" }.to_owned());
        }
        while let Some(period) = self.board.next_period() {
            let drive = self.board.telemetry();
            let time = period.began as f64 / TICKS_PER_S as f64;
            self.record.take(time, &self.board.plant, &period, &drive);
            self.shadow.iter_mut().try_for_each(|shadow| shadow.follow(&period))?;
            self.seen.last = Some(period);
        }
        Ok(())
    }

    /// Fetches the output of console and log, and notes resets.
    fn hear(&mut self) -> Result<()> {
        for text in self.board.take_log()? {
            self.add(Source::Log, text);
        }
        for n in self.seen.resets..self.board.resets.len() {
            self.add(Source::Board, self.board.resets[n].1.to_string());
            self.shadow.iter_mut().try_for_each(Shadow::restart)?;
            // A frame that the reset cut short must not swallow text.
            self.seen.wire = Splitter::default();
        }
        self.seen.resets = self.board.resets.len();
        let active = ["RUN", "FAULT", "BRAKE"].into_iter().zip(self.board.terminal_outputs());
        let outputs: String =
            active.filter(|(_, on)| *on).map(|(name, _)| format!(" {name}")).collect();
        if outputs != self.seen.outputs {
            let names = if outputs.is_empty() { " none" } else { &outputs };
            self.add(Source::Board, format!("outputs:{names}"));
            self.seen.outputs = outputs;
        }
        let bytes = self.board.chip().lpuart.line.take();
        let text = |byte: &u8| match self.seen.wire.push(*byte) {
            Piece::Text(byte) => Some(byte),
            _ => None,
        };
        let text: Vec<u8> = bytes.iter().filter_map(text).collect();
        let text = if self.board.loader.is_some() { Vec::new() } else { text };
        for line in self.seen.said.push(&text) {
            let begun = line.split_once("ok: every ").and_then(|(_, rest)| rest.split(' ').next());
            let rate = begun.and_then(|periods| periods.parse::<f64>().ok()).map(|n| RATE_HZ / n);
            self.add(Source::Said, line);
            if let Some(rate) = rate {
                self.add(Source::Board, format!("stream: {rate:.0} frames/s, not shown here"));
            }
        }
        self.pty.write(&bytes)?;
        let answered = self.board.take_bus();
        self.bus.write(&answered)
    }

    fn add(&mut self, source: Source, text: String) {
        let is_heard = source != Source::Typed;
        self.seen.has_come |=
            is_heard && self.seen.awaited.as_ref().is_some_and(|awaited| text.contains(awaited));
        if source == Source::Log && log_level(&text) > self.inputs.log {
            return;
        }
        self.lines.push(Line { time: self.board.time(), source, text });
    }
}

/// Returns the level at the beginning of a log line. A line without one, such as the message of a panic, is an error.
fn log_level(line: &str) -> LogLevel {
    let word = line.split_whitespace().next().unwrap_or_default();
    LogLevel::named(word).unwrap_or(LogLevel::Error)
}
