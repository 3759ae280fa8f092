//! The stream of the image: its rate, its losses, its cost, and the console beside it.

use crate::common;
use anyhow::{Context, Result, ensure};
use drive_core::State;
use drive_stream::{Frame, Piece, Splitter};
use virtual_board::Pair;

/// Number of control periods per second.
const SECOND: u64 = 6000;
/// Signals of the fastest stream that is guaranteed.
const EIGHT: &str = "phi_deg i_d_a i_q_a v_d_v v_q_v speed_rpm dc_link_v turns";

/// Lines and frames of a board.
#[derive(Default)]
struct Ear {
    splitter: Splitter,
    frames: Vec<Frame>,
    text: String,
    damaged: u32,
}

impl Ear {
    fn hear(&mut self, pair: &mut Pair) {
        let bytes = pair.board.chip().lpuart.line.take();
        for byte in bytes {
            match self.splitter.push(byte) {
                Piece::Nothing => {}
                Piece::Text(byte) => self.text.push(char::from(byte)),
                Piece::Frame(frame) => self.frames.push(frame),
                Piece::Damaged => self.damaged += 1,
            }
        }
    }

    /// Runs until a line has come, and returns it with the number of periods; `None` after a second.
    fn line(&mut self, pair: &mut Pair) -> Result<Option<(String, u64)>> {
        for period in 1..=SECOND {
            pair.run(1, |_, _| {})?;
            self.hear(pair);
            if let Some((line, rest)) = self.text.split_once('\n') {
                let line = line.trim().to_owned();
                self.text = rest.to_owned();
                return Ok(Some((line, period)));
            }
        }
        Ok(None)
    }

    fn ask(&mut self, pair: &mut Pair, line: &str) -> Result<(String, u64)> {
        pair.board.type_line(line);
        pair.shadow.type_line(line)?;
        self.line(pair)?.with_context(|| format!("no answer to {line:?}"))
    }

    /// Returns the number of frames that are missing according to the sequence numbers.
    fn missing(&self) -> u32 {
        let gaps = self.frames.windows(2);
        gaps.map(|two| u32::from(two[1].sequence.wrapping_sub(two[0].sequence)) - 1).sum()
    }
}

/// Returns a drive that regulates, at 2 Mbaud, with the fastest stream.
fn streaming(seed: u64) -> Result<(Pair, Ear)> {
    let mut pair = common::regulating(seed)?;
    pair.order("torque 1")?;
    pair.order("baud 2000000")?;
    let mut ear = Ear::default();
    let (answer, _) = ear.ask(&mut pair, &format!("stream {EIGHT} 2000"))?;
    ensure!(answer.starts_with("ok"), "{answer}");
    Ok((pair, ear))
}

/// The bounds are those that the console's page guarantees: 1 % dropped, each counted; answers within 20 ms.
#[test]
fn two_thousand_frames_a_second_of_eight_signals_and_a_console_that_answers() -> Result<()> {
    let (mut pair, mut ear) = streaming(1)?;
    ear.frames.clear();
    let mut slowest = 0;
    let began = pair.board.time();
    // A line ten times a second: one word, a long line, one that reaches the drive.
    for line in ["stream", "status", "torque 1.5", "get motor.r_s", "status", "torque 1"].repeat(4)
    {
        let (answer, periods) = ear.ask(&mut pair, line)?;
        ensure!(!answer.starts_with("error"), "{line}: {answer}");
        slowest = slowest.max(periods);
        pair.run(SECOND / 10 - periods, |_, _| {})?;
        ear.hear(&mut pair);
    }
    let seconds = pair.board.time() - began;
    let (received, missing) = (ear.frames.len(), ear.missing());
    let (answer, _) = ear.ask(&mut pair, "stream off")?;
    let slowest_ms = slowest as f64 / SECOND as f64 * 1e3;
    println!(
        "{:.0} frames/s, {missing} missing of {received}, slowest answer {slowest_ms:.1} ms; {answer}",
        received as f64 / seconds
    );
    ensure!(ear.damaged == 0, "{} damaged", ear.damaged);
    ensure!(received as f64 > 0.99 * 2000.0 * seconds, "{received} frames in {seconds} s");
    ensure!(f64::from(missing) < 0.01 * received as f64, "{missing} missing");
    ensure!(slowest_ms < 20.0, "an answer after {slowest_ms} ms");
    // The frames that the receiver misses are those that the firmware reports as dropped.
    let dropped = answer.split(", ").nth(2).and_then(|text| text.split(' ').next());
    ensure!(dropped.and_then(|text| text.parse().ok()) == Some(missing), "{answer}");
    // Three periods apart, except for those that waited for a report of the control.
    let steps: Vec<_> = ear.frames.windows(2).map(|two| two[1].period - two[0].period).collect();
    ensure!(steps.iter().all(|step| (2..=4).contains(step) || missing > 0), "{steps:?}");
    // The values are those of the drive: the current is regulated, the dc link is charged.
    let last = &ear.frames[ear.frames.len() - 1].values;
    ensure!((last[2] - 1.0).abs() < 0.3 && (last[6] - 311.0).abs() < 20.0, "{last:?}");
    Ok(())
}

/// A drive whose link breaks is stopped, the port is back at its first rate, and the stream has ended.
#[test]
fn a_lost_link_stops_the_drive_and_brings_the_rate_back() -> Result<()> {
    let (mut pair, mut ear) = streaming(2)?;
    let (answer, _) = ear.ask(&mut pair, &format!("stream {EIGHT} 1000 alive 0.4"))?;
    ensure!(answer.starts_with("ok"), "{answer}");
    // Empty lines are signs of life.
    for _ in 0..10 {
        pair.board.send(b"\n");
        pair.run(SECOND / 5, |_, _| {})?;
    }
    ensure!(pair.shadow.drive.state() == State::Torque, "{}", pair.shadow.drive.state());
    pair.board.send(b"\n");
    let began = pair.board.time();
    let stopped = loop {
        // The shadow does not know of the stop, so only the board runs.
        pair.board.run_periods(1)?;
        while pair.board.next_period().is_some() {}
        ear.hear(&mut pair);
        let passed = pair.board.time() - began;
        if ear.text.contains("stopped: no command for 0.4 s") {
            break passed;
        }
        ensure!(passed < 1.0, "not stopped");
    };
    println!("stopped {:.0} ms after the last sign of life", stopped * 1e3);
    ensure!(stopped < 0.5, "stopped after {stopped} s");
    pair.board.run_periods(2 * SECOND)?;
    while pair.board.next_period().is_some() {}
    ear.hear(&mut pair);
    ensure!(ear.text.contains("link: 115200 baud"), "{}", ear.text);
    let frames = ear.frames.len();
    pair.board.run_periods(SECOND)?;
    ear.hear(&mut pair);
    ensure!(ear.frames.len() == frames, "the stream goes on");
    ensure!(!pair.board.chip().tim1.outputs_on());
    Ok(())
}

/// Returns the longest control interrupt of a run with commands and a trace, and the latest start that the firmware reports, us.
fn longest(stream: bool) -> Result<(u32, f64)> {
    let (mut pair, mut ear) = streaming(4)?;
    if !stream {
        ear.ask(&mut pair, "stream off")?;
    }
    pair.board.longest = Default::default();
    // After every sample of the injection period, because these differ by more than a command with a stream does.
    for (n, line) in (0..30).zip(["torque 1.5", "torque -1", "torque 1"].into_iter().cycle()) {
        ear.ask(&mut pair, line)?;
        pair.run(SECOND / 20 + n % 10, |_, _| {})?;
    }
    for line in ["torque 1.5", "torque -1", "torque 1"] {
        ear.ask(&mut pair, line)?;
        // Every seventh period: some of them have a report as well, independent of the beginning of the trace.
        pair.board.type_line("trace 500 7");
        pair.run(SECOND / 2, |_, _| {})?;
        // The samples are printed as fast as the main loop gets to it: a second without a line is their end.
        let mut samples = 0;
        while ear.line(&mut pair)?.is_some() {
            samples += 1;
        }
        ensure!(samples > 500, "{samples} lines of the trace");
    }
    pair.board.send(b"\n");
    let (status, _) = ear.ask(&mut pair, "status")?;
    let latest = status.split("latest start ").nth(1).and_then(|text| text.split(' ').next());
    let latest = latest.and_then(|text| text.parse().ok()).with_context(|| status.clone())?;
    Ok((pair.board.longest.cycles, latest))
}

/// 100 cycles are 0.4 % of a period. A sample waits for a period without a report, which is longer than one with a sample.
#[test]
fn a_stream_makes_the_longest_control_interrupt_no_longer() -> Result<()> {
    let (without, _) = longest(false)?;
    let (with, latest_us) = longest(true)?;
    println!("{without} cycles without a stream, {with} with one; latest start {latest_us} us");
    ensure!(with <= without + 100, "{without} cycles without a stream, {with} with one");
    ensure!(latest_us < 1.0, "started {latest_us} us late");
    Ok(())
}
