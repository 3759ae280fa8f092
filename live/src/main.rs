//! `cargo live`: see the library.

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use clap::Parser;
use drive_live::board::VirtualBoard;
use drive_live::shared::Shared;
use drive_live::{drive, server};
use hil_sim::console::{self, link::Link};
use tokio::net::TcpListener;

/// A local web page for the drive: live curves, control, settings, traces, commissioning. Without --port it starts the
/// virtual board
#[derive(Parser)]
#[command(bin_name = "cargo live")]
struct Arguments {
    /// Serial port of a board: /dev/ttyACM0, COM3
    #[arg(long, value_name = "PATH")]
    port: Option<String>,
    /// Bits per second that the drive and the port are switched to, 115200 to 2000000
    #[arg(long, value_name = "N", default_value_t = 2_000_000)]
    #[arg(value_parser = clap::value_parser!(u32).range(i64::from(USUAL_BAUD)..=2_000_000))]
    baud: u32,
    /// TCP port of the page at 127.0.0.1; 0 selects a free port
    #[arg(long, value_name = "N", default_value_t = 0)]
    listen: u16,
    /// Prints the address and opens no browser
    #[arg(long)]
    no_browser: bool,
    /// A simulated motor and the firmware's drive in this program, instead of the virtual board: no emulator, no pseudo-terminals. It is
    /// the default on systems without pseudo-terminals
    #[arg(long)]
    simulated: bool,
    /// Seed of the simulated noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Options of the virtual board, as for `cargo sim board`
    #[arg(last = true, value_name = "OPTION")]
    board: Vec<String>,
}

/// Bits per second of a drive that was reset, or that has received nothing for a second.
const USUAL_BAUD: u32 = 115_200;
/// Time after which a drive that was left at another rate is back at the usual one.
const FALLEN_BACK: Duration = Duration::from_millis(1200);
/// Time after the answer to `baud` by which the drive has changed its rate.
const CHANGED: Duration = Duration::from_millis(30);
/// Time for the last lines to leave and for the drive to answer.
const FAREWELL: Duration = Duration::from_millis(100);

#[tokio::main]
async fn main() -> ExitCode {
    match run(Arguments::parse()).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}", hil_sim::error::message(format_args!("error: {error:#}")));
            ExitCode::from(2)
        }
    }
}

async fn run(arguments: Arguments) -> Result<()> {
    if (arguments.port.is_some() || arguments.simulated) && !arguments.board.is_empty() {
        bail!("options behind `--` are those of the virtual board: not with --port or --simulated");
    }
    let address = ("127.0.0.1", arguments.listen);
    let listener = TcpListener::bind(address).await;
    let listener = listener.with_context(|| format!("--listen {}: 127.0.0.1", arguments.listen))?;
    let shared = Shared::new();
    let own = arguments.port.is_none();
    let simulated = own && (arguments.simulated || cfg!(not(unix)));
    let emulated = own && !simulated;
    let board = emulated.then(|| VirtualBoard::start(&arguments.board, &shared)).transpose()?;
    let port = arguments.port.or_else(|| board.as_ref().map(|board| board.port.clone()));
    let port = port.unwrap_or_else(|| "a simulated motor".to_owned());
    let (baud, real, seed) = (arguments.baud, !own, arguments.seed);
    let used = port.clone();
    let worker = shared.clone();
    std::thread::spawn(move || {
        drive::run(&worker, |shared| match simulated {
            true => drive_live::simulated::connect(shared, seed),
            false => connect(shared, &used, baud, real),
        });
    });
    let watcher = shared.clone();
    std::thread::spawn(move || drive::watch(&watcher));

    let token = server::token().context("no random numbers")?;
    let url = format!("http://127.0.0.1:{}/?token={token}", listener.local_addr()?.port());
    println!("drive at {port}\npage: {url}\nCtrl-C ends it and stops the drive");
    if !arguments.no_browser
        && let Err(why) = open::that_detached(&url)
    {
        eprintln!("no browser opens ({why}): open the address yourself");
    }
    tokio::select! {
        served = server::serve(listener, token, shared.clone()) => served?,
        signal = tokio::signal::ctrl_c() => signal?,
    }
    for line in ["stop", "stream off", "baud 115200"] {
        shared.send(line);
    }
    std::thread::sleep(FAREWELL);
    drop(board);
    Ok(())
}

/// Opens the port and switches the drive to a higher rate, if it knows one.
fn connect(shared: &Arc<Shared>, port: &str, baud: u32, real: bool) -> Result<Link, String> {
    let (reader, writer) = console::open(port, USUAL_BAUD).map_err(|why| why.to_string())?;
    let mut own = writer.try_clone().map_err(|why| why.to_string())?;
    if real {
        std::thread::sleep(FALLEN_BACK);
    }
    let (lines, frames) = (shared.clone(), shared.clone());
    let show = move |line: &str| lines.tell(serde_json::json!({ "line": line }));
    let mut link = Link::with_frames(reader, writer, show, move |frame| frames.frame(frame));
    if baud != USUAL_BAUD {
        link.begin();
        let answer = link.ask(&format!("baud {baud}"), |_| ()).map_err(|why| why.to_string())?;
        // Firmware that does not know the command keeps its rate.
        if answer.error().is_none() {
            std::thread::sleep(CHANGED);
            own.set_baud_rate(baud).map_err(|why| format!("{port}: {baud} baud: {why}"))?;
        }
    }
    Ok(link)
}
