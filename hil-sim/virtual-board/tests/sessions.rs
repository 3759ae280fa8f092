//! Plays the sessions of `tests/sessions/board/` with the image on the emulated board, and compares every answer. The page
//! `tests/sessions/README.md` describes their lines.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::channel;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use hil_sim::Config;
use hil_sim::board::LogLevel;
use hil_sim::experiments::drawn_machine::drawn;
use induction_drive::board::protection;
use stm32g4_unicorn::chip::Damage;
use stm32g4_unicorn::circuit::Source as Pin;
use stm32g4_unicorn::rules::Rule;
use virtual_board::board::rom::N_SWBOOT0;
use virtual_board::board::snapshot::Snapshot;
use virtual_board::interactive::pty::Pty;
use virtual_board::interactive::script::{SILENT, Step};
use virtual_board::interactive::session::{Inputs, Session};
use virtual_board::interactive::transcript::Source;
use virtual_board::power_stage::PowerStage;
use virtual_board::{Board, Image, Options, Shadow};

#[path = "../../../tests/sessions/played.rs"]
mod played;

/// The first double word of the history.
const HISTORY: u32 = 0x0807_c000;

/// Makes one test of each session, whose file has the name of the test with hyphens.
macro_rules! sessions {
    ($($name:ident)*) => {
        const ALL: &[&str] = &[$(stringify!($name)),*];
        $(
            #[test]
            fn $name() -> Result<()> {
                is_as_written(stringify!($name))
            }
        )*
    };
}

sessions! {
    board_confirmation
    board_settings
    chopper
    chopper_lost
    commissioning
    commissioning_of_the_current_loop
    commissioning_of_the_inertia
    commissioning_stopped
    history
    homing
    image_of_another_board
    learned
    self_test_damage
    self_test_dc_link
    self_test_pins
    slow_flash
    sources
    sources_while_running
    start
    start_refused
    terminal_strip
    volts_per_hertz
}

fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/sessions/board"))
}

#[test]
fn every_session_is_played() -> Result<()> {
    let names = fs::read_dir(folder())?.map(|entry| Ok(entry?.file_name().into_string()));
    let names = names.collect::<Result<Result<BTreeSet<_>, _>>>()?;
    let played = ALL.iter().map(|name| format!("{}.txt", name.replace('_', "-")));
    assert_eq!(names.map_err(|name| anyhow!("{name:?}"))?, played.collect());
    Ok(())
}

fn is_as_written(name: &str) -> Result<()> {
    let path = folder().join(name.replace('_', "-") + ".txt");
    let mut player = Player::default();
    let play = |request: &str| player.play(request).map_err(|why| format!("{why:#}"));
    match played::difference(&path, play).map_err(anyhow::Error::msg)? {
        Some(wrong) => bail!(wrong),
        None => Ok(()),
    }
}

/// A session on a board, and the state of the board to which it may go back.
#[derive(Default)]
struct Player {
    session: Option<Session>,
    kept: Option<Snapshot>,
    /// Number of lines before it went back.
    before: usize,
}

impl Player {
    /// Plays a request; returns the answer. What happens at the bench takes no time.
    fn play(&mut self, request: &str) -> Result<Vec<String>> {
        let inner = request.strip_prefix('[').and_then(|inner| inner.strip_suffix(']'));
        let inner = inner.unwrap_or_default();
        let (name, value) = inner.split_once(": ").unwrap_or((inner, ""));
        if name == "board" {
            (self.session, self.before) = (Some(power_up(value)?), 0);
            return Ok(Vec::new());
        }
        let session = self.session.as_mut().context("no board")?;
        match (name, &self.kept) {
            ("alone", _) => session.shadow = None,
            ("keep", _) => {
                self.kept = Some(session.board.keep()?);
                session.shadow = None;
            }
            ("go back", Some(kept)) => {
                session.board.go_back(kept)?;
                self.before = session.lines.len();
            }
            ("log", _) => {
                let lines = session.lines[self.before..].iter();
                let texts = lines
                    .filter(|line| line.source == Source::Log)
                    .map(|line| &line.text)
                    .filter(|text| text.contains(value));
                return Ok(texts.cloned().collect());
            }
            _ => {
                if let Some(said) = at_the_bench(&mut session.board, name, value)? {
                    return Ok(said.into_iter().map(|text| format!("-> {text}")).collect());
                }
                return step(session, request);
            }
        }
        Ok(Vec::new())
    }
}

/// Plays a request that takes time.
fn step(session: &mut Session, request: &str) -> Result<Vec<String>> {
    let mut said = session.play(&Step::parse(request).map_err(anyhow::Error::msg)?)?;
    ensure!(!said.iter().any(|line| line.starts_with(SILENT)), "{said:#?}");
    said.iter_mut().for_each(leave_out_version);
    let broken = session.board.violations().iter();
    let broken: Vec<_> = broken.filter(|broken| broken.rule != Rule::IwdgBusy).collect();
    ensure!(broken.is_empty(), "{broken:?}");
    Ok(said)
}

/// Leaves out of a greeting what differs from image to image.
fn leave_out_version(line: &mut String) {
    if let Some(at) = line.find("last run: ").filter(|_| line.starts_with("* induction-drive ")) {
        line.replace_range(..at, "* induction-drive version; ");
    }
}

/// Changes or reads something at the bench; `None` for other requests.
fn at_the_bench(board: &mut Board, name: &str, value: &str) -> Result<Option<Option<String>>> {
    let numbers: Vec<f64> = value.split(' ').map_while(|word| word.parse().ok()).collect();
    match (name, &numbers[..]) {
        ("fault input", _) => board.set_fault_pin(value == "high"),
        ("damage", _) => {
            board.chip().damage = match value {
                "none" => None,
                "input" => Some(Damage::Input),
                "comparator" => Some(Damage::Comparator),
                "break" => Some(Damage::Break),
                level => Some(Damage::Level(level.trim_start_matches("level ").parse()?)),
            };
        }
        ("comparator offset", [counts]) => board.chip().comparator_offset = *counts as u16,
        ("dc link", [volts, ..]) => charge(board, *volts)?,
        ("dc link", _) if value == "normal" => {
            let volts = board.chip().circuit.stage.config()?.inverter.dc_link_v;
            charge(board, volts)?;
        }
        ("dc link", _) => {
            let stage = board.chip().circuit.stage;
            let settings = stage.firmware_settings();
            let level = protection(stage.board(), &settings).over_voltage;
            charge(board, settings.scales.dc_link.at(level + 100).into())?;
        }
        ("clocks", [crystal, oscillator]) => board.chip().set_clocks(*crystal, *oscillator),
        ("reference voltage", [error]) => board.chip().set_reference(*error),
        ("crystal", _) => board.set_crystal(value != "stopped"),
        ("pll", _) => board.chip().rcc.pll_locks = value != "unlocked",
        ("flash cycles", [cycles]) => board.chip().flash_cycles = *cycles as u64,
        ("option bit", [bit]) => board.chip().flash.options ^= 1 << *bit as u32,
        ("corrected flash error", _) => board.chip().flash.correct(),
        ("supply", [volts, ..]) => board.chip().set_supply(*volts),
        ("torn history", _) => board.chip().flash.tear(HISTORY),
        ("chopper", _) => {
            return Ok(Some(Some(format!("{:.3}", board.chopper_duty()))));
        }
        ("chopper off", _) => board.chip().tim8.system_break(),
        ("no samples", _) => board.chip().adc.lose_triggers = [u32::MAX; 2],
        ("boot pin not in use", _) => board.chip().flash.options &= !N_SWBOOT0,
        ("gate pins", _) => {
            let of = board.chip().circuit.stage.board();
            let connected = of.high.pins.into_iter().chain(of.low.pins).filter(|pin| {
                let modes = board.chip().gpio[pin.port as usize].read(0).unwrap_or(0);
                modes >> (2 * pin.number) & 3 == 2
            });
            return Ok(Some(Some(format!("{} of 6 connected", connected.count()))));
        }
        ("pull at the fault input", _) => {
            let pull = board.chip().gpio[0].pull(6);
            let names = pull.map_or("none", |is_up| if is_up { "up" } else { "down" });
            return Ok(Some(Some(names.to_owned())));
        }
        ("flash operations", _) => {
            return Ok(Some(Some(board.chip().flash.operations.to_string())));
        }
        ("rotor", _) => {
            let rpm = board.plant.mechanical_speed() * 60.0 / TAU;
            let turns = board.plant.mechanical_angle() / TAU;
            return Ok(Some(Some(format!("{rpm:.1} rpm, {turns:.4} turns"))));
        }
        _ => return Ok(None),
    }
    Ok(Some(None))
}

/// Sets the voltage of the dc link. The counter, which otherwise passes on the samples, may be at rest.
fn charge(board: &mut Board, volts: f64) -> Result<()> {
    board.plant.set_dc_link(volts)?;
    let dc_link = board.plant.clone().sample().dc_link;
    board.show_dc_link(dc_link);
    Ok(())
}

/// Powers up a board of this name, with changes.
fn power_up(value: &str) -> Result<Session> {
    let mut words = value.split(", ");
    let stage = PowerStage::named(words.next().unwrap_or_default())?;
    let changes = words.map(|change| change.split_once(' ').unwrap_or((change, "")));
    let (mut config, mut image, mut seed) = (stage.config()?, stage.name, 1);
    for (name, value) in changes.clone() {
        match name {
            "image" => image = value,
            "seed" => seed = value.parse()?,
            "drawn" => config = drawn(&Config::default(), value.parse()?),
            key if key.contains('.') => config.set(key, value)?,
            _ => {}
        }
    }
    let mut options = Options::on(stage, &config, seed);
    let mut may_be_busy = false;
    for (name, value) in changes {
        match name {
            "unconfirmed" => options.confirmed = false,
            "watchdog" => may_be_busy = true,
            "no-cycles" => options.counting.cycles = false,
            "fault-pull" => options.fault_pull_ohm = value.parse()?,
            "dc-link-driven" => options.dc_link_pin = Pin::Driven,
            "dc-link-capacitor" => {
                let Pin::Divider { ohm, .. } = stage.dc_link_pin else { bail!("no divider") };
                options.dc_link_pin = Pin::Divider { ohm, farad: value.parse()? };
            }
            "image" | "seed" | "drawn" => {}
            name => ensure!(name.contains('.'), "no such board: {name}"),
        }
    }
    let inputs = Inputs {
        terminal: channel().1,
        stop: Arc::default(),
        script: None,
        seconds: None,
        paced: false,
        flash: None,
        log: LogLevel::Debug,
        flux: false,
        show: |_| (),
    };
    let shadow = Shadow::new(&options)?;
    let mut board = Board::new(Image::built_for(image)?, options)?;
    if may_be_busy {
        board.collect_violations();
    }
    let mut session = Session::new(board, Pty::open()?, Pty::open()?, inputs);
    session.shadow = Some(shadow);
    Ok(session)
}
