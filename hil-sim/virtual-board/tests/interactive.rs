//! `cargo sim board`: a program talks to the drive through the pseudo-terminal, and the rotor follows the commands.

use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{ChildStdout, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::common::program::{Running, command, folder};
use drive_stream::client::UNASKED;
use hil_sim::Config;
use hil_sim::console::catalogue::Catalogue;
use hil_sim::console::link::Link;
use hil_sim::console::session::{Flow, Session};
use serde_json::Value;

/// Longest wait for an answer on a busy machine; an answer takes 20 ms of simulated time.
const ANSWER: Duration = Duration::from_secs(20);
/// Longest wait for a state: a start takes 2 s, a stop 1 s of simulated time.
const STATE: Duration = Duration::from_secs(40);

/// Returns the lines of a reader, with a limit to the wait for each.
fn lines(reader: impl std::io::Read + Send + 'static) -> Receiver<String> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(reader).lines() {
            let Ok(line) = line else { break };
            if send.send(line).is_err() {
                break;
            }
        }
    });
    receive
}

/// A program that talks to a running board as to a serial port.
struct Talk {
    board: Running,
    shown: BufReader<ChildStdout>,
    port: File,
    said: Receiver<String>,
}

/// Starts a board; returns the process, its output, and its port.
fn begin(mut command: Command) -> (Running, BufReader<ChildStdout>, File) {
    let board = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
    let mut board = Running(board);
    let mut shown = BufReader::new(board.0.stdout.take().unwrap());
    let mut first = String::new();
    shown.read_line(&mut first).unwrap();
    let path = first.trim().strip_prefix("console: ").expect(&first);
    let port = OpenOptions::new().read(true).write(true).open(path).expect(path);
    (board, shown, port)
}

impl Talk {
    fn new(command: Command) -> Self {
        let (board, shown, port) = begin(command);
        let said = lines(port.try_clone().unwrap());
        Self { board, shown, port, said }
    }

    fn next(&self) -> String {
        self.said.recv_timeout(ANSWER).expect("the console is silent")
    }

    fn say(&mut self, line: impl AsRef<[u8]>) -> String {
        self.port.write_all(line.as_ref()).unwrap();
        self.port.write_all(b"\n").unwrap();
        // An announcement may come first.
        let mut line = self.next();
        while line.starts_with(UNASKED) {
            line = self.next();
        }
        line.trim_end().to_owned()
    }

    fn until(&mut self, state: &str) {
        let began = Instant::now();
        loop {
            let status = self.say("status");
            if status.starts_with(state) {
                return;
            }
            assert!(began.elapsed() < STATE, "not {state}, but {status}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Returns all its output, after it has ended without an error.
    fn ended(mut self) -> String {
        let mut rest = String::new();
        std::io::Read::read_to_string(&mut self.shown, &mut rest).unwrap();
        assert_eq!(self.board.0.wait().unwrap().code(), Some(0), "{rest}");
        rest
    }
}

/// The recorded curves.
struct Report(Value);

impl Report {
    fn open(folder: &Path) -> Self {
        let json = std::fs::read(folder.join("board.json")).expect("a JSON object");
        Self(serde_json::from_slice(&json).expect("a JSON object"))
    }

    fn series(&self, name: &str) -> Vec<(f64, f64)> {
        let series = &self.0["series"][format!("session/{name}")];
        let numbers = |axis: &str| -> Vec<f64> {
            let values = series[axis].as_array().expect(name).iter();
            values.map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
        };
        numbers("x").into_iter().zip(numbers("y")).collect()
    }

    fn metric(&self, name: &str) -> f64 {
        self.0["metrics"][name].as_f64().expect(name)
    }
}

fn mean_within(series: &[(f64, f64)], from: f64, to: f64) -> f64 {
    let inside: Vec<f64> = series.iter().filter(|p| p.0 >= from && p.0 < to).map(|p| p.1).collect();
    assert!(!inside.is_empty(), "nothing from {from} s to {to} s");
    inside.iter().sum::<f64>() / inside.len() as f64
}

/// The host recognises the unsolicited lines of the firmware.
#[test]
fn host_and_firmware_mark_announcements_alike() {
    assert_eq!(UNASKED, induction_drive::console::line::UNASKED);
}

/// The session of the README, in real time, through the pseudo-terminal.
#[test]
fn a_program_talks_to_the_drive_and_the_motor_turns_torque_out() {
    let folder = folder("talk");
    let mut talk = Talk::new(command(&folder, &["--seed", "5", "--log", "info"]));
    assert!(talk.next().contains("last run: reset by power-on"));
    let mut help = vec![talk.say("help")];
    while help.last().is_some_and(|line| line != "ok") {
        help.push(talk.next().trim_end().to_owned());
    }
    assert!(help.len() > 15 && help.iter().any(|line| line.starts_with("torque A")), "{help:?}");
    assert!(talk.say("version").starts_with(env!("CARGO_PKG_VERSION")));
    assert!(talk.say("status").starts_with("off;"));
    assert!(talk.say("start").starts_with("ok"));
    talk.until("regulating torque");
    assert_eq!(talk.say("torque 1"), "ok");
    // 1.5 seconds of the board, on a machine that reaches a quarter of real time.
    std::thread::sleep(Duration::from_secs(6));
    // Garbage, half a command and a bad number change nothing.
    assert!(talk.say(b"\xff\x00stop\x07").starts_with("error:"));
    assert!(talk.say("torqu").starts_with("error:"));
    assert!(talk.say("torque nan").starts_with("error:"));
    let status = talk.say("status");
    assert!(status.starts_with("regulating torque;") && status.contains("of 1.00 A"), "{status}");
    assert_eq!(talk.say("stop"), "ok");
    talk.until("off;");
    talk.board.0.stdin.as_mut().unwrap().write_all(b"quit\n").unwrap();
    let shown = talk.ended();
    assert!(shown.contains("> torque 1\n") && shown.contains("# end: quit"), "{shown}");
    assert!(shown.contains("INFO"), "the log is shown: {shown}");

    let page = std::fs::read_to_string(folder.join("board.html")).unwrap();
    assert!(page.contains("<svg") && page.trim_end().ends_with("</html>"));
    for line in ["&gt; torque nan", "&lt; error: not a number", "\\xff\\x00stop\\x07"] {
        assert!(page.contains(line), "{line} is not in the page");
    }

    let report = Report::open(&folder);
    let torque = report.series("torque_nm");
    let outputs = report.series("outputs_on");
    let reference = report.series("quadrature_current_reference_a");
    // From half a second after the reference is reached, the values have settled.
    let level: Vec<f64> = reference.iter().filter(|p| p.1 > 0.95).map(|p| p.0).collect();
    let (from, to) = (level[0] + 0.5, level[level.len() - 1]);
    assert!(to - from > 1.0, "{from} {to}");
    let error = report.series("angle_error_true_minus_estimated_flux_angle_electrical_deg");
    assert!(error.iter().filter(|p| p.0 > from && p.0 < to).all(|p| p.1.abs() < 15.0));
    // 3/2 P L_m/L_r psi i_q (Eq. 4.4 for a true angle); 15 degrees of error are 4 % of it, in addition to a part of the
    // d-axis current.
    let config = Config::default();
    let m = &config.motor;
    let flux = mean_within(&report.series("rotor_flux_wb"), from, to);
    let expected = 1.5 * f64::from(m.pole_pairs) * m.l_m / (m.l_m + m.l_lr) * flux * 1.0;
    let seen = mean_within(&torque, from, to);
    assert!((seen / expected - 1.0).abs() < 0.1, "{seen} {expected}");
    // Off at both ends, without torque.
    for (series, largest) in [(&outputs, 0.0), (&torque, 0.01)] {
        assert!(series[0].1.abs() <= largest && series[series.len() - 1].1.abs() <= largest);
    }
    assert!((mean_within(&outputs, from, to) - 1.0).abs() < 1e-9);
    assert_eq!(report.metric("resets"), 0.0);
}

/// A free shaft: the speed of the rotor follows from the torque (J dw/dt = T - B w). The same seed gives the same
/// session, to the last digit.
#[test]
fn a_script_turns_a_free_shaft_and_repeats_to_the_bit() {
    let script = "# a pulse of torque\n\
                  [1.8 s]\n\
                  > start\n\
                  [until: running: torque]\n\
                  [200 ms]\n\
                  > torque 0.5\n\
                  [300 ms]\n\
                  > torque 0\n\
                  [500 ms]\n\
                  > status\n";
    let runs = ["once", "twice"].map(|name| {
        let folder = folder(name);
        let file = folder.join("script.txt");
        std::fs::write(&file, script).unwrap();
        let mut command = command(&folder, &["--fast", "--load", "free", "--script"]);
        let output = command.arg(&file).stdin(Stdio::null()).output().unwrap();
        let shown = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{shown}");
        assert!(shown.contains("< regulating torque;") && shown.contains("# end: of the script"));
        Report::open(&folder)
    });
    assert!(runs[0].0 == runs[1].0, "two runs with one seed differ");

    let torque = runs[0].series("torque_nm");
    let speed = runs[0].series("speed_rotor_rpm");
    let config = Config::default();
    let (inertia, friction) = (config.motor.inertia, config.motor.friction);
    let mut expected = 0.0;
    for (pair, w) in torque.windows(2).zip(&speed) {
        let (seconds, w) = (pair[1].0 - pair[0].0, w.1.to_radians() * 6.0);
        expected += (pair[0].1 - friction * w) / inertia * seconds;
    }
    let end = speed[speed.len() - 1].1.to_radians() * 6.0;
    // The curves are means of ten periods; the remaining error is that of the rectangle rule.
    assert!(end > 3.0 && (end / expected - 1.0).abs() < 0.02, "{end} {expected}");
}

/// Ctrl-C ends the session without an error, with the page; a held speed is held.
#[test]
fn an_interrupt_still_writes_the_page() {
    let folder = folder("interrupt");
    let talk = Talk::new(command(&folder, &["--load", "speed", "-150", "--seconds", "60"]));
    talk.next();
    let pid = talk.board.0.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert!(talk.ended().contains("# end: interrupted"));
    let report = Report::open(&folder);
    assert!(report.series("speed_rotor_rpm").iter().all(|p| (p.1 + 150.0).abs() < 1e-6));
    assert!(report.series("outputs_on").iter().all(|p| p.1 == 0.0));
    assert!(folder.join("board.html").exists() && folder.join("board-session.svg").exists());
}

fn refused(output: &Output, code: i32, parts: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(output.stdout.is_empty(), "nothing is begun");
    for part in parts {
        assert!(said.contains(part), "{part} is not in {said}");
    }
}

#[test]
fn what_is_wrong_is_named_before_anything_begins() {
    let folder = folder("wrong");
    let run = |arguments: &[&str]| command(&folder, arguments).output().unwrap();
    refused(&run(&["--elf", "no/such.elf"]), 2, &["no/such.elf", "No such file"]);
    refused(&run(&["--elf", "Cargo.toml"]), 2, &["Cargo.toml"]);
    refused(&run(&["--load", "speed"]), 2, &["--load speed RPM"]);
    refused(&run(&["--load", "speed", "1e9"]), 2, &["load.speed_rpm = 1000000000", "allowed"]);
    refused(&run(&["--load", "heavy"]), 2, &["load.mode = heavy", "locked, free, speed"]);
    refused(&run(&["--load", "free", "3"]), 2, &["only speed takes a number"]);
    refused(&run(&["--seconds", "-1"]), 2, &["seconds = -1", "0.001 to 3600 s"]);
    refused(&run(&["--script", "none.txt"]), 2, &["none.txt"]);
    std::fs::write(folder.join("none.bin"), "nothing").unwrap();
    let flash = folder.join("none.bin").display().to_string();
    refused(&run(&["--flash", &flash]), 2, &["none.bin", "7 bytes", "66576"]);
    refused(&run(&["--lenient"]), 2, &["--script"]);
    refused(&run(&["--log", "loud"]), 2, &["loud", "warn"]);
    let script = folder.join("bad.txt");
    std::fs::write(&script, "> start\n[soon]\n").unwrap();
    let script = script.display().to_string();
    refused(&run(&["--script", &script]), 2, &["line 2", "[soon]", "no such command"]);
    assert!(std::fs::read_dir(&folder).unwrap().count() == 2, "no page is written");

    // The limit allows reading the ELF, but not opening both ends of a pseudo-terminal. It also holds if a terminal
    // passes descriptors on: one more below the limit would leave none for the ELF.
    let limited = "exec 3>&-; ulimit -n 4; exec \"$0\"";
    for inherited in ["", "exec 3</dev/null 7</dev/null; "] {
        let script = format!("{inherited}exec sh -c '{limited}' \"$0\"");
        let output = Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_board")]).output();
        refused(&output.unwrap(), 1, &["pseudo-terminal"]);
    }
}

/// `cargo sim console` finds the commands and settings of the image, restores a file and plots a trace.
#[test]
fn the_console_program_understands_the_image() {
    let folder = folder("console");
    let (_board, _shown, port) = begin(command(&folder, &[]));
    let (say, unasked) = channel();
    let show = move |line: &str| drop(say.send(line.to_owned()));
    let link = Link::new(port.try_clone().unwrap(), port, show);
    // A line that comes before the greeting is lost.
    assert!(unasked.recv_timeout(ANSWER).unwrap().contains("last run"));
    let mut session = Session::new(link);
    let catalogue = Catalogue::read(&mut session.link).unwrap();
    assert!(catalogue.settings() > 50);
    for (line, word) in [("rel", "relock"), ("set motor.r_", "motor.r_s"), ("log w", "warn")] {
        assert!(catalogue.complete(line).1.iter().any(|found| found == word), "{line}");
    }
    let file = folder.join("settings.txt").display().to_string();
    let restore = format!("!restore {file}");
    let lines = "set command.timeout_s soon\nset command.timeout_s 77\napply\n";
    std::fs::write(&file, lines).unwrap();
    let why = session.enter(&restore, |_| ()).unwrap_err().to_string();
    assert!(why.contains("settings.txt, line 1: `set command.timeout_s soon`: error:"), "{why}");
    let Flow::Refused(why) = session.enter("start vf", |_| ()).unwrap() else { panic!("a start") };
    assert!(why.contains("lines of the backup that were refused: 1; `apply rest`"), "{why}");
    assert_eq!(session.enter("apply rest", |_| ()).unwrap(), Flow::Next);
    let mut said = Vec::new();
    session.enter("get command.timeout_s", |line| said.push(line.to_owned())).unwrap();
    assert!(said[0].starts_with("command.timeout_s = 77"), "{said:?}");
    let plot = folder.join("trace.svg");
    assert_eq!(session.enter("trace 20 2 i_q_a dc_link_v", |_| ()).unwrap(), Flow::Next);
    session.enter(&format!("!plot {}", plot.display()), |line| said.push(line.to_owned())).unwrap();
    assert!(said[1].starts_with("20 records in") && plot.exists(), "{said:?}");
}
