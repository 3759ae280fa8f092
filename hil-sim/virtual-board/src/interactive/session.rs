//! A session: the board runs in small slices of time; between them bytes are exchanged.

use std::f64::consts::TAU;
use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use drive_stream::{Piece, Splitter};
use hil_sim::{board::LogLevel, rig::RATE_HZ};

use super::script::{Due, Script};
use super::transcript::{Assembler, Line, Source};
use super::{flash_file::FlashFile, own::Own, pty::Pty, record::Record};
use crate::board::{Board, Period};
use crate::chip::{TICKS_PER_PERIOD as PERIOD, TICKS_PER_S};
use crate::periph::Reset;

/// Number of control periods between two exchanges with the inputs: 5 ms, which a person does not notice.
const SLICE: u32 = 30;
/// Time before a control interrupt at which the board is examined, ticks: the previous interrupt has ended, and the
/// motor is in the state in which it was sampled for that interrupt.
const BEFORE: u64 = PERIOD / 8;
/// Delay beyond which lost time is not made up for, because the board would run too fast.
const LATE: Duration = Duration::from_millis(100);

/// Time without a line after which a session without a person shows its time.
const SIGN_OF_LIFE: Duration = Duration::from_secs(10);

/// The reason why a session has ended, in words.
type End = &'static str;

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
}

/// A board with its inputs and outputs.
pub struct Session {
    /// The board.
    pub board: Board,
    pty: Pty,
    bus: Pty,
    inputs: Inputs,
    typed: Assembler,
    said: Assembler,
    /// Separates the frames of a stream.
    wire: Splitter,
    resets: usize,
    last: Option<Period>,
    /// Dc-link voltage at the beginning, V.
    dc_link_v: f64,
    /// The drive's flux angle, the motor's, turns, and the motor's flux, Wb, in the last period.
    flux: Option<[f64; 3]>,
    /// All lines so far.
    pub lines: Vec<Line>,
    /// All curves so far.
    pub record: Record,
    /// Delay of the board behind the clock, s.
    pub behind_s: f64,
}

impl Session {
    /// Makes a session with a board that has just been powered up.
    pub fn new(board: Board, pty: Pty, bus: Pty, inputs: Inputs) -> Self {
        Self {
            dc_link_v: board.plant.dc_link(),
            board,
            pty,
            bus,
            inputs,
            typed: Assembler::default(),
            said: Assembler::default(),
            wire: Splitter::default(),
            resets: 0,
            last: None,
            flux: None,
            lines: Vec::new(),
            record: Record::default(),
            behind_s: 0.0,
        }
    }

    /// Runs until something ends the session; `show` gets every line when it comes.
    ///
    /// # Errors
    /// The board or the script cannot continue.
    pub fn run(&mut self, mut show: impl FnMut(&Line)) -> Result<()> {
        let (mut clock, mut since) = (Instant::now(), self.board.time());
        let mut said = Instant::now();
        let alone = self.inputs.script.is_some() || !self.inputs.paced;
        let end = loop {
            let shown = self.lines.len();
            let end = self.slice();
            self.lines[shown..].iter().for_each(&mut show);
            if let Some(end) = end.transpose() {
                break end;
            }
            if self.lines.len() > shown {
                said = Instant::now();
            } else if alone && said.elapsed() >= SIGN_OF_LIFE {
                said = Instant::now();
                let text = "simulating".to_owned();
                show(&Line { time: self.board.time(), source: Source::Board, text });
            }
            if self.inputs.paced {
                let due = Duration::from_secs_f64(self.board.time() - since);
                let passed = clock.elapsed();
                if passed > due + LATE {
                    self.behind_s += (passed - due).as_secs_f64();
                    (clock, since) = (Instant::now(), self.board.time());
                }
                std::thread::sleep(due.saturating_sub(passed));
            }
        };
        // The flash may have changed in the last slice.
        let end = self.keep_flash().and(end);
        let shown = self.lines.len();
        for (rest, source) in [(self.typed.rest(), Source::Typed), (self.said.rest(), Source::Said)]
        {
            rest.into_iter().for_each(|text| self.add(source, text));
        }
        let why = end.as_ref().map_or_else(|error| format!("{error:#}"), |end| (*end).to_owned());
        self.add(Source::Board, format!("end: {why}"));
        self.lines[shown..].iter().for_each(&mut show);
        end.map(drop)
    }

    /// Reads the inputs, runs for a slice and shows the outputs; returns the reason of the end, if the session ends.
    fn slice(&mut self) -> Result<Option<End>> {
        let now = self.board.time();
        if self.inputs.stop.load(Ordering::Relaxed) {
            return Ok(Some("interrupted"));
        }
        if self.inputs.seconds.is_some_and(|seconds| now >= seconds) {
            if let Some(why) = self.inputs.script.as_mut().and_then(Script::cut_short) {
                bail!(why);
            }
            return Ok(Some("the time is over"));
        }
        let typed = self.pty.read()?;
        self.send(&typed);
        let asked = self.bus.read()?;
        self.board.send_bus(&asked);
        // If the terminal is closed, script and pseudo-terminal continue.
        while let Ok(line) = self.inputs.terminal.try_recv() {
            if let Some(end) = self.enter(&line)? {
                return Ok(Some(end));
            }
        }
        if let Some(script) = &mut self.inputs.script {
            match script.due(now)? {
                Due::Type(line) => {
                    if let Some(end) = self.enter(&line)? {
                        return Ok(Some(end));
                    }
                }
                Due::Note(text) => self.add(Source::Board, text),
                // If the session has a time, it ends later.
                Due::End if self.inputs.seconds.is_none() => return Ok(Some("of the script")),
                Due::End | Due::Nothing => {}
            }
        }
        // The loader's answers are awaited.
        let slice = if self.board.loader.is_some() { SLICE / 10 } else { SLICE };
        let went = (0..slice).try_for_each(|_| self.period());
        self.hear()?;
        if let Some([drive, motor, flux]) = self.flux.take().filter(|_| self.inputs.flux) {
            // A reader that has gone away does not stop the session.
            let _ = writeln!(std::io::stdout(), "flux {drive:.4} {motor:.4} {flux:.3}");
        }
        self.keep_flash()?;
        went.map(|()| None)
    }

    /// Executes a command of the board, or sends the line to the console; returns the reason of the end, if the session ends.
    fn enter(&mut self, line: &str) -> Result<Option<End>> {
        match Own::parse(line) {
            Ok(None) => {
                self.send(line.as_bytes());
                self.send(b"\n");
            }
            Err(why) => self.add(Source::Board, format!("error: {why}")),
            Ok(Some(Own::Quit)) => return Ok(Some("quit")),
            Ok(Some(Own::Help)) => Own::help().for_each(|line| self.add(Source::Board, line)),
            Ok(Some(Own::Reset)) => self.board.reset(Reset::Pin),
            Ok(Some(Own::Unplug)) => self.board.unplug(),
            Ok(Some(Own::Wires(wires))) => {
                let set = self.board.set_wires(&wires);
                set.err().into_iter().for_each(|why| self.add(Source::Board, why.to_string()));
            }
            Ok(Some(Own::Stage(on))) => {
                self.board.supply_stage(on, if on { self.dc_link_v } else { 1.0 })?;
            }
        }
        Ok(None)
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
            for line in self.typed.push(bytes) {
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
        let next = self.last.map_or(0, |period| period.began + 2 * PERIOD - BEFORE);
        // Without control interrupts (start, resets), one period at a time.
        let end = if (now + 1..now + 2 * PERIOD).contains(&next) { next } else { now + PERIOD };
        self.board.run_ticks(end - now)?;
        while let Some(period) = self.board.next_period() {
            let drive = self.board.telemetry();
            let time = period.began as f64 / TICKS_PER_S as f64;
            let truth =
                [self.board.plant.rotor_flux_angle() / TAU, self.board.plant.rotor_flux().norm()];
            self.flux = Some([f64::from(drive.phi.to_turns()).rem_euclid(1.0), truth[0], truth[1]]);
            self.record.take(time, &self.board.plant, &period, &drive);
            self.last = Some(period);
        }
        Ok(())
    }

    /// Fetches the output of console and log, and notes resets.
    fn hear(&mut self) -> Result<()> {
        for text in self.board.take_log()? {
            self.add(Source::Log, text);
        }
        for n in self.resets..self.board.resets.len() {
            self.resets = n + 1;
            let cause = self.board.resets[n].1;
            self.add(Source::Board, cause.to_string());
            // A frame that the reset cut short must not swallow text.
            self.wire = Splitter::default();
        }
        let bytes = self.board.chip().lpuart.line.take();
        let text = |byte: &u8| match self.wire.push(*byte) {
            Piece::Text(byte) => Some(byte),
            _ => None,
        };
        let text: Vec<u8> = bytes.iter().filter_map(text).collect();
        let text = if self.board.loader.is_some() { Vec::new() } else { text };
        for line in self.said.push(&text) {
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
        if let Some(script) = &mut self.inputs.script
            && matches!(source, Source::Said | Source::Log)
        {
            script.hear(&text);
        }
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
