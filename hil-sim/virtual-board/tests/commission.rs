//! The image commissions its motor: random machines and boards, at the console.

use anyhow::{Context as _, Result, bail};
use hil_sim::Config;
use hil_sim::experiments::drawn_machine::{Circuit, drawn};
use virtual_board::{Board, Image, Options};

/// Number of machines, unless the environment variable `MACHINES` sets another.
const MACHINES: u64 = 2;
/// Longest duration of a commissioning or a saliency self-commissioning, control periods: 100 s.
const LONGEST: u64 = 600_000;

/// A board and its output.
struct Console {
    board: Board,
    said: String,
}

impl Console {
    fn new(config: &Config, seed: u64) -> Result<Self> {
        let mut options = Options::new(config, seed);
        options.counting.cycles = false;
        let mut console =
            Self { board: Board::new(Image::built()?, options)?, said: String::new() };
        console.until("last run")?;
        // No action at the start masks the interrupts for long.
        console.board.run_periods(1200)?;
        let log = console.board.take_log()?;
        assert!(!log.iter().any(|line| line.starts_with("WARN")), "{log:#?}");
        Ok(console)
    }

    /// Runs until a line has come that contains a text; returns the output up to the end of that line.
    fn until(&mut self, text: &str) -> Result<String> {
        for _ in 0..LONGEST / 100 {
            self.board.run_periods(100)?;
            self.said += &self.board.take_console();
            while self.board.next_period().is_some() {}
            if let Some(at) = self.said.find(text)
                && let Some(end) = self.said[at..].find('\n')
            {
                let rest = self.said.split_off(at + end + 1);
                return Ok(core::mem::replace(&mut self.said, rest));
            }
        }
        bail!("{text:?} did not come: {}", self.said)
    }

    fn say(&mut self, line: &str, until: &str) -> Result<String> {
        self.board.type_line(line);
        self.until(until)
    }
}

/// The value of a setting.
fn value(console: &mut Console, key: &str) -> Result<f64> {
    let answer = console.say(&format!("get {key}"), key)?;
    let word = answer.split(" = ").nth(1).and_then(|rest| rest.split(' ').next());
    word.with_context(|| answer.clone())?.parse().with_context(|| answer.clone())
}

/// Returns the parameters in force, as those of the inverse-Gamma circuit.
fn in_force(console: &mut Console) -> Result<Circuit> {
    let mut parameters = [0.0; 5];
    for (place, key) in parameters.iter_mut().zip(["r_s", "r_r", "l_ls", "l_lr", "l_m"]) {
        *place = value(console, &format!("motor.{key}"))?;
    }
    Ok(Circuit::of(parameters))
}

/// Returns the largest error in percent, and the error of each parameter in words.
fn commissioned(seed: u64) -> Result<(f64, String)> {
    let config = drawn(&Config::default(), seed);
    let mut console = Console::new(&config, seed)?;
    let told = console.say("commission", "commissioning: ended")?;
    let sound = told.contains("`accept`");
    if !sound {
        bail!("machine {seed}: {told}");
    }
    // The settings are saved as well: after a power cycle the identified values are in force.
    console.say("accept", "\nok")?;
    console.board.reset(stm32g4_unicorn::periph::Reset::Power);
    console.until("last run")?;
    let (found, truth) = (in_force(&mut console)?, Circuit::of_plant(&config));
    let pairs = found.values().into_iter().zip(truth.values());
    let errors = pairs.map(|((name, found), (_, truth))| (name, 100.0 * (found / truth - 1.0)));
    let errors: Vec<(&str, f64)> = errors.collect();
    let worst = errors.iter().fold(0.0, |worst: f64, (_, error)| worst.max(error.abs()));
    Ok((worst, format!("{seed}: {errors:.2?}")))
}

/// Each parameter times 0.5 to 2, shaft free. The sensors' gains are 0.5 % wrong, which appears in the resistances. On
/// the host 95 % of 500 such machines are within 1 %.
#[test]
fn random_machines_are_commissioned_by_the_image() {
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let machines = std::env::var("MACHINES").map_or(MACHINES, |number| number.parse().unwrap());
    let share = |n| (1 + n..=machines).step_by(threads as usize).map(commissioned);
    let results: Vec<_> = std::thread::scope(|scope| {
        let work = |n| move || share(n).collect::<Vec<_>>();
        let workers: Vec<_> = (0..threads).map(|n| scope.spawn(work(n))).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    let mut worst = Vec::new();
    for result in results {
        let (error, text) = result.unwrap();
        println!("{text}");
        worst.push(error);
    }
    worst.sort_by(f64::total_cmp);
    println!("largest errors: {worst:.2?}");
    // The limit for all but one of twenty, and the limit for all.
    let most = worst.len() - 1 - worst.len() / 20;
    assert!(worst[most] < 1.5 && worst.iter().all(|error| *error < 3.0), "{worst:?}");
}

/// The searches take most of the time of the watchdog, so a host that sends many lines must not add to it. (Once this
/// reset the chip while the outputs were on.)
#[test]
fn a_host_that_says_much_resets_nothing() -> Result<()> {
    let mut console = Console::new(&Config::default(), 1)?;
    console.say("stream i_q_a i_q_ref_a i_d_a speed_rpm phi_deg 200", "ok")?;
    console.say("commission", "wiring: sound")?;
    let mut told = String::new();
    for burst in 0..200 {
        console.board.run_periods(307)?;
        console.board.type_line("status");
        (0..burst % 41).for_each(|_| console.board.type_line(""));
        told += &console.board.take_console();
        while console.board.next_period().is_some() {}
        if told.contains("levels: sound") {
            break;
        }
    }
    assert!(told.contains("levels: sound"), "{told}");
    let log = console.board.take_log()?;
    assert!(!log.iter().any(|line| line.contains("watchdog")), "{log:#?}");
    Ok(())
}
