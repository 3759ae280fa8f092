//! The virtual board for people and scripts; `cargo sim board` starts it.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};

use anyhow::{Result, anyhow};
use clap::Parser;
use hil_sim::first_light::interruptible;
use hil_sim::report::{self, Section};
use hil_sim::{Config, Error};
use hil_sim::{board::Options, outcome::Origin};
use virtual_board::interactive::flash_file::FlashFile;
use virtual_board::interactive::page;
use virtual_board::interactive::pty::Pty;
use virtual_board::interactive::script::Script;
use virtual_board::interactive::session::{Inputs, Session};
use virtual_board::{Board, Image, PowerStage};

/// Runs the firmware's image on an emulated board, with a simulated motor and a serial port.
#[derive(Parser)]
#[command(name = "board")]
struct Arguments {
    #[command(flatten)]
    options: Options,
}

fn main() -> ExitCode {
    match run(Arguments::parse().options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(error.downcast_ref().map_or(1, Error::exit_code))
        }
    }
}

fn run(mut options: Options) -> Result<()> {
    // Everything that can be refused is checked before the session begins.
    let stage = PowerStage::named(&options.board)?;
    stage.suit(&mut options.input);
    let options = &options;
    let config = options.config()?;
    let script = options.script.as_deref().map(|path| Script::open(path, !options.lenient));
    let script = script.transpose()?;
    let image = image(stage, options.elf.as_deref())?;
    let (pty, bus) = (Pty::open()?, Pty::open()?);
    let stop = interruptible()?;
    let mut board =
        Board::new(image, virtual_board::Options::on(stage, &config, options.input.seed))?;
    let kept = options.flash.as_deref().is_some_and(Path::exists);
    let flash = options.flash.as_deref().map(|path| FlashFile::open(path, &mut board.chip().flash));
    let flash = flash.transpose()?;

    let port = pty.path.display();
    say(&format!("console: {port}"));
    say(&format!("bus: {}", bus.path.display()));
    say(&format!(
        "type `cargo sim console --port {port}` elsewhere, or commands here; !help lists the board's own"
    ));
    if !kept && config.drive.injection.synchronous.allow_unlearned {
        say(
            "Its flash begins with `injection.allow_unlearned yes`: the drive starts before it has learned. `defaults` reverts that.",
        );
    }
    let set_lines = virtual_board::Options::set_lines(stage, &config);
    if !set_lines.is_empty() {
        say(
            "The image needs other settings for this motor and its sensors. With the drive off, before `save`:",
        );
        set_lines.iter().for_each(|line| say(&format!("    {line}")));
        // Scales belong to the hardware.
        ["apply", "confirm board"].into_iter().for_each(|line| say(&format!("    {line}")));
    }
    let inputs = Inputs {
        terminal: typed_lines(options.attached.then(|| stop.clone())),
        stop,
        script,
        seconds: config.extent.seconds,
        paced: !options.fast,
        flash,
        log: options.log,
        flux: options.attached,
        show: |line| say(&line.to_string()),
    };
    let mut session = Session::new(board, pty, bus, inputs);
    let end = session.run();
    let path = write(options, &config, &session)?;
    say(&format!("Report: {}", path.display()));
    end
}

fn image(stage: &PowerStage, elf: Option<&Path>) -> Result<Image> {
    let image = match elf {
        Some(path) => Image::open(path),
        None => Image::built_for(stage.name),
    };
    image.map_err(|why| Error::Refused(format!("the firmware's ELF: {why:#}")).into())
}

/// Reads lines typed at the terminal in a separate thread. The end of the input sets `stop`, if there is one.
fn typed_lines(stop: Option<Arc<AtomicBool>>) -> Receiver<String> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lines() {
            let Ok(line) = line else { break };
            if send.send(line).is_err() {
                break;
            }
        }
        stop.into_iter().for_each(|stop| stop.store(true, Ordering::Relaxed));
    });
    receive
}

/// Writes the page, its plots and the JSON object; returns the path of the page.
fn write(options: &Options, config: &Config, session: &Session) -> Result<PathBuf> {
    let mut outcome = page::outcome(config, session);
    if session.behind_s > 0.0 {
        let behind = format!("The board fell behind the clock by {:.1} s.", session.behind_s);
        outcome.remarks.insert(0, behind);
    }
    let section = Section {
        name: page::NAME,
        stands_for: "virtual board",
        about: page::ABOUT,
        command: options.command(config),
        open: true,
        outcome: &outcome,
    };
    let origin = Origin::new(options.input.seed, &config.changes());
    let path = report::write(&options.out, &origin, section)?;
    let json = outcome.to_json(page::NAME, &origin).map_err(|e| anyhow!("{e}"))?;
    report::write_whole(&options.out.join(format!("{}.json", page::NAME)), &json)?;
    Ok(path)
}

/// Prints a line on standard output. A reader that has gone away does not stop the program.
fn say(line: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}
