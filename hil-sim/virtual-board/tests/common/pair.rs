//! A board and its shadow: the compare values of both are compared, and the shadow knows the state of the drive.

use anyhow::{Context as _, Result, bail};
use drive_core::State;
use drive_stream::client::{Answer, Client, Event};

use virtual_board::{Board, Image, Options, Period, Shadow};

/// Longest time of the firmware from reset to its greeting, or to an answer, periods.
const LONGEST_ANSWER: u64 = 30_000;
/// Longest duration of an announcement on the wire, periods.
const QUIET: u64 = 120;
/// Longest time from a start to regulating, or from a stop to off, periods.
const LONGEST_START: u64 = 60_000;

/// A board and its shadow.
pub struct Pair {
    /// The board.
    pub board: Board,
    /// The drive on the host.
    pub shadow: Shadow,
}

impl Pair {
    /// Makes a board that has started and waits for requests.
    ///
    /// # Errors
    /// The board does not start.
    pub fn new(image: Image, options: Options) -> Result<Self> {
        let mut pair = Self { shadow: Shadow::new(&options)?, board: Board::new(image, options)? };
        pair.greeted()?;
        Ok(pair)
    }

    /// Runs for some periods; `look` is called after each control interrupt.
    ///
    /// # Errors
    /// A failure of the board, or compare values that differ.
    pub fn run(&mut self, periods: u64, mut look: impl FnMut(&Self, &Period)) -> Result<()> {
        for _ in 0..periods {
            self.board.run_periods(1)?;
            while let Some(period) = self.board.next_period() {
                self.shadow.follow(&period)?;
                look(self, &period);
            }
        }
        Ok(())
    }

    /// Runs until a condition holds, for at most `periods`.
    ///
    /// # Errors
    /// As [`Pair::run`]; also if the condition does not hold in time.
    pub fn until(
        &mut self,
        what: &str,
        periods: u64,
        mut done: impl FnMut(&mut Self, State) -> bool,
    ) -> Result<()> {
        for _ in 0..periods {
            self.run(1, |_, _| {})?;
            let state = self.shadow.drive.state();
            if done(self, state) {
                return Ok(());
            }
        }
        let log = self.board.take_log()?;
        bail!("{what} did not come; the drive is {}; log {log:#?}", self.shadow.drive.state())
    }

    /// Runs until the drive has greeted after a reset.
    ///
    /// # Errors
    /// As [`Pair::until`].
    pub fn greeted(&mut self) -> Result<()> {
        let ends = |pair: &mut Self, _| pair.board.take_console().ends_with('\n');
        self.until("the greeting", LONGEST_ANSWER, ends)
    }

    /// Types a line and waits for its answer.
    ///
    /// # Errors
    /// As [`Pair::until`].
    pub fn ask(&mut self, line: &str) -> Result<Answer> {
        // First the drive finishes its current output.
        self.run(QUIET, |_, _| {})?;
        self.board.take_console();
        let mut client = Client::default();
        self.board.send(client.ask(line).as_bytes());
        self.shadow.type_line(line);
        let mut answer = None;
        self.until(&format!("an answer to {line:?}"), LONGEST_ANSWER, |pair, _| {
            let said = pair.board.take_console();
            for event in said.bytes().filter_map(|byte| client.push(byte)) {
                if let Event::Answer(whole) = event {
                    answer = Some(whole);
                }
            }
            answer.is_some() && said.ends_with('\n')
        })?;
        answer.context("an answer")
    }

    /// Types a line that the drive must accept.
    ///
    /// # Errors
    /// As [`Pair::until`]; also if the drive refuses the line.
    pub fn order(&mut self, line: &str) -> Result<()> {
        match self.ask(line)?.error() {
            None => Ok(()),
            Some(why) => bail!("{line:?}: {why}"),
        }
    }

    /// Starts, and runs until the drive regulates torque.
    ///
    /// # Errors
    /// As [`Pair::order`].
    pub fn start_torque(&mut self) -> Result<()> {
        self.order("start torque")?;
        self.until_state(State::Torque)
    }

    /// Runs until the drive is in this state.
    ///
    /// # Errors
    /// As [`Pair::until`].
    pub fn until_state(&mut self, wanted: State) -> Result<()> {
        self.until(&wanted.to_string(), LONGEST_START, |_, state| state == wanted)
    }
}
