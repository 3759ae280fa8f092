//! What the tests share: the image, and a board beside its shadow.
#![allow(dead_code)] // no test uses everything

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use drive_core::State;
use hil_sim::Config;
use virtual_board::image::Image;
use virtual_board::{Board, Options, Period, Shadow};

/// Environment variable that names the ELF; `cargo xtask board` builds it and sets it.
const ELF: &str = "INDUCTION_DRIVE_ELF";
/// Where `cargo firmware` puts it, below the target directory, with rustup's or Debian's compiler.
const PLACES: [&str; 2] = ["", "debian"];

/// The image: the one in the environment, else the one that was built last.
pub fn image() -> Result<Image> {
    if let Some(path) = std::env::var_os(ELF) {
        return Image::open(&PathBuf::from(path));
    }
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let built = PLACES.map(|place| {
        target.join(place).join("thumbv7em-none-eabihf/firmware/induction-drive")
    });
    let newest = built
        .into_iter()
        .filter_map(|path| Some((path.metadata().ok()?.modified().ok()?, path)))
        .max()
        .map(|found| found.1);
    Image::open(&newest.context("no firmware image: type `cargo firmware`")?)
}

/// A board that follows what its shadow does, or the test fails.
pub struct Pair {
    pub board: Board,
    pub shadow: Shadow,
}

impl Pair {
    /// A board that has started and waits for orders.
    pub fn new(config: &Config, seed: u64) -> Result<Self> {
        let mut pair = Self {
            board: Board::new(image()?, Options::new(config, seed))?,
            shadow: Shadow::new()?,
        };
        pair.until("the greeting", 30_000, |pair, _| pair.board.heard().ends_with('\n'))?;
        Ok(pair)
    }

    /// Goes on for some periods; `look` is called after each control interrupt.
    pub fn run(&mut self, periods: u64, mut look: impl FnMut(&Self, &Period)) -> Result<()> {
        for _ in 0..periods {
            self.board.run_periods(1)?;
            let seen: Vec<Period> = self.board.periods().collect();
            for period in &seen {
                self.shadow.follow(period)?;
                look(self, period);
            }
        }
        Ok(())
    }

    /// Goes on until something is so, for `periods` at most.
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
        let log = self.board.logged()?;
        bail!("{what} did not come; {}; log {log:#?}", self.shadow.drive.state())
    }

    /// Types a line and waits for its answer.
    pub fn say(&mut self, line: &str) -> Result<String> {
        self.board.heard();
        self.board.type_line(line);
        self.shadow.type_line(line)?;
        let mut answer = String::new();
        self.until(&format!("an answer to {line:?}"), 30_000, |pair, _| {
            answer += &pair.board.heard();
            answer.ends_with('\n')
        })?;
        Ok(answer.trim_end().to_owned())
    }

    /// Types a line that must be taken.
    pub fn order(&mut self, line: &str) -> Result<()> {
        match self.say(line)?.as_str() {
            "ok" => Ok(()),
            answer => bail!("{line:?}: {answer}"),
        }
    }

    /// Goes on until the drive is in this state.
    pub fn until_state(&mut self, wanted: State) -> Result<()> {
        self.until(&wanted.to_string(), 60_000, |_, state| state == wanted)
    }
}
