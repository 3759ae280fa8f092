//! Third-party programs, unmodified, start, run, read and stop the drive over the bus of the virtual board. `cargo
//! xtask bus` gets them and runs this.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use std::{fs, thread};

use anyhow::{Context, Result, ensure};

use crate::common::program::{command, folder};

/// Commanded frequency: 5 Hz, 150 rpm with two pole pairs; and the tolerance of the speed, rpm, that a sensorless drive reaches.
const HUNDREDTHS: &str = "500";
const RPM: (f64, f64) = (150.0, 8.0);
/// Time to magnetise, to run up and to settle, also on a machine on which the board takes twice its time.
const RUN_UP: Duration = Duration::from_millis(8000);
/// The longest wait for a line of the board.
const PATIENCE: Duration = Duration::from_secs(60);

/// The virtual board in real time, commanded by its bus.
struct Board {
    child: Child,
    lines: Receiver<String>,
    bus: String,
}

impl Board {
    fn start(out: &Path) -> Result<Self> {
        let load = ["--set", "load.mode=free", "--set", "injection.allow_unlearned=yes"];
        let mut child = command(out, &load).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let (send, lines) = channel();
        let out = child.stdout.take().context("no output")?;
        thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                if send.send(line).is_err() {
                    break;
                }
            }
        });
        let mut board = Self { child, lines, bus: String::new() };
        let bus = board.until("bus: ")?;
        board.bus = bus.trim_start_matches("bus: ").to_owned();
        board.until("last run")?;
        for line in ["set bus.commands bus command.timeout_s 2", "save"] {
            writeln!(board.child.stdin.as_mut().context("no input")?, "{line}")?;
            board.until("< ok")?;
        }
        Ok(board)
    }

    /// Returns the next line with this text.
    fn until(&mut self, text: &str) -> Result<String> {
        loop {
            let line = self.lines.recv_timeout(PATIENCE);
            let line = line.with_context(|| format!("the board does not say {text:?}"))?;
            if line.contains(text) {
                return Ok(line);
            }
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if let Some(mut input) = self.child.stdin.take() {
            let _ = writeln!(input, "!quit");
        }
        let _ = self.child.wait();
    }
}

#[test]
#[ignore = "its clients are programs of others; cargo xtask bus runs it"]
fn clients_start_run_read_and_stop_the_drive() -> Result<()> {
    let folder = folder("bus-clients");
    let mut board = Board::start(&folder)?;
    type Client = fn(&str, &Path) -> Result<f64>;
    let clients: [(&str, Client); 3] =
        [("mbpoll", mbpoll), ("pymodbus", pymodbus), ("vfdb_vfd", vfdb_vfd)];
    for (name, client) in clients {
        let rpm = client(&board.bus, &folder).context(name)?;
        board.until("running: speed").context(name)?;
        board.until("off: stopped").context(name)?;
        println!("    {name}: started, {rpm} rpm, stopped");
        ensure!((rpm - RPM.0).abs() < RPM.1, "{name}: {rpm} rpm");
    }
    Ok(())
}

/// Returns the output of a command that must succeed.
fn said(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("cannot run: {command:?}"))?;
    let [text, errors] = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    ensure!(output.status.success(), "{}: {text}{errors}\n    {command:?}", output.status);
    Ok(text)
}

fn python() -> Command {
    let mut command = Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()));
    command.arg("-c");
    command
}

fn mbpoll(bus: &str, _: &Path) -> Result<f64> {
    let ask = |options: &[&str], words: &[&str]| -> Result<String> {
        let mut command = Command::new("mbpoll");
        command.args(["-m", "rtu", "-b", "19200", "-P", "even", "-a", "1", "-0", "-t", "4", "-1"]);
        said(command.args(options).arg(bus).arg("--").args(words))
    };
    ask(&["-r", "8192"], &["1"])?;
    // The drive stops if nothing is written for two seconds; reads do not count.
    for _ in 0..RUN_UP.as_millis() / 500 {
        ask(&["-r", "8192"], &["18", HUNDREDTHS])?;
        thread::sleep(Duration::from_millis(500));
        ask(&["-r", "8449"], &[])?;
    }
    let said = ask(&["-r", "8460"], &[])?;
    let rpm = said.lines().find_map(|line| line.strip_prefix("[8460]:"));
    let rpm = rpm.with_context(|| said.clone())?.trim().parse()?;
    ask(&["-r", "8192"], &["1"])?;
    Ok(rpm)
}

/// A pseudo-terminal has no parity.
const PYMODBUS: &str = r#"
import sys, time
from pymodbus.client import ModbusSerialClient
client = ModbusSerialClient(sys.argv[1], baudrate=19200, timeout=1)
assert client.connect()
def write(at, word):
    assert not client.write_register(at, word, device_id=1).isError()
write(0x2000, 1); write(0x2001, int(sys.argv[2]))
for _ in range(int(float(sys.argv[3]) / 0.25)):
    write(0x2000, 18)
    time.sleep(0.25)
    page = client.read_holding_registers(0x2100, count=13, device_id=1).registers
write(0x2000, 1)
print(page[12])
"#;

fn pymodbus(bus: &str, _: &Path) -> Result<f64> {
    let seconds = RUN_UP.as_secs_f64().to_string();
    Ok(said(python().arg(PYMODBUS).args([bus, HUNDREDTHS, &seconds]))?.parse()?)
}

fn vfdb_vfd(bus: &str, folder: &Path) -> Result<f64> {
    let ini = folder.join("vfd.ini");
    let settings = "TYPE=rtu\nBAUD=19200\nBITS=8\nPARITY=even\nSTOPBITS=1\nTARGET=1";
    fs::write(&ini, format!("[VFD]\nDEVICE={bus}\n{settings}\n"))?;
    let halcmd = |arguments: &[&str]| said(Command::new("halcmd").args(arguments));
    let mut component = Command::new("vfdb_vfd");
    component.args(["-n", "vfd", "-S", "VFD", "-I"]).arg(&ini);
    let mut component = component.stdout(Stdio::null()).spawn()?;
    let session = || -> Result<f64> {
        thread::sleep(Duration::from_secs(1));
        for (name, value) in [
            ("nameplate-HZ", "50"),
            ("nameplate-RPM", "1500"),
            ("loop-time", "0.1"),
            ("speed-command", "150"),
            ("spindle-on", "1"),
            ("enable", "1"),
        ] {
            halcmd(&["setp", &format!("vfd.{name}"), value])?;
        }
        thread::sleep(RUN_UP);
        let pin = |name: &str| halcmd(&["-s", "getp", &format!("vfd.{name}")]);
        let (rpm, ok, errors) = (pin("motor-RPM")?, pin("modbus-ok")?, pin("error-count")?);
        ensure!(ok == "TRUE" && errors == "0", "modbus-ok {ok}, error-count {errors}");
        halcmd(&["setp", "vfd.enable", "0"])?;
        thread::sleep(Duration::from_secs(1));
        Ok(rpm.parse()?)
    };
    let rpm = session();
    // It is asked to end, so that it releases its name in the HAL.
    let _ = said(Command::new("kill").arg(component.id().to_string()));
    component.wait()?;
    rpm
}
