//! The stream of the image: its rate, its losses, its cost, and the console beside it.

use crate::common;
use crate::common::pair::Pair;
use anyhow::{Context, Result, bail, ensure};
use drive_core::State;
use drive_stream::Frame;
use drive_stream::client::{Answer, Client, Event};

/// Number of control periods per second.
const SECOND: u64 = 6000;
/// Signals of the fastest stream that is guaranteed.
const EIGHT: &str = "phi_deg i_d_a i_q_a v_d_v v_q_v speed_rpm dc_link_v turns";

/// Frames and unsolicited lines of a board.
#[derive(Default)]
struct Ear {
    client: Client,
    frames: Vec<Frame>,
    told: String,
    damaged: u32,
}

impl Ear {
    /// Takes what the board has sent; returns the number of lines of the awaited answer that are among it, and the answer if it is whole.
    fn hear(&mut self, pair: &mut Pair) -> (usize, Option<Answer>) {
        let (mut lines, mut whole) = (0, None);
        for byte in pair.board.chip().lpuart.line.take() {
            match self.client.push(byte) {
                None => {}
                Some(Event::Frame(Some(frame))) => self.frames.push(frame),
                Some(Event::Frame(None)) => self.damaged += 1,
                Some(Event::Line(_)) => lines += 1,
                Some(Event::Answer(answer)) => whole = Some(answer),
                Some(Event::Unasked(line) | Event::Cut(line)) => self.told += &line,
            }
        }
        (lines, whole)
    }

    /// Returns the answer to a line, and the number of periods until it was whole. No line of it may take a second.
    fn ask(&mut self, pair: &mut Pair, line: &str) -> Result<(Answer, u64)> {
        pair.board.send(self.client.ask(line).as_bytes());
        pair.shadow.type_line(line);
        let (mut periods, mut silence) = (0, 0);
        while silence < SECOND {
            pair.run(1, |_, _| {})?;
            (periods, silence) = (periods + 1, silence + 1);
            match self.hear(pair) {
                (_, Some(answer)) => return Ok((answer, periods)),
                (0, None) => {}
                _ => silence = 0,
            }
        }
        bail!("no answer to {line:?}")
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
    ensure!(answer.error().is_none(), "{answer:?}");
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
        ensure!(answer.error().is_none(), "{line}: {answer:?}");
        slowest = slowest.max(periods);
        pair.run(SECOND / 10 - periods, |_, _| {})?;
        ear.hear(&mut pair);
    }
    let seconds = pair.board.time() - began;
    let (received, missing) = (ear.frames.len(), ear.missing());
    let (answer, _) = ear.ask(&mut pair, "stream off")?;
    let answer = answer.last();
    let slowest_ms = slowest as f64 / SECOND as f64 * 1e3;
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
    ensure!(answer.error().is_none(), "{answer:?}");
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
        if ear.told.contains("stopped: no command for 0.4 s") {
            break passed;
        }
        ensure!(passed < 1.0, "not stopped");
    };
    ensure!(stopped < 0.5, "stopped after {stopped} s");
    pair.board.run_periods(2 * SECOND)?;
    while pair.board.next_period().is_some() {}
    ear.hear(&mut pair);
    ensure!(ear.told.contains("link: 115200 baud"), "{}", ear.told);
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
        let (trace, _) = ear.ask(&mut pair, "trace 500 7")?;
        ensure!(trace.contents().len() > 500, "{} lines of the trace", trace.lines.len());
    }
    let (status, _) = ear.ask(&mut pair, "status")?;
    let latest = status.last().split("latest start ").nth(1);
    let latest = latest.and_then(|text| text.split(' ').next()?.parse().ok());
    let latest = latest.with_context(|| format!("{status:?}"))?;
    Ok((pair.board.longest.cycles, latest))
}

/// 100 cycles are 0.4 % of a period. A sample waits for a period without a report, which is longer than one with a sample.
#[test]
fn a_stream_makes_the_longest_control_interrupt_no_longer() -> Result<()> {
    let (without, _) = longest(false)?;
    let (with, latest_us) = longest(true)?;
    ensure!(with <= without + 100, "{without} cycles without a stream, {with} with one");
    ensure!(latest_us < 1.0, "started {latest_us} us late");
    Ok(())
}
