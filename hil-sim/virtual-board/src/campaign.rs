//! A campaign of faults: thousands of them, each from a running board, each with a seed of its own.
//!
//! What counts: at every instant later than the bound of its class after the fault, outputs are off, or
//! control is correct (angle error at most 15 degrees, phase currents below the trip). A bit that
//! flips where nothing depends on it is such a case. Whatever happens, a gate pattern that could
//! short a leg fails, as do more than one reset and an end without a reason in the log.
//!
//! The reason is looked for in the log, which tells it first thing after a reset; one run in
//! ten goes on until the console greets, as the design of the control takes seconds.

mod class;
mod judge;
mod scene;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Mutex;

use anyhow::{Context, Result, anyhow, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::chip::Reset;
use crate::image::Image;
use class::{CLASSES, Class, Course, OPEN};
use judge::Seen;
use scene::Scene;

/// One run in so many starts wholly after its reset.
const WHOLE_STARTS: u64 = 10;
/// Longest that is looked at after the bound, ms.
const AFTER_MS: f64 = 150.0;
/// A fault comes up to so many ticks after the board was gone back to: 20 ms.
const LATEST: u64 = 20 * 170_000;
/// Longest time of `save`, periods.
const SAVE: u64 = 1200;

/// What was found of a class.
#[derive(Clone, Debug, Default)]
struct Found {
    runs: u32,
    off: u32,
    worst_off_ms: f64,
    worst_wrong_ms: f64,
    peak_a: f64,
    failures: Vec<(u64, String)>,
}

/// Which faults.
#[derive(Clone, Debug)]
pub struct Choice {
    /// How many.
    pub count: u64,
    /// Seed of the first; each has the next one that is chosen.
    pub seed: u64,
    /// Only of the classes whose name contains this.
    pub class: String,
    /// Whether what fails in a class that is known to be open is not counted.
    pub forgiven: bool,
}

/// A campaign of faults; `open` opens the image. Gives the table.
///
/// # Errors
/// The table with what failed; no class has that name.
pub fn run(open: impl Fn() -> Result<Image> + Sync, choice: &Choice) -> Result<String> {
    let Choice { count, seed, ref class, forgiven } = *choice;
    let classes = CLASSES.len() as u64;
    let is_chosen = |seed: &u64| CLASSES[(seed % classes) as usize].name.contains(class);
    ensure!(
        CLASSES.iter().any(|c| c.name.contains(class)),
        "no class of faults has {class:?} in its name: {}",
        CLASSES.iter().map(|c| c.name).collect::<Vec<_>>().join("; ")
    );
    let seeds = Mutex::new((seed..).filter(is_chosen).take(count as usize));
    let found: Mutex<BTreeMap<usize, Found>> = Mutex::default();
    let work = || -> Result<()> {
        let mut scene = Scene::new(open()?)?;
        scene.board.forgive();
        loop {
            // A seed says all: a campaign of one with the seed of a failure repeats it.
            let taken = seeds.lock().map_err(|_| anyhow!("another worker has failed"))?.next();
            let Some(seed) = taken else { return Ok(()) };
            let which = (seed % classes) as usize;
            let seen = one(&mut scene, &CLASSES[which], seed / classes, seed);
            if let Err(why) = &seen {
                eprintln!("{}, seed {}: {why:#}", CLASSES[which].name, seed);
            }
            let mut found = found.lock().map_err(|_| anyhow!("another worker has failed"))?;
            add(found.entry(which).or_default(), &CLASSES[which], seed, seen);
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(count as usize);
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        all.into_iter().try_for_each(|one| one.join().map_err(|_| anyhow!("a worker panicked"))?)
    })?;
    let found = found.into_inner().map_err(|_| anyhow!("a worker panicked"))?;
    let table = table(&found);
    let counts = |which: usize| !(forgiven && missing(&CLASSES[which]).is_some());
    let failures = found.iter().filter(|(which, _)| counts(**which));
    let failed: usize = failures.map(|(_, f)| f.failures.len()).sum();
    if failed > 0 {
        bail!("{failed} of {count} failed\n{table}");
    }
    Ok(table)
}

/// What is missing for a class, if that is known.
fn missing(class: &Class) -> Option<&'static str> {
    OPEN.iter().find(|(name, _)| *name == class.name).map(|(_, what)| *what)
}

fn add(found: &mut Found, class: &Class, seed: u64, seen: Result<Seen>) {
    found.runs += 1;
    let seen = match seen {
        Ok(seen) => seen,
        Err(why) => return found.failures.push((seed, format!("{why:#}"))),
    };
    if let Some(ms) = seen.off_ms {
        found.off += 1;
        found.worst_off_ms = found.worst_off_ms.max(ms);
    }
    found.worst_wrong_ms = found.worst_wrong_ms.max(seen.wrong_ms);
    found.peak_a = found.peak_a.max(seen.peak_a);
    // Over-current is judged in every class.
    let bound = if class.bound_ms.is_finite() { class.bound_ms } else { 0.0 };
    if seen.wrong_ms > bound {
        let why = format!("wrong for {:.2} ms: {seen:?}", seen.wrong_ms);
        found.failures.push((seed, why));
    }
}

/// One fault.
fn one(scene: &mut Scene, class: &Class, turn: u64, seed: u64) -> Result<Seen> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let source = class.sources[(turn % class.sources.len() as u64) as usize];
    let whole_start = rng.random_range(0..WHOLE_STARTS) == 0;
    match class.course {
        Course::Regulating(inject) => {
            scene.regulating(source)?;
            // Whole periods, for the truth is compared once in each, and a part of one for the fault.
            scene.board.run_periods(rng.random_range(0..LATEST) / (2 * 14_167))?;
            let what = inject(&mut scene.board, &scene.places, &mut rng);
            let (promised, bound) = (class.bound_ms.is_finite(), class.bound_ms);
            let ms = AFTER_MS + if promised { bound } else { 0.0 };
            let mut seen = judge::watch(&mut scene.board, &scene.places, ms, promised)
                .with_context(|| what.clone())?;
            if seen.off_ms.is_some() {
                judge::reported(&mut scene.board, whole_start)
                    .with_context(|| format!("{what}; after the end"))?;
            }
            seen.what = what;
            Ok(seen)
        }
        Course::Saving => {
            scene.off()?;
            let operations = operations(scene)?;
            scene.off()?;
            let flash = &mut scene.board.chip().flash;
            // Each in turn.
            flash.power_loss_at = Some(flash.operations + 1 + turn % operations);
            scene.board.type_line("save");
            scene.board.run_periods(SAVE)?;
            ensure!(scene.board.resets.len() == 1, "the power did not go");
            one_set_counts(scene)?;
            after_power(scene, whole_start)
        }
        Course::DamagedPage => {
            scene.off()?;
            let slot = (turn % 2) as usize;
            let word = rng.random_range(0..64);
            scene.board.chip().flash.tear(crate::board::settings_address(slot, word));
            one_set_counts(scene)?;
            scene.board.reset(Reset::Power);
            after_power(scene, true)
        }
        Course::Reset => {
            scene.regulating(source)?;
            scene.board.run_ticks(rng.random_range(0..LATEST))?;
            scene.board.went_off = None;
            scene.board.reset(Reset::Pin);
            ensure!(!scene.board.chip().tim1.outputs_on(), "outputs on after a reset");
            // Once more while it starts.
            scene.board.run_ticks(rng.random_range(0..LATEST))?;
            scene.board.reset(Reset::Pin);
            after_power(scene, whole_start)
        }
    }
}

/// How many operations of the flash a `save` takes.
fn operations(scene: &mut Scene) -> Result<u64> {
    let before = scene.board.chip().flash.operations;
    scene.board.type_line("save");
    scene.board.run_periods(SAVE)?;
    let heard = scene.board.heard();
    ensure!(heard == "ok\n" || heard == "ok\r\n", "save: {heard:?}");
    ensure!(scene::pair_settings(&mut scene.board)? == scene.settings[1], "not what was saved");
    Ok(scene.board.chip().flash.operations - before)
}

/// The settings in the flash are the old ones or the new ones.
fn one_set_counts(scene: &mut Scene) -> Result<()> {
    let settings = scene::pair_settings(&mut scene.board)?;
    ensure!(scene.settings.contains(&settings), "neither the old settings nor the new ones");
    Ok(())
}

/// It starts, with one of the sets, and says why it was reset.
fn after_power(scene: &mut Scene, whole_start: bool) -> Result<Seen> {
    let board = &mut scene.board;
    let reset = board.resets.last().map(|reset| reset.1).context("no reset")?;
    board.run_periods(100)?;
    let log = board.logged()?;
    let cause = scene::cause(reset);
    ensure!(log.iter().any(|line| line.contains(cause)), "no {cause:?} in the log {log:?}");
    if whole_start {
        let greeting = judge::greeting(board)?;
        ensure!(!greeting.contains("not used"), "{greeting}");
    }
    Ok(Seen { off_ms: Some(0.0), ..Seen::default() })
}

fn table(found: &BTreeMap<usize, Found>) -> String {
    let mut text = String::from(
        "class | bound, ms | runs | off | carried on | latest off, ms | longest wrong, ms | peak, A | failed\n\
         ---|---|---|---|---|---|---|---|---\n",
    );
    for (which, f) in found {
        let class = &CLASSES[*which];
        let _ = writeln!(
            text,
            "{} | {:.3} | {} | {} | {} | {:.3} | {:.2} | {:.2} | {}",
            class.name,
            class.bound_ms,
            f.runs,
            f.off,
            f.runs - f.off - f.failures.len().min((f.runs - f.off) as usize) as u32,
            f.worst_off_ms,
            f.worst_wrong_ms,
            f.peak_a,
            f.failures.len(),
        );
    }
    for (which, f) in found.iter().filter(|(_, f)| !f.failures.is_empty()) {
        if let Some(what) = missing(&CLASSES[*which]) {
            let _ = writeln!(text, "{} is known to be open: {what}", CLASSES[*which].name);
        }
        for (seed, why) in &f.failures {
            let _ = writeln!(text, "{}, seed {seed}: {why}", CLASSES[*which].name);
        }
    }
    text
}

/// The bounds and their reasons.
pub fn bounds() -> String {
    CLASSES.iter().fold(String::from("class | bound, ms | reason\n---|---|---\n"), |mut text, c| {
        let _ = writeln!(text, "{} | {:.3} | {}", c.name, c.bound_ms, c.why);
        text
    })
}
