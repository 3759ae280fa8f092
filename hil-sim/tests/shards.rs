//! Statistics on many machines: shards that give the whole, byte for byte; continued runs; refusals.

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

use crate::cli_common::{folder, hil_sim, object, text};

/// Every statistical experiment, with options that make it small.
const SMALL: [(&str, &str); 9] = [
    ("monte-carlo", "--set runs=7 --seconds 0.2 --set spread.motor=0.1 --set drive.motor.r_s=5"),
    ("machines", "--set runs=2 --set spread.machine=1.5 --seconds 0.2"),
    ("commission", "--set runs=4"),
    ("commission-refusals", "--set runs=1"),
    ("battery", "--set runs=14 --set disturbed.drawn=0.5 --set after.motor.r_r=1.2"),
    ("full-range", "--set runs=1 --set full_range.kind=constant --set angle_source=encoder"),
    ("lock-monitor", "--set runs=1"),
    ("smallest-slope", "--set runs=1"),
    ("foreign-motors", "--set runs=3"),
];

/// A small run whose outcome depends on every record.
const MONTE_CARLO: &[&str] = &["run", "monte-carlo", "--set", "runs=6", "--seconds", "0.1", "-q"];

fn run(folder: &Path, name: &str, options: &[&str], more: &[&str]) -> Vec<u8> {
    let output = hil_sim(folder, &[&["run", name, "-q"], options, more].concat());
    assert!(output.stderr.is_empty(), "{name}: {}", text(&output.stderr));
    output.stdout
}

/// Writes shards of a run to files in `runs/`.
fn shards(folder: &Path, arguments: &[&str], indices: &[usize], count: usize) {
    std::fs::create_dir_all(folder.join("runs")).unwrap();
    for index in indices {
        let output =
            hil_sim(folder, &[arguments, &["--shard", &format!("{index}/{count}")]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        std::fs::write(folder.join(format!("runs/{index}.jsonl")), output.stdout).unwrap();
    }
}

#[test]
fn every_statistical_experiment_is_in_the_list() {
    for experiment in hil_sim::experiments::EXPERIMENTS.iter() {
        let is_shared = SMALL.iter().any(|(name, _)| *name == experiment.name);
        assert_eq!(experiment.study.is_some(), is_shared, "{}", experiment.name);
        // All experiments with a number of runs can be shared.
        let takes_runs = experiment.uses.contains(&"runs");
        assert!(!takes_runs || is_shared, "{}", experiment.name);
    }
}

/// Whether even its smallest run takes ten seconds.
fn is_long(name: &str) -> bool {
    ["smallest-slope", "foreign-motors"].contains(&name)
}

/// Does two of three shards, in another order, and compares the whole that continues them with one run: percentiles,
/// tables, figures and all.
fn shards_are_the_whole_run(which: impl Fn(&str) -> bool) {
    for (name, options) in SMALL.into_iter().filter(|(name, _)| which(name)) {
        let options: &[&str] = &options.split(' ').collect::<Vec<_>>();
        let folder = folder(&format!("shards-{name}"));
        let whole = run(&folder, name, options, &["--json", "--seed", "5"]);
        let arguments = [&["run", name, "-q", "--seed", "5"], options].concat();
        shards(&folder, &arguments, &[3, 1], 3);
        let joined = hil_sim(&folder, &[&arguments[..], &["--json", "--resume", "runs/"]].concat());
        assert_eq!(text(&joined.stdout), text(&whole), "{name}");
    }
}

#[test]
fn shards_are_the_whole_run_byte_for_byte() {
    shards_are_the_whole_run(|name| !is_long(name));
}

#[test]
#[ignore = "cargo xtask prove long-tests"]
fn shards_of_the_long_experiments_are_the_whole_run() {
    shards_are_the_whole_run(is_long);
}

#[test]
fn the_shards_of_a_run_have_its_runs_and_their_seeds() {
    let folder = folder("shards-seeds");
    shards(&folder, MONTE_CARLO, &[1, 4], 4);
    let seeds = |shard: &str| {
        let text = std::fs::read_to_string(folder.join(format!("runs/{shard}.jsonl"))).unwrap();
        let pair = |line: &str| {
            let run: serde_json::Value = serde_json::from_str(line).unwrap();
            (run["run"].as_u64().unwrap(), run["record"]["case"]["seed"].as_u64().unwrap())
        };
        // After the head.
        text.lines().skip(1).map(pair).collect::<Vec<_>>()
    };
    assert_eq!(seeds("1"), [(0, 1_000_003), (4, 1_000_007)]);
    assert_eq!(seeds("4"), [(3, 1_000_006)]);
}

/// The file of another shard is refused by its name, and left as it is, if it belongs to another run.
#[test]
fn shards_that_do_not_belong_together_are_refused_by_name() {
    let folder = folder("shards-refused");
    shards(&folder, MONTE_CARLO, &[2], 3);
    let path = folder.join("runs/2.jsonl");
    let kept = std::fs::read_to_string(&path).unwrap();
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    let refused = |text: &str, more: &[&str], part: &str| {
        std::fs::write(&path, text).unwrap();
        let output =
            hil_sim(&folder, &[MONTE_CARLO, &["--json", "--resume", "runs/"], more].concat());
        let message = self::text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("2.jsonl") && message.contains(part), "{part}: {message}");
        assert!(output.stdout.is_empty() && std::fs::read_to_string(&path).unwrap() == text);
    };
    refused(&kept, &["--set", "motor.r_s=6"], "motor.r_s is 6, there not set");
    refused(&kept, &["--set", "runs=7"], "runs is 7, there 6");
    refused(&kept.replace(&version, "\"version\":\"0.0.7\""), &[], "there 0.0.7");
    refused(&kept.replace("\"sources\":\"", "\"sources\":\"0"), &[], "there 0");
    refused(&kept.replace("\"run\":4", "\"run\":6"), &[], "no record of this run");
    // A torn line is no refusal: its run is done again.
    std::fs::write(&path, &kept[..kept.len() - 9]).unwrap();
    let output = hil_sim(&folder, &[MONTE_CARLO, &["--json", "--resume", "runs/"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// The records of the file count: a changed record appears in the outcome, so its run was not done again; a torn one is.
#[test]
fn finished_runs_are_not_done_again_and_a_torn_line_is() {
    let folder = folder("shards-resume");
    let whole = hil_sim(&folder, &[MONTE_CARLO, &["--json"]].concat()).stdout;
    let resumed = || hil_sim(&folder, &[MONTE_CARLO, &["--json", "--resume", "runs/"]].concat());
    let first = resumed();
    assert_eq!((text(&first.stdout), text(&first.stderr)), (text(&whole), ""));
    let path = folder.join("runs/monte-carlo-seed-1-1-of-1.jsonl");
    let kept = std::fs::read_to_string(&path).unwrap();
    assert_eq!(kept.lines().count(), 7, "a head and six runs");

    let marked = kept.replacen("\"lost\":false", "\"lost\":true", 1);
    std::fs::write(&path, &marked).unwrap();
    let output = resumed();
    assert_eq!(object(&output)["metrics"]["lost_runs"], 1.0);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), marked);

    std::fs::write(&path, &kept[..kept.len() - 30]).unwrap();
    let output = resumed();
    assert_eq!(text(&output.stdout), text(&whole));
    let note = "runs/monte-carlo-seed-1-1-of-1.jsonl, line 7, was torn; its run is done again";
    assert!(text(&output.stderr).contains(note), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), kept);

    let other = ["--json", "--resume", "runs/monte-carlo-seed-1-1-of-1.jsonl", "--seed", "2"];
    let output = hil_sim(&folder, &[MONTE_CARLO, &other].concat());
    let message = text(&output.stderr);
    assert!(
        message.contains("here seed is 2, there 1") && output.status.code() == Some(2),
        "{message}"
    );
}

/// The recipe of the documentation, with GNU parallel if it is installed and with xargs.
#[test]
fn the_recipe_for_many_machines_gives_the_whole_run() {
    let folder = folder("shards-recipe");
    let whole = hil_sim(&folder, &[MONTE_CARLO, &["--json"]].concat()).stdout;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/shards.sh");
    // Two machines behind a secure shell that notes the machine and runs locally. Like `sshd` it sets SHELL, without
    // which the command that parallel sends does nothing and still reports success.
    let shell = folder.join("ssh");
    let text_of_shell = "#!/bin/sh\necho $1 >> hosts; shift; [ $1 = -- ] && shift; export SHELL=/bin/sh; exec sh -c \"$*\"\n";
    std::fs::write(&shell, text_of_shell).unwrap();
    std::fs::set_permissions(&shell, std::fs::Permissions::from_mode(0o755)).unwrap();
    let recipe = |path: Option<&Path>, place: &str| {
        let mut command = Command::new("/bin/sh");
        command.current_dir(&folder).env("SIM", env!("CARGO_BIN_EXE_hil-sim"));
        command.env("HOSTS", "1/alpha,1/beta").env("PARALLEL_SSH", &shell);
        path.map(|path| command.env("PATH", path));
        command.arg(&script).args(["3", place]).args(&MONTE_CARLO[1..6]);
        let output = command.output().expect("a shell");
        assert!(output.status.success(), "{}", text(&output.stderr));
        std::fs::read(folder.join(place).join("whole.json")).unwrap()
    };
    let has_parallel = Command::new("parallel").arg("--version").output().is_ok();
    if has_parallel {
        assert_eq!(recipe(None, "with-parallel"), whole);
        let hosts = std::fs::read_to_string(folder.join("hosts")).unwrap();
        assert!(hosts.contains("alpha") && hosts.contains("beta"), "{hosts}");
        // Once more: all runs are there.
        assert_eq!(recipe(None, "with-parallel"), whole);
    }
    // A path with everything that the script needs, but without GNU parallel.
    let tools = folder.join("tools");
    std::fs::create_dir_all(&tools).unwrap();
    let all = std::env::var_os("PATH").unwrap_or_default();
    for tool in ["sh", "mkdir", "seq", "xargs", "cp"] {
        let place =
            std::env::split_paths(&all).map(|dir| dir.join(tool)).find(|path| path.is_file());
        std::os::unix::fs::symlink(place.expect(tool), tools.join(tool)).unwrap();
    }
    assert_eq!(recipe(Some(&tools), "with-xargs"), whole);
}

/// One row per run, with its random values and its results; the rows of a shard are those of its runs.
#[test]
fn rows_of_runs_can_be_analysed() {
    let folder = folder("shards-rows");
    let all = hil_sim(&folder, &[MONTE_CARLO, &["--json", "--rows", "all.csv"]].concat());
    assert_eq!(all.status.code(), Some(0), "{}", text(&all.stderr));
    let read = |name: &str| {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        text.lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect::<Vec<Vec<_>>>()
    };
    let rows = read("all.csv");
    assert_eq!(rows.len(), 7);
    let column = |name: &str| rows[0].iter().position(|head| head == name).expect(name);
    let number = |row: usize, name: &str| rows[row][column(name)].parse::<f64>().unwrap();
    assert_eq!((number(3, "run"), number(3, "case_seed")), (2.0, 1_000_005.0));
    assert!((0.5..=3.0).contains(&number(3, "case_iq_a").abs()));
    let page = include_str!("../../docs/simulator.md");
    assert!(rows[0].iter().all(|head| page.contains(&format!("`{head}`"))), "{:?}", rows[0]);
    // The worst of the rows is the worst of the result.
    let worst = (1..7).map(|row| number(row, "error_rms_deg")).fold(0.0, f64::max);
    assert_eq!(object(&all)["metrics"]["worst_run_rms_deg"], worst);
    let shard = ["--shard", "2/3", "--rows", "two.csv"];
    hil_sim(&folder, &[MONTE_CARLO, &shard].concat());
    assert_eq!(read("two.csv"), [rows[0].clone(), rows[2].clone(), rows[5].clone()]);
    let output = hil_sim(&folder, &["run", "torque-steps", "--rows", "x.csv"]);
    assert!(text(&output.stderr).contains("does not consist of independent runs"));
}
