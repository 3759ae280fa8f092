//! The image commissions its motor: random machines and boards, at the console.

use anyhow::{Context as _, Result, bail};
use hil_sim::Config;
use hil_sim::experiments::drawn_machine::{Circuit, drawn};
use virtual_board::board::simulated;
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
    console.board.reset(virtual_board::periph::Reset::Power);
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
        let workers = (0..threads).map(|n| simulated::worker().spawn_scoped(scope, work(n)));
        let workers: Vec<_> = workers.map(|worker| worker.expect("a thread")).collect();
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

#[test]
fn a_stop_or_a_new_setting_leaves_everything_as_it_was() -> Result<()> {
    let config = drawn(&Config::default(), 7);
    let mut console = Console::new(&config, 7)?;
    let before = in_force(&mut console)?;
    console.say("commission", "wiring: sound")?;
    console.board.run_periods(6000)?;
    let told = console.say("stop", "commissioning: ended")?;
    assert!(told.contains("levels: refused") && told.contains("as they were"), "{told}");
    assert!(console.say("accept", "\n")?.contains("commission"), "nothing to accept");
    assert!(console.say("status", "\n")?.starts_with("off"));
    let after = in_force(&mut console)?;
    assert_eq!(before.values().map(|(_, x)| x), after.values().map(|(_, x)| x));
    Ok(())
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

#[test]
fn the_image_finds_the_inertia_with_a_free_shaft() -> Result<()> {
    let mut config = Config::default();
    config.load.mode = hil_sim::config::LoadMode::Free;
    config.motor.inertia = 0.02;
    let mut console = Console::new(&config, 3)?;
    let told = console.say("commission inertia", "commissioning: ended")?;
    assert!(told.contains("the shaft is going to turn") && told.contains("exchange two"), "{told}");
    console.say("accept", "\nok")?;
    let inertia = value(&mut console, "motor.inertia")?;
    assert!((inertia / 0.02 - 1.0).abs() < 0.05, "{inertia}");
    // The drive has turned the shaft, which is at rest again with the outputs off.
    assert!(console.say("status", "\n")?.starts_with("off"));
    Ok(())
}

#[test]
fn the_image_identifies_the_plants_of_the_current_loop_on_request() -> Result<()> {
    let mut config = Config::default();
    config.load.mode = hil_sim::config::LoadMode::Locked;
    let mut console = Console::new(&config, 4)?;
    console.say("commission nameplate leakage", "commissioning: ended")?;
    let told = console.say("commission plant", "commissioning: ended")?;
    assert!(
        told.contains("phase margin by rule 3.8 across") && told.contains("plant: sound"),
        "{told}"
    );
    assert!(console.say("get current_plant", "current_plant")?.contains("motor"), "not accepted");
    console.say("accept", "\nok")?;
    // (1 - exp(-R T/L))/R with Table 5. On the board the edges of the inverter are real.
    for key in ["current_plant.d.k", "current_plant.q.k"] {
        let k = value(&mut console, key)?;
        assert!((k / 0.0032 - 1.0).abs() < 0.1, "{key}: {k}");
    }
    Ok(())
}

/// The session of the manual, from the nameplate to torque; with `--nocapture` it prints the output of the console.
#[test]
fn the_image_goes_from_the_nameplate_to_torque() -> Result<()> {
    let mut config = Config::default();
    config.load.mode = hil_sim::config::LoadMode::Locked;
    let mut console = Console::new(&config, 1)?;
    for (line, until) in [
        ("commission", "commissioning: ended"),
        ("accept", "\nok"),
        ("learn", "off: the learning has ended"),
        ("save", "ok"),
        ("start", "running: torque"),
        ("torque 1", "ok"),
    ] {
        let began = console.board.time();
        let said = console.say(line, until)?;
        let seconds = console.board.time() - began;
        println!("{line}\n{said}({seconds:.0} s)");
        if line == "commission" {
            assert!(said.contains("then lock the shaft and `learn`"), "{said}");
        }
        if line == "learn" {
            // 0.707 of the 3.27 A that the sensors leave for both currents: 3/2 P L_M i_d i_q = 2.46 Nm.
            assert!(said.contains("learned: trackable from -2.4"), "{said}");
            assert!(said.contains("the range of the sensors"), "{said}");
            // The duration with 14 currents, up to the limit.
            assert!(seconds < 80.0, "{seconds} s");
        }
    }
    Ok(())
}
