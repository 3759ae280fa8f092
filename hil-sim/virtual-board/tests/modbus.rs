//! The field bus of the image: a master in these tests starts, runs, reads and stops the drive, and the rotor of the
//! simulated motor shows it.

use std::f64::consts::TAU;
use std::path::Path;
use std::process::Command;
use std::{env, fs};

use crate::common::{say, until_said};
use anyhow::{Context, Result, ensure};
use hil_sim::Config;
use hil_sim::config::LoadMode;
use induction_drive::modbus::float::to_float;
use induction_drive::settings::keys;
use virtual_board::board::confirmed;
use virtual_board::image::ELF;
use virtual_board::{Board, Image, Options};

/// Number of periods from a frame to the end of its answer: 8 bytes, 3.5 characters of silence, and 30 bytes at 19 200 bit/s are 27 ms.
const ANSWERED: u64 = 240;
/// Number of periods from a frame to the end of its answer at 115 200 bit/s.
const ANSWERED_FAST: u64 = 60;
/// Largest time from the end of a frame to the first byte of its answer, s: the silence of 2.03 ms, the interrupts, a
/// pass of the main loop, and the byte itself, 0.57 ms.
const LATEST_S: f64 = 0.004;
const COMMAND: u16 = 0x2000;
const STATUS: u16 = 0x2101;
const AT_SPEED: u16 = 1 << 12;
/// State "operation enabled", commanded by the bus.
const RUNS: u16 = 0x503;
const SERVER_FAILURE: u8 = 4;

fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xffff_u16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xa001 } else { 0 };
        }
    }
    crc.to_le_bytes()
}

fn framed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes)].concat()
}

fn options(config: &Config) -> Options {
    let mut config = config.clone();
    config.load.mode = LoadMode::Free;
    config.drive.injection.synchronous.allow_unlearned = true;
    Options::new(&config, 7)
}

/// A board with a free shaft, and the master of its bus.
struct Master {
    board: Board,
    answered: u64,
}

impl Master {
    /// Returns a board that has started and has received these lines.
    fn new(lines: &[&str]) -> Result<Self> {
        Self::with(options(&Config::default()), lines)
    }

    fn with(options: Options, lines: &[&str]) -> Result<Self> {
        let board = Board::new(Image::built()?, options)?;
        let mut master = Self { board, answered: ANSWERED };
        until_said(&mut master.board, "last run")?;
        for line in lines {
            say(&mut master.board, line, "ok")?;
        }
        Ok(master)
    }

    /// Sends bytes; returns the bytes that the board sends meanwhile.
    fn send(&mut self, frame: &[u8]) -> Result<Vec<u8>> {
        self.board.send_bus(frame);
        self.board.run_periods(self.answered)?;
        Ok(self.board.take_bus())
    }

    /// Sends a request to slave 1; returns its answer without address and checksum, which are checked.
    fn ask(&mut self, pdu: &[u8]) -> Result<Vec<u8>> {
        let answer = self.send(&framed(&[&[1], pdu].concat()))?;
        let body = answer.len().checked_sub(2).context("no answer")?;
        ensure!(answer[0] == 1 && answer[body..] == crc(&answer[..body]), "{answer:x?}");
        Ok(answer[1..body].to_vec())
    }

    fn read(&mut self, at: u16, count: u8) -> Result<Vec<u16>> {
        let [high, low] = at.to_be_bytes();
        let answer = self.ask(&[3, high, low, 0, count])?;
        ensure!(answer.len() == 2 + 2 * usize::from(count) && answer[0] == 3, "{answer:x?}");
        Ok(answer[2..].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
    }

    /// Writes a register; returns the exception, if there is one.
    fn write(&mut self, at: u16, word: u16) -> Result<Option<u8>> {
        let request = [&[6], &at.to_be_bytes()[..], &word.to_be_bytes()].concat();
        let answer = self.ask(&request)?;
        ensure!(answer == request || answer[0] == 0x86, "{answer:x?}");
        Ok((answer[0] == 0x86).then(|| answer[1]))
    }

    /// Runs for some time, while repeated writes of the commanded frequency keep the bus alive.
    fn run(&mut self, seconds: f64) -> Result<()> {
        for _ in 0..(seconds / 0.25) as u32 {
            let frequency = self.read(0x2001, 1)?[0];
            self.write(0x2001, frequency)?;
            self.board.run_periods(1500 - 2 * self.answered)?;
        }
        Ok(())
    }

    fn rpm(&self) -> f64 {
        self.board.plant.mechanical_speed() * 60.0 / TAU
    }

    /// Returns the value of a setting or a signal from its two registers.
    fn float(&mut self, at: u16) -> Result<f32> {
        let words = self.read(at, 2)?;
        Ok(f32::from_bits(u32::from(words[0]) << 16 | u32::from(words[1])))
    }

    fn outputs_on(&mut self) -> bool {
        self.board.chip().tim1.outputs_on()
    }
}

const BUS: [&str; 2] = ["set bus.commands bus", "save"];

/// Start, run to speed, read, reverse, stop: 5 Hz with two pole pairs are 150 rpm. A sensorless drive reaches the speed
/// of the simulated rotor within 3 %; the registers agree with it within 3 % and a count.
#[test]
fn the_bus_starts_runs_reads_and_stops_the_drive() -> Result<()> {
    let mut master = Master::new(&BUS)?;
    // Switch on disabled, dc link present, remote; after a reset the speed is unknown.
    assert_eq!(master.read(0x6041, 1)?, [0x4250]);
    // `speed.limit_rpm` of the image, 0.01 Hz.
    let settings = induction_drive::board::settings();
    let largest = settings.speed_limit_rpm() * f32::from(settings.motor.pole_pairs) / 0.6;
    assert_eq!(master.read(0x211b, 1)?, [largest.round() as u16]);
    // Command and frequency in one block.
    let answer = master.ask(&[16, 0x20, 0, 0, 2, 4, 0, 18, 500_u16.to_be_bytes()[0], 244])?;
    assert_eq!(answer, [16, 0x20, 0, 0, 2]);
    master.run(4.5)?;
    let rpm = master.rpm();
    assert!((rpm / 150.0 - 1.0).abs() < 0.03, "{rpm} rpm");
    let page = master.read(0x2100, 13)?;
    assert_eq!((page[0], page[1], page[2]), (0, RUNS | AT_SPEED, 500));
    // A single reading varies with the tracked angle.
    let mut frequency = 0.0;
    for _ in 0..8 {
        master.run(0.25)?;
        frequency += f64::from(master.read(0x2103, 1)?[0]) / 8.0;
    }
    assert!((frequency - 500.0).abs() < 20.0, "output frequency {frequency}");
    assert!((f64::from(page[5]) - 3110.0).abs() < 60.0, "dc link {}", page[5]);
    for n in [7, 12] {
        assert!((f64::from(page[n]) - rpm).abs() < 0.03 * rpm + 1.0, "{} rpm", page[n]);
    }
    // Unused registers read as 0.
    assert_eq!(page[8..11], [0, 0, 0]);
    // Operation enabled, target reached.
    assert_eq!(master.read(0x6041, 1)?, [0x637]);
    assert_eq!(master.write(COMMAND, 34)?, None);
    master.run(3.5)?;
    let rpm = master.rpm();
    assert!((rpm / -150.0 - 1.0).abs() < 0.03, "{rpm} rpm");
    assert_eq!(master.read(STATUS, 1)?, [RUNS | 3 << 3 | AT_SPEED]);
    // Settings must not be written meanwhile.
    let set = [16, 0x40, 0, 0, 2, 4, 0x40, 0xb0, 0, 0];
    assert_eq!(master.ask(&set)?, [0x90, SERVER_FAILURE]);
    assert_eq!(master.write(COMMAND, 1)?, None);
    master.run(2.0)?;
    assert!(!master.outputs_on());
    // Off, and at standstill: by `bus.standstill_pct`, slower than 0.5 % of the largest speed.
    assert_eq!(master.read(STATUS, 1)?, [0x2500]);
    let slow = 0.005 * f64::from(settings.speed_limit_rpm());
    assert!(master.rpm().abs() < slow, "{} rpm", master.rpm());
    assert!(master.board.resets.is_empty());
    Ok(())
}

/// Sends frames; each must be answered without an exception.
fn replay(master: &mut Master, frames: &str) -> Result<()> {
    frames.split(" | ").try_for_each(|frame| {
        let bytes = frame.split(' ').map(|byte| u8::from_str_radix(byte, 16));
        let pdu = bytes.collect::<Result<Vec<_>, _>>()?;
        let answer = master.ask(&pdu)?;
        ensure!(answer[0] == pdu[0], "{frame} gave {answer:x?}");
        Ok(())
    })
}

/// Repeats frames four times a second, or as often as the line takes them.
fn repeat(master: &mut Master, frames: &str, seconds: f64) -> Result<()> {
    let end = master.board.time() + seconds;
    while master.board.time() < end {
        let next = master.board.time() + 0.25;
        replay(master, frames)?;
        let rest = (next - master.board.time()) * 6000.0;
        master.board.run_periods(rest.max(0.0) as u64)?;
    }
    Ok(())
}

/// The frames that masters send run a spindle, stop it, start it again while it turns, and stop it.
#[test]
fn recipes_of_masters_run_stop_and_restart_a_turning_spindle() -> Result<()> {
    let recipes = include_str!("recipes.txt").split("\n\n").skip(1);
    let mut replayed = 0;
    for recipe in recipes {
        let title = recipe.lines().next().context("a title")?;
        let find = |name: &str| recipe.lines().find_map(|line| line.strip_prefix(name));
        let frames = |name| find(name).with_context(|| format!("{title}: no {name}"));
        let (run, rest) = (frames("run: ")?, frames("rest: ")?);
        let typed = find("console: ").unwrap_or(BUS[0]);
        let mut master = Master::new(&[BUS[0], typed, BUS[1]])?;
        for start in ["start: ", "again: "] {
            replay(&mut master, frames(start)?)?;
            repeat(&mut master, run, 5.5)?;
            let rpm = master.rpm();
            ensure!((rpm / 300.0 - 1.0).abs() < 0.03, "{title}, {start}{rpm} rpm");
            replay(&mut master, frames("stop: ")?)?;
            repeat(&mut master, rest, 0.3)?;
            let rpm = master.rpm();
            ensure!((30.0..290.0).contains(&rpm), "{title}: {rpm} rpm after the stop");
        }
        repeat(&mut master, rest, 4.0)?;
        ensure!(!master.outputs_on(), "{title}: not off");
        // Off, at standstill, the bus in command; and no fault.
        ensure!(master.read(0x2100, 2)? == [0, 0x2500], "{title}");
        ensure!(master.board.resets.is_empty(), "{title}");
        replayed += 1;
    }
    ensure!(replayed == 5, "{replayed}");
    Ok(())
}

/// The answer begins within the bound after the request, its bytes have no gap that ends a frame, and the line is free
/// again after it.
#[test]
fn the_answer_comes_at_once_and_in_one_piece() -> Result<()> {
    let mut master = Master::new(&[])?;
    let request = framed(&[1, 3, 0x21, 0, 0, 13]);
    for _ in 0..20 {
        let byte_s = master.board.chip().usart3.byte() as f64 / 170e6;
        let end = master.board.time() + byte_s * request.len() as f64;
        master.board.send_bus(&request);
        master.board.run_periods(ANSWERED)?;
        let sent = std::mem::take(&mut master.board.chip().usart3.line.from_chip);
        let times: Vec<_> = sent.iter().map(|(ticks, _)| *ticks as f64 / 170e6).collect();
        assert_eq!(sent.len(), 5 + 26);
        assert!((end..end + LATEST_S).contains(&times[0]), "{} s behind", times[0] - end);
        // 1.5 characters.
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] < 2.5 * byte_s));
        // PC12.
        let driver = master.board.chip().gpio[2].pad(12);
        assert_eq!(driver, stm32g4_unicorn::periph::gpio::Pad::Output(false));
    }
    Ok(())
}

/// Rate, format and address are settings; frames with another parity are ignored.
#[test]
fn rate_format_and_address_follow_the_settings() -> Result<()> {
    let mut master = Master::new(&["set bus.address 9 bus.baud 115200 bus.parity 8n2", "apply"])?;
    // 11 bits.
    assert_eq!(master.board.chip().usart3.byte(), 11 * 1476);
    let request = framed(&[9, 3, 0x20, 0, 0, 1]);
    assert_eq!(master.send(&request)?, framed(&[9, 3, 2, 0, 1]));
    assert!(master.ask(&[3, 0x20, 0, 0, 1]).is_err(), "address 1");
    let mut master = Master::new(&[])?;
    let chip = master.board.chip();
    let request: Vec<_> = framed(&[1, 3, 0x20, 0, 0, 1]).into_iter().map(u16::from).collect();
    chip.usart3.line.to_chip.extend(&request);
    chip.usart3.line.to_chip[3] |= stm32g4_unicorn::periph::uart::WRONG_PARITY;
    chip.usart3.wake(chip.now);
    assert!(master.send(&[])?.is_empty());
    // The next frame is accepted.
    assert_eq!(master.read(COMMAND, 1)?, [1]);
    Ok(())
}

/// Writes of a master that was set up with the image of version 0.1.0: addresses, and values that are not the default.
const WRITTEN: [(u16, f32); 7] = [
    (0x400c, 0.013),
    (0x4084, 3.2),
    (0x40a4, 40.0),
    (0x40ac, 1500.0),
    (0x40ae, 600.0),
    (0x40ca, 0.5),
    (0x40ce, 0.0),
];

/// This image, or one with other names and more settings, has each setting of this program at its number, with the
/// saved value. It accepts all writes of an older master, keeps them over a reset, and runs.
#[test]
fn a_master_that_was_set_up_before_needs_no_other_numbers() -> Result<()> {
    let mut config = Config::default();
    // Saved by this program, under their numbers.
    (config.drive.motor.r_s, config.drive.inertia) = (5.5, Some(0.011));
    config.drive.current_plant.d.k = Some(0.003);
    let options = options(&config);
    let saved = confirmed::settings(&options)?;
    let mut master = Master::with(options, &BUS)?;
    for key in keys::all() {
        let mut expected = to_float(key, &saved);
        if key.name() == "bus.commands" {
            expected = 1.0;
        }
        let found = master.float(0x4000 + 2 * key.id())?;
        assert_eq!(found.to_bits(), expected.to_bits(), "{} {found}", key.name());
    }
    for (at, value) in WRITTEN {
        let request = [&[16][..], &at.to_be_bytes(), &[0, 2, 4], &value.to_be_bytes()].concat();
        assert_eq!(master.ask(&request)?, request[..5], "{at:#x}");
    }
    assert_eq!(master.write(0x4fff, 2)?, None);
    // While the controllers are designed every request is answered with exception 6.
    let mut busy = 0;
    while master.ask(&[3, 0x40, 0, 0, 2])? == [0x83, 6] {
        busy += 1;
    }
    assert!((10..2000).contains(&busy), "{busy} times");
    master.board.run_periods(3000)?;
    assert_eq!(master.read(0x4fff, 1)?, [0], "nothing is staged");
    master.board.reset(stm32g4_unicorn::periph::Reset::Pin);
    until_said(&mut master.board, "last run")?;
    for (at, value) in WRITTEN {
        assert_eq!(master.float(at)?, value, "{at:#x}");
    }
    let head = master.read(0x5000, 3)?;
    assert_eq!(head, [1, 0x669f, 0xb378]);
    assert_eq!(master.ask(&[16, 0x20, 0, 0, 2, 4, 0, 18, 0x01, 0xf4])?, [16, 0x20, 0, 0, 2]);
    master.run(4.5)?;
    let (rpm, shown) = (master.rpm(), f64::from(master.float(0x3004)?));
    assert!((rpm / 150.0 - 1.0).abs() < 0.03 && (shown / rpm - 1.0).abs() < 0.03, "{rpm} {shown}");
    assert_eq!(master.float(0x3024)?, 2.0, "it runs");
    Ok(())
}

/// The same with an image of changed sources: 20 settings inserted, five renamed. It builds the image, which takes minutes.
#[test]
#[ignore = "builds another image"]
fn the_bus_with_20_settings_inserted_and_five_renamed() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // Outside of this tree, whose configuration would otherwise apply as well.
    let tree = env::temp_dir().join("induction-drive-numbers");
    let mut copy = Command::new("git");
    copy.args(["checkout-index", "--all", "--force"]).current_dir(root);
    copy.arg(format!("--prefix={}/", tree.display()));
    ensure!(copy.status()?.success(), "a copy of the sources");
    let edit = |name: &str, edits: &[(&str, String)]| -> Result<()> {
        let mut text = fs::read_to_string(tree.join(name))?;
        for (old, new) in edits {
            ensure!(text.matches(old).count() == 1, "{name}: {old}");
            text = text.replace(old, new);
        }
        Ok(fs::write(tree.join(name), text)?)
    };
    // Three before all others of six groups, and two of the firmware.
    let mut id = 1000;
    let groups = [
        "Nameplate \"nameplate.\" [nameplate] {",
        "ObserverSettings \"observer.\" [observer] {",
        "Limits \"limits.\" [limits] {",
        "SpeedSettings \"speed.\" [speed] {",
        "BrakingSettings \"braking.\" [braking] {",
        "VoltsPerHertzMode \"vf.\" [vf] {",
    ];
    let mut edits = Vec::new();
    for group in groups {
        let mut text = group.to_owned();
        for _ in 0..3 {
            text +=
                &format!("\n/// inserted\ninserted_{id}: u8 = 1, {id}: whole().from_to(0.0, 9.0);");
            id += 1;
        }
        edits.push((group, text));
    }
    edits.push(("\"motor.r_s\"", "\"motor.stator_ohm\"".into()));
    edits.push(("\"motor.inertia\"", "\"shaft.inertia\"".into()));
    edits.push(("\"current_plant.d.k\"", "\"plant.gain_d\"".into()));
    edit("drive-core/settings/src/settings/list.rs", &edits)?;
    let inserted = |id| {
        format!(
            "entry!({id}: number(\"s\"), \"inserted_{id}\", [command] timeout_s: f32, \"inserted\").from_to(0.0, 1e4),\n"
        )
    };
    let first = "entry!(101: number";
    edit(
        "src/settings/own.rs",
        &[
            ("[Entry<Settings>; 9]", "[Entry<Settings>; 11]".into()),
            (first, inserted(id) + &inserted(id + 1) + first),
            ("\"command.timeout_s\"", "\"command.silence_s\"".into()),
            ("\"console.echo\"", "\"console.repeats\"".into()),
        ],
    )?;
    let mut build = Command::new(env!("CARGO"));
    build.args(["run", "-q", "-p", "xtask", "--", "firmware"]).current_dir(&tree);
    build.env("CARGO_TARGET_DIR", tree.join("target"));
    ensure!(build.status()?.success(), "the image of the changed sources");
    let mut tests = Command::new(env::current_exe()?);
    tests.args(["modbus::", "--nocapture"]).env("CARGO_TARGET_DIR", tree.join("target"));
    ensure!(
        tests.env_remove(ELF).status()?.success(),
        "the bus of the image of the changed sources"
    );
    Ok(())
}

/// Frames of noise, and requests with changed bits, among valid requests: no reset occurs, an invalid frame has no
/// effect, and a valid one is answered.
#[test]
fn three_thousand_frames_of_noise() -> Result<()> {
    let mut master = Master::new(&["set bus.commands bus bus.baud 115200", "save"])?;
    let mut seed = 19_u64;
    let mut random = move || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 32) as u32
    };
    let (mut answered, mut ignored) = (0, 0);
    for n in 0..3000 {
        let mut frame = match n % 3 {
            0 => (0..random() % 60).map(|_| random() as u8).collect(),
            1 => framed(&[1, 3, 0x21, 0, 0, 1]),
            // This request would start the drive.
            _ => framed(&[1, 6, 0x20, 0, 0, 18]),
        };
        if n % 3 == 2 || (n % 3 == 1 && random() % 2 == 0) {
            let place = random() as usize % frame.len();
            frame[place] ^= 1 << (random() % 8);
        }
        // Time for its bytes, a silence, and the longest answer.
        master.answered = ANSWERED_FAST / 2 + frame.len() as u64 * 3 / 5;
        let body = frame.len().saturating_sub(2);
        let valid = body > 1 && frame[0] == 1 && frame[body..] == crc(&frame[..body]);
        let answer = master.send(&frame)?;
        assert_eq!(answer.is_empty(), !valid, "{frame:x?} gave {answer:x?}");
        if valid {
            answered += 1
        } else {
            ignored += 1
        }
        assert!(!master.outputs_on(), "{frame:x?}");
    }
    master.answered = ANSWERED_FAST;
    assert!(answered > 400 && ignored > 2000 && master.board.resets.is_empty());
    assert_eq!(master.read(COMMAND, 3)?, [1, 0, 0]);
    assert_eq!(master.read(0x4fff, 1)?, [0]);
    Ok(())
}
