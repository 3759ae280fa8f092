//! A fault campaign: thousands of faults, each injected into a running board with a seed of its own.
//!
//! The criterion: at every instant later than the bound of its class after the fault, the outputs are off, or the
//! control is correct (angle error at most 15 degrees, phase currents below the trip). The control stays correct, for
//! example, if a bit flips that nothing depends on. In all classes a gate pattern that could short a leg is a failure,
//! and so are more than one reset and an end without a reason in the log.
//!
//! The reason is looked for in the log, which reports it first after a reset. One run in ten continues until the
//! greeting of the console, because the design of the control takes seconds.

mod class;
mod faults;
mod judge;
mod protections;
mod scene;
mod strip;

use std::collections::BTreeMap;
use std::env;
use std::ops::RangeInclusive;

use anyhow::{Context, Result, anyhow, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use class::{Class, Run};
use judge::Outcome;
use scene::Scene;
use stm32g4_unicorn::periph::Reset;
use virtual_board::Image;
use virtual_board::board::{Board, TICKS_PER_PERIOD};
use virtual_board::faults::Script;
use virtual_board::power_stage::{PowerStage, REFERENCE};

/// One run in this number continues after its reset until the console greets.
const WHOLE_STARTS: u64 = 10;
/// Time of observation after the bound, ms.
const AFTER_MS: f64 = 150.0;
/// Latest time of the fault after the snapshot, ticks: 20 ms.
const LATEST: u64 = 20 * 170_000;
/// Longest duration of `save`, periods.
const SAVE: u64 = 1200;
/// Speeds of a campaign at speed, rpm on four poles: the injection is off above about 800 rpm, and a drive turns up to 3600.
const SPEEDS_RPM: RangeInclusive<f64> = 850.0..=3500.0;

/// Seeds and outcomes of the runs of each class, by its index.
type Runs = BTreeMap<usize, Vec<(u64, Result<Outcome>)>>;

/// A change to a board before each fault, called with the class and an empty text, and after the fault, called with the description too.
pub type Without = fn(&mut Board, &str, &str);

/// The faults of a campaign.
pub struct Selection {
    /// Number of faults.
    pub count: u64,
    /// Seed of the first fault; each following fault has the next one that is selected.
    pub seed: u64,
    /// Restricts the campaign to classes whose name contains this text, or one of several texts separated by `|`.
    pub class: String,
    /// Speed of the shaft, rpm on four poles: 850 to 3500. With it the angle comes from the observer alone. Without it
    /// the shaft is locked without the encoder, and at 300 and 900 rpm with it.
    pub rpm: Option<f64>,
}

/// The variables are those of `cargo xtask campaign`: `BOARD`, the name of the image's board, `COUNT`, `SEED`, `CLASS`
/// and, at speed, `RPM`.
#[test]
#[ignore = "takes hours; cargo xtask campaign runs it"]
fn faults_end_in_time() -> Result<()> {
    let variable = |name| env::var(name).context(name);
    let rpm = env::var("RPM").ok().map(|rpm| rpm.parse()).transpose()?;
    let (count, seed) = (variable("COUNT")?.parse()?, variable("SEED")?.parse()?);
    let selection = Selection { count, seed, class: variable("CLASS")?, rpm };
    let stage = PowerStage::named(&variable("BOARD")?)?;
    println!("{}", bounds(rpm.is_some()));
    for table in run(stage, &selection, &[|_, _, _| ()])? {
        println!("{}", table?);
    }
    Ok(())
}

/// Runs a fault campaign on a power stage. All faults are injected once with each change of `without`, which remove
/// protections to check that their classes then fail. Returns for each change the table, or an error with the table and
/// its failures.
///
/// # Errors
/// A board does not start, or no class has that name.
pub fn run(
    stage: &'static PowerStage,
    selection: &Selection,
    without: &[Without],
) -> Result<Vec<Result<String>>> {
    let Selection { count, seed, ref class, rpm } = *selection;
    let all = Class::all(rpm.is_some());
    let classes = all.len() as u64;
    let chosen = |one: &Class| class.split('|').any(|part| one.name.contains(part));
    let is_chosen = |seed: &u64| chosen(&all[(seed % classes) as usize]);
    ensure!(
        all.iter().any(chosen),
        "no class of faults has {class:?} in its name: {}",
        all.iter().map(|c| &*c.name).collect::<Vec<_>>().join("; ")
    );
    ensure!(
        rpm.is_none_or(|rpm| SPEEDS_RPM.contains(&rpm)),
        "--rpm {}: {} to {} rpm on four poles",
        rpm.unwrap_or_default(),
        SPEEDS_RPM.start(),
        SPEEDS_RPM.end()
    );
    let chosen = |change| (seed..).filter(is_chosen).take(count as usize).map(move |s| (change, s));
    let jobs: Vec<_> = (0..without.len()).flat_map(chosen).collect();
    let work = |jobs: &[(usize, u64)]| -> Result<Vec<_>> {
        let mut scene = Scene::new(Image::built()?, stage, rpm)?;
        scene.board.forgive();
        // The seed determines everything, so a campaign of one fault with the seed of a failure repeats it.
        let run = |&(change, seed): &(usize, u64)| {
            let which = (seed % classes) as usize;
            let outcome = one(&mut scene, &all[which], seed / classes, seed, without[change]);
            let outcome = outcome.and_then(|outcome| {
                // A damaged program may break the chip's rules; an intact one may not.
                let whole = !matches!(all[which].run, Run::Regulating);
                let broken = scene.board.violations().first().filter(|_| whole);
                broken.map_or(Ok(outcome), |broken| Err(anyhow!("{broken}")))
            });
            if let Err(why) = &outcome {
                eprintln!("{}, seed {}: {why:#}", all[which].name, seed);
            }
            (change, which, (seed, outcome))
        };
        Ok(jobs.iter().map(run).collect())
    };
    // Each worker starts its own board, which takes as long as 25 faults.
    let workers = rayon::current_num_threads().min(jobs.len() / 100).max(1);
    let done = jobs.par_chunks(jobs.len().div_ceil(workers).max(1)).map(work);
    let mut runs: Vec<_> = without.iter().map(|_| Runs::default()).collect();
    for (change, which, ended) in done.collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        runs[change].entry(which).or_default().push(ended);
    }
    let judged = runs.iter().map(|runs| {
        let (table, failed) = table(&all, runs);
        ensure!(failed == 0, "{failed} of {count} failed\n{table}");
        Ok(table)
    });
    Ok(judged.collect())
}

/// Returns the reason why a run has failed, if it has.
fn failure(class: &Class, end: &Result<Outcome>) -> Option<String> {
    // Over-current is judged in every class.
    let bound = if class.bound.0.is_finite() { class.bound.0 } else { 0.0 };
    match end {
        Err(why) => Some(format!("{why:#}")),
        Ok(end) => {
            (end.wrong_ms > bound).then(|| format!("wrong for {:.2} ms: {end:?}", end.wrong_ms))
        }
    }
}

/// Runs one fault.
fn one(scene: &mut Scene, class: &Class, turn: u64, seed: u64, cut: Without) -> Result<Outcome> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let source = class.sources[(turn % class.sources.len() as u64) as usize];
    let whole_start = rng.random_range(0..WHOLE_STARTS) == 0;
    match class.run {
        Run::Regulating => {
            match class.off {
                true => scene.typed(&class.lines)?,
                false => scene.regulating(source, turn)?,
            }
            cut(&mut scene.board, &class.name, "");
            // First whole periods, because the true values are compared once in each, and then a part of one until the fault.
            scene.board.run_periods(rng.random_range(0..LATEST) / TICKS_PER_PERIOD)?;
            let (board, target) = (&mut scene.board, &scene.target);
            let (mut script, what) = match class.faults.is_empty() {
                true => (Script::default(), class.inject(board, target, &mut rng)?),
                false => Script::new(&class.faults, board, &target.places(), &mut rng)?,
            };
            cut(&mut scene.board, &class.name, &what);
            let (promised, bound) = (class.bound.0.is_finite(), class.bound.0);
            let trip_a = scene.target.settings.trip_a().into();
            let ms = AFTER_MS + if promised { bound } else { 0.0 };
            // In a start the flux has no angle yet.
            let (angle, scripted) = (promised && !class.off, !class.faults.is_empty());
            let ends_ms = (class.ends && scripted).then_some(bound);
            let mut outcome =
                judge::watch(&mut scene.board, &mut script, trip_a, ms, angle, ends_ms)
                    .with_context(|| what.clone())?;
            ensure!(
                !class.ends || scripted || outcome.off_ms.is_some_and(|ms| ms <= bound),
                "{what}: the outputs stay on"
            );
            if outcome.off_ms.is_some() && !class.off {
                judge::reported(&mut scene.board, whole_start, class.resets)
                    .with_context(|| format!("{what}; after the end"))?;
            }
            if let Some(told) = &class.told {
                let shown = scene.board.take_log()?.join("\n") + &scene.board.take_console();
                ensure!(shown.contains(told), "{what}: not told {told:?}, but {shown}");
            }
            outcome.what = what;
            Ok(outcome)
        }
        Run::Saving => {
            // The two slots take turns.
            let slot = (turn % 2) as usize;
            let operations = operations(scene, slot)?;
            lose_power(scene, slot, turn / 2 % operations)?;
            after_power(scene, whole_start)
        }
        Run::DamagedPage => {
            scene.off(0)?;
            let slot = (turn % 2) as usize;
            let word = rng.random_range(0..64);
            scene.board.chip().flash.tear(induction_drive::board::settings_address(slot, word));
            one_set_counts(scene)?;
            scene.board.reset(Reset::Power);
            after_power(scene, true)
        }
        Run::Strip(fault) => strip::run(scene, fault, turn, &mut rng),
        Run::Reset => {
            scene.regulating(source, turn)?;
            scene.board.run_ticks(rng.random_range(0..LATEST))?;
            scene.board.went_off = None;
            scene.board.reset(Reset::Pin);
            ensure!(!scene.board.chip().tim1.outputs_on(), "outputs on after a reset");
            // Another reset while it starts.
            scene.board.run_ticks(rng.random_range(0..LATEST))?;
            scene.board.reset(Reset::Pin);
            after_power(scene, whole_start)
        }
    }
}

/// Interrupts the power in every operation of a `save`, to each of the two slots: the old or the new set must be valid,
/// and the board must start with it. Returns the number of operations.
///
/// # Errors
/// The slot and the operation of the first failure.
pub fn every_operation_of_save(image: Image) -> Result<[u64; 2]> {
    let mut scene = Scene::new(image, &REFERENCE, None)?;
    scene.board.forgive();
    let mut counts = [0; 2];
    for (slot, count) in counts.iter_mut().enumerate() {
        *count = operations(&mut scene, slot)?;
        for operation in 0..*count {
            lose_power(&mut scene, slot, operation)
                .and_then(|()| after_power(&mut scene, false))
                .with_context(|| format!("slot {slot}, operation {operation}"))?;
        }
    }
    Ok(counts)
}

/// Interrupts the power in an operation of a `save`, counted from 0.
fn lose_power(scene: &mut Scene, slot: usize, operation: u64) -> Result<()> {
    scene.off(slot)?;
    let flash = &mut scene.board.chip().flash;
    flash.power_loss_at = Some(flash.operations + 1 + operation);
    scene.board.type_line("save");
    // Only until the reset, because a start takes as long as on a chip.
    for _ in 0..SAVE / 10 {
        scene.board.run_periods(10)?;
        if !scene.board.resets.is_empty() {
            return one_set_counts(scene);
        }
    }
    bail!("the power did not go")
}

/// Returns the number of flash operations of a `save`.
fn operations(scene: &mut Scene, slot: usize) -> Result<u64> {
    scene.off(slot)?;
    let before = scene.board.chip().flash.operations;
    scene.board.type_line("save");
    scene.board.run_periods(SAVE)?;
    let heard = scene.board.take_console();
    ensure!(heard == "ok\n" || heard == "ok\r\n", "save: {heard:?}");
    let wanted = scene.settings[1 - slot % 2];
    ensure!(scene::saved_settings(&mut scene.board)? == wanted, "not the settings that were saved");
    Ok(scene.board.chip().flash.operations - before)
}

/// Checks that the settings in the flash are the old ones or the new ones.
fn one_set_counts(scene: &mut Scene) -> Result<()> {
    let settings = scene::saved_settings(&mut scene.board)?;
    ensure!(scene.settings.contains(&settings), "neither the old settings nor the new ones");
    Ok(())
}

/// Checks that the board starts with one of the sets, and reports why it was reset.
fn after_power(scene: &mut Scene, whole_start: bool) -> Result<Outcome> {
    let board = &mut scene.board;
    let reset = board.resets.last().map(|reset| reset.1).context("no reset")?;
    let (mut log, cause) = (Vec::new(), reset.to_string());
    // The check sum of the image takes 39 ms.
    for _ in 0..40 {
        board.run_periods(10)?;
        log.extend(board.take_log()?);
        if log.iter().any(|line| line.contains(&cause)) {
            break;
        }
    }
    ensure!(log.iter().any(|line| line.contains(&cause)), "no {cause:?} in the log {log:?}");
    if whole_start {
        let greeting = judge::greeting(board)?;
        ensure!(!greeting.contains("not used"), "{greeting}");
    }
    Ok(Outcome { off_ms: Some(0.0), ..Outcome::default() })
}

/// Returns the table, and the number of failed runs.
fn table(all: &[Class], runs: &Runs) -> (String, usize) {
    let mut text = String::from(
        "| class | bound, ms | runs | off | carried on | latest off, ms | longest wrong, ms | peak, A | failed |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let mut failures = Vec::new();
    for (which, ends) in runs {
        let (class, before) = (&all[*which], failures.len());
        failures.extend(ends.iter().filter_map(|(seed, end)| {
            Some(format!("{}, seed {seed}: {}\n", class.name, failure(class, end)?))
        }));
        let (runs, failed) = (ends.len(), failures.len() - before);
        let ended: Vec<_> = ends.iter().filter_map(|(_, end)| end.as_ref().ok()).collect();
        let most = |of: fn(&Outcome) -> f64| ended.iter().map(|end| of(end)).fold(0.0, f64::max);
        let off = ended.iter().filter(|end| end.off_ms.is_some()).count();
        let carried_on = runs - off - failed.min(runs - off);
        let (name, bound) = (&class.name, class.bound.0);
        let latest_off = most(|end| end.off_ms.unwrap_or(0.0));
        let (wrong, peak) = (most(|end| end.wrong_ms), most(|end| end.peak_a));
        text += &format!(
            "| {name} | {bound:.3} | {runs} | {off} | {carried_on} | {latest_off:.3} | {wrong:.2} | {peak:.2} | {failed} |\n"
        );
    }
    (text + &failures.concat(), failures.len())
}

/// Returns the bounds and their reasons, at speed or not.
pub fn bounds(at_speed: bool) -> String {
    let row = |c: &Class| format!("{} | {:.3} | {}\n", c.name, c.bound.0, c.bound.1);
    let rows: String = Class::all(at_speed).iter().map(row).collect();
    format!("class | bound, ms | reason\n---|---|---\n{rows}")
}
