//! The small image: with the coefficients of `cargo sim coefficients` in its flash it runs a motor, and computes the bits of the host.

use std::f64::consts::TAU;

use anyhow::{Result, ensure};
use drive_core::flux::FilterLoop;
use drive_core::{Command, Drive, FrontEndState, Mode, State, Stop};
use hil_sim::Config;
use hil_sim::config::LoadMode;
use induction_drive::coefficients::{ADDRESS, Designed, LONGEST};
use induction_drive::settings::FirmwareSettings;
use virtual_board::board::TICKS_PER_PERIOD;
use virtual_board::image::Segment;
use virtual_board::{Board, Image, Options};

/// Port and pin of the button.
const BUTTON: (usize, u32) = (2, 1 << 13);
/// Speed reference, rpm.
const RPM: f32 = 300.0;

/// A board with the small image, and the same drive on the host.
struct Small {
    board: Board,
    host: Drive<FilterLoop>,
    front_end: FrontEndState,
    /// Address of the request, and the request in the last period.
    run: u32,
    runs: bool,
    compared: u32,
    log: String,
}

impl Small {
    fn new(file: Option<&[u8]>) -> Result<Self> {
        let mut config = Config::default();
        config.load.mode = LoadMode::Free;
        let mut image = Image::built_for("drive-and-log")?;
        if let Some(file) = file {
            image.segments.push(Segment { address: ADDRESS, bytes: file.to_vec() });
        }
        let run = image.symbol("drive_and_log::image::RUN")?.address;
        let host = Drive::new(designed()?.coefficients);
        let board = Board::new(image, Options::new(&config, 31))?;
        let front_end = FrontEndState::default();
        let log = String::new();
        Ok(Self { board, host, front_end, run, runs: false, compared: 0, log })
    }

    /// Runs for some periods, and compares each control interrupt.
    fn run(&mut self, periods: u64) -> Result<()> {
        for _ in 0..periods {
            // The main loop has written it before the next interrupt.
            let mut byte = [0];
            self.board.read(self.run, &mut byte);
            self.board.run_periods(1)?;
            let mut late = 0;
            while let Some(period) = self.board.next_period() {
                // Late in a period the main loop has done its work.
                late = period.began + TICKS_PER_PERIOD * 9 / 10;
                let compare = self.host.period(&mut self.front_end, &period.sample, &mut |_| {}).0;
                let (n, state) = (self.compared, self.host.state());
                ensure!(
                    compare == period.compare,
                    "{n}, {state}: {compare:?}, {:?}",
                    period.compare
                );
                self.compared += 1;
                if self.host.has_time() && self.runs != (byte[0] == 1) {
                    self.runs = !self.runs;
                    let commands: &[Command<FilterLoop>] = match self.runs {
                        true => &[Command::Clear, Command::Start(Mode::Speed), Command::Speed(RPM)],
                        false => &[Command::Stop(Stop::Ramp)],
                    };
                    commands.iter().try_for_each(|command| self.host.command(command).map(drop))?;
                }
            }
            let now = self.board.chip().now;
            self.board.run_ticks(late.saturating_sub(now))?;
        }
        self.log += &self.board.take_log()?.join("\n");
        Ok(())
    }

    /// Presses the button for a while.
    fn press(&mut self) -> Result<()> {
        let (port, pin) = BUTTON;
        self.board.chip().lifted[port] = pin;
        self.run(1500)?;
        self.board.chip().lifted[port] = 0;
        self.run(1500)
    }
}

/// The coefficients of the default motor, which needs no learning in the simulation.
fn designed() -> Result<Designed<'static>> {
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.injection.synchronous.allow_unlearned = true;
    Ok(Designed::new(&settings, RPM)?)
}

#[test]
fn it_runs_a_motor_by_its_button_as_the_host_does() -> Result<()> {
    let mut place = [0; LONGEST];
    let mut small = Small::new(designed()?.write(&mut place))?;
    small.run(3000)?;
    ensure!(small.host.state() == State::Off && small.compared > 1000, "{}", small.log);
    small.press()?;
    small.run(24_000)?;
    ensure!(small.host.state() == State::Speed, "{}: {}", small.host.state(), small.log);
    let rpm = small.board.plant.mechanical_speed() * 60.0 / TAU;
    ensure!((rpm - f64::from(RPM)).abs() < 10.0, "{rpm} rpm");
    small.press()?;
    small.run(24_000)?;
    ensure!(small.host.state() == State::Off && small.compared > 50_000, "{}", small.log);
    for text in ["drive-and-log, board reference", "Speed", "Off", "rpm"] {
        ensure!(small.log.contains(text), "no {text:?} in {}", small.log);
    }
    Ok(())
}

/// Without coefficients, or with damaged ones, the pins of the gates stay as after a reset.
#[test]
fn it_does_nothing_without_its_coefficients() -> Result<()> {
    let mut place = [0; LONGEST];
    let mut damaged = designed()?.write(&mut place).unwrap_or_default().to_vec();
    damaged[100] ^= 1;
    for (file, why) in [(None, "no coefficients"), (Some(&*damaged), "damaged")] {
        let mut small = Small::new(file)?;
        small.board.run_ticks(170_000_000 / 20)?;
        let log = small.board.take_log()?.join("\n");
        ensure!(log.contains(why) && !small.board.gates().any_on(), "{log}");
    }
    Ok(())
}
