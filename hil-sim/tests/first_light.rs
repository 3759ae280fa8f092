//! The table of first power-up: its page, and the rule that nothing switches the power stage on too early; and the
//! contributed test records, replayed against the plant.

use std::fmt::Write as _;

use hil_sim::first_light::evidence::{Evidence, Record, SCHEMA, Verdict};
use hil_sim::first_light::table::{Act, Board, Limits, Read, Table};
use hil_sim::plant::{
    Complex, Load, Machine, MachineSettings, Mechanics, MechanicsSettings, MotorModel,
    SaliencySettings,
};

use crate::generated;

/// The board whose numbers the tables of the page have.
const SHOWN: &str = "nucleo-g474re-ihm08m1";

fn limits(is: &Limits, unit: &str, board: &Board) -> String {
    let [least, most] = is.each_ref().map(|end| (board.number(end) * 1e3).round() / 1e3);
    format!("{least} to {most} {unit}").replace('-', "−")
}

/// Whether an act belongs to the column "expect", and its text for this board.
fn shown(act: &Act, board: &Board) -> (bool, String) {
    let code = |line: &str| format!("`{}`", board.fill(line));
    match act {
        Act::Hand(what) | Act::Restart(what) => (false, board.fill(what)),
        Act::Send(line) => (false, code(line)),
        Act::Often { line, times } => (false, format!("{}, {times} times", code(line))),
        Act::Setting(key) => (false, format!("`set {key} …`")),
        Act::Wait(seconds) => (false, format!("wait {seconds} s")),
        Act::Hear(text) => (true, code(&text.replace('`', ""))),
        Act::Never(text) => (true, format!("not {}", code(text))),
        Act::See(what) => (true, board.fill(what)),
        Act::Measure { what, unit, is } => {
            (true, format!("{} {}", board.fill(what), limits(is, unit, board)))
        }
        Act::Read(read) => {
            let place = read.place().trim_matches([' ', ',']);
            let change = if read.rise { "changes by " } else { "" };
            (true, format!("`{place}` {change}{}", limits(&read.is, &read.unit, board)))
        }
        Act::Noise(signal) => (
            true,
            board.fill(&format!("`{signal}`: mean within MEAN A of zero, noise below NOISE A rms")),
        ),
    }
}

fn page(table: &Table) -> String {
    let board = table.board(SHOWN).unwrap();
    let others: Vec<_> = table.boards.iter().filter(|board| board.name != SHOWN).collect();
    let (mut text, mut differ, mut number) = (String::new(), String::new(), 0);
    for part in &table.parts {
        write!(text, "\n## {}\n\n{}\n\n", part.title, board.fill(part.before.trim())).unwrap();
        text += "| step | do | expect | otherwise |\n|---|---|---|---|\n";
        for step in &part.steps {
            number += 1;
            let acts: Vec<_> = step.acts.iter().map(|act| shown(act, board)).collect();
            // A round is what a person does and then expects; with several rounds each has its number in both columns.
            let mut rounds = vec![[Vec::new(), Vec::new()]];
            for (expect, text) in &acts {
                if !expect && rounds.last().is_some_and(|[_, seen]| !seen.is_empty()) {
                    rounds.push([Vec::new(), Vec::new()]);
                }
                rounds.last_mut().unwrap()[usize::from(*expect)].push(text.as_str());
            }
            let column = |wanted: bool| {
                let filled = rounds.iter().enumerate().filter_map(|(n, round)| {
                    let text = round[usize::from(wanted)].join("; ");
                    let number =
                        if rounds.len() > 1 { format!("({}) ", n + 1) } else { String::new() };
                    (!text.is_empty()).then(|| number + &text)
                });
                filled.collect::<Vec<_>>().join("<br>")
            };
            let mark = if step.judges {
                " **J**"
            } else if step.optional {
                " **O**"
            } else if step.third {
                " (three sensors)"
            } else {
                ""
            };
            let (to_do, expect) = (column(false), column(true));
            let (name, otherwise) = (&step.name, board.fill(&step.otherwise));
            writeln!(text, "| {number} {name}{mark} | {to_do} | {expect} | {otherwise} |").unwrap();
            let has_own =
                |act: &&Act| others.iter().any(|one| shown(act, one) != shown(act, board));
            let own: Vec<_> = step.acts.iter().filter(has_own).collect();
            let cell = |one: &&Board| {
                let texts = own.iter().map(|act| shown(act, one).1.replace(&one.name, "NAME"));
                texts.collect::<Vec<_>>().join("; ")
            };
            let cells: Vec<_> = others.iter().map(cell).collect();
            if cells.iter().any(|cell| !cell.is_empty() && !cell.contains("NAME")) {
                writeln!(differ, "| {number} {name} | {} |", cells.join(" | ")).unwrap();
            }
        }
    }
    let names: Vec<_> = others.iter().map(|board| format!("board `{}`", board.name)).collect();
    text += "\n## Numbers of the other boards\n\n";
    writeln!(text, "| step | {} |\n|{}", names.join(" | "), "---|".repeat(names.len() + 1))
        .unwrap();
    text.trim_start().to_owned() + &differ
}

#[test]
fn the_page_of_first_power_up_is_the_table() {
    generated::check("first-power-up.md", "first light", &page(&Table::read().unwrap()));
}

fn evidence(steps: Vec<Record>) -> Evidence {
    let (bench, board, build) = ("".into(), "reference".into(), "0".into());
    Evidence { schema: SCHEMA, bench, board, build, steps }
}

/// Over all prefixes of the table, and with every verdict on every step that judges: a step that can switch a gate on
/// is handed out only after all of the judging steps were passed.
#[test]
fn nothing_switches_the_stage_on_before_gates_and_fault_input_were_judged() {
    let table = Table::read().unwrap();
    let names: Vec<&str> = table.steps().map(|(_, step)| step.name.as_str()).collect();
    let judges: Vec<&str> =
        table.steps().filter(|(_, s)| s.judges).map(|(_, s)| s.name.as_str()).collect();
    assert!(judges.len() >= 7, "{judges:?}");
    let first = table.steps().position(|(_, step)| step.switches_on()).unwrap();
    assert_eq!(names[first], "confirm");
    let verdicts = [Verdict::Passed, Verdict::Stopped, Verdict::Skipped, Verdict::Interrupted];
    let mut energised = 0;
    for count in 0..=names.len() {
        for judge in &judges {
            for verdict in verdicts {
                let record = |name: &&str| {
                    Record::new(name, if name == judge { verdict } else { Verdict::Passed })
                };
                let steps: Vec<Record> = names[..count].iter().map(record).collect();
                let passed = names[..count].contains(judge) && verdict == Verdict::Passed;
                match table.next(&evidence(steps)) {
                    Ok(Some(ready)) if ready.place().1.switches_on() => {
                        assert!(passed && count >= first, "{count} {judge} {verdict:?}");
                        energised += 1;
                    }
                    Ok(_) | Err(_) => {}
                }
            }
        }
    }
    assert!(energised > 0);
    // A step that switches on and comes too early is refused, not walked through.
    let mut early = table.clone();
    let part = early.parts.pop().unwrap();
    early.parts.insert(0, part);
    let why = early.next(&evidence(Vec::new())).err().expect("refused").to_string();
    assert!(why.contains("commission switches the stage on before"), "{why}");
}

/// A step that switches on ends with the outputs off, so that a later step, or a later run, finds them off.
#[test]
fn a_step_that_switches_on_ends_off() {
    let table = Table::read().unwrap();
    for (_, step) in table.steps() {
        let turns =
            step.acts.iter().any(|act| matches!(act, Act::Send(line) if line.starts_with("start")));
        let ends = ["stop", "clear"]
            .map(|end| step.acts.iter().any(|act| matches!(act, Act::Send(line) if line == end)));
        let reset = step.acts.iter().any(|act| matches!(act, Act::Restart(_)));
        assert!(!turns || ends.contains(&true) || reset, "{}", step.name);
    }
}

/// Every board has all names that steps use. The test of the virtual board checks that every line of the table is understood.
#[test]
fn every_limit_is_a_number_on_every_board() {
    let table = Table::read().unwrap();
    for board in &table.boards {
        for (_, step) in table.steps() {
            for act in &step.acts {
                let is = match act {
                    Act::Measure { is, .. } | Act::Read(Read { is, .. }) => is,
                    _ => continue,
                };
                let [least, most] = is.each_ref().map(|end| board.number(end));
                assert!(least < most, "{} {}: {is:?}", board.name, step.name);
            }
        }
    }
}

/// A trace of a contributed test record, by the names of its columns.
struct Traced {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Traced {
    fn of(console: &str) -> Self {
        let mut lines = console.lines().skip_while(|line| !line.starts_with("t_s,"));
        let names = lines.next().expect("a trace").split(',').map(str::to_owned).collect();
        let row = |line: &str| line.split(',').map(|field| field.parse().ok()).collect();
        Self { names, rows: lines.map_while(row).collect() }
    }

    fn at(&self, row: usize, name: &str) -> f64 {
        self.rows[row][self.names.iter().position(|known| known == name).expect(name)]
    }

    /// Returns a vector of the estimated flux frame, in the stator frame.
    fn vector(&self, row: usize, d: &str, q: &str) -> Complex {
        let phi = self.at(row, "phi_deg").to_radians();
        Complex::new(self.at(row, d), self.at(row, q)) * Complex::new(phi.cos(), phi.sin())
    }
}

/// Returns the motor of the settings that the drive listed, with these factors of stator resistance and magnetising inductance.
fn motor(listed: &str, factors: [f64; 2]) -> (MotorModel<Machine>, f64) {
    let setting = |key: &str| -> f64 {
        let (_, rest) = listed.split_once(&format!("motor.{key} = ")).expect(key);
        rest.split([' ', '\n']).next().unwrap().parse().expect(key)
    };
    let settings = MachineSettings {
        rs: setting("r_s") * factors[0],
        rr: setting("r_r"),
        lls: setting("l_ls"),
        llr: setting("l_lr"),
        lm: setting("l_m") * factors[1],
        pole_pairs: setting("pole_pairs") as u32,
    };
    let machine = Machine::new(&settings, &SaliencySettings::NONE).unwrap();
    let shaft = MechanicsSettings { load: Load::Locked, ..MechanicsSettings::DEFAULT };
    (MotorModel::new(machine, Mechanics::new(&shaft).unwrap()), settings.lm)
}

/// Returns the differences of the replayed and the recorded current, rms and largest, as shares of the largest recorded current.
fn replayed(evidence: &Evidence, factors: [f64; 2]) -> [f64; 2] {
    let console = |name: &str| {
        let record = evidence.steps.iter().rfind(|record| record.name == name);
        record.expect(name).console.as_str()
    };
    let trace = Traced::of(console("trace"));
    let (mut motor, l_m) = motor(console("backup"), factors);
    let current = |row| trace.vector(row, "i_d_a", "i_q_a");
    let first = trace.vector(0, "i_d_a", "i_q_a");
    let phi = trace.at(0, "phi_deg").to_radians();
    let flux = l_m * trace.at(0, "i_d_a");
    motor.state.electrical.i = first;
    motor.state.electrical.psi = Complex::new(phi.cos(), phi.sin()) * flux;
    let (mut sum, mut most, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for row in 1..trace.rows.len() {
        let h = trace.at(row, "t_s") - trace.at(row - 1, "t_s");
        // A voltage acts a control period after the currents of its row: half a row.
        for from in [row.max(2) - 2, row - 1] {
            motor.step(trace.vector(from, "v_d_v", "v_q_v"), 0.5 * h);
        }
        let error = (motor.state.electrical.i - current(row)).norm();
        (sum, most) = (sum + error * error, most.max(error));
        largest = largest.max(current(row).norm());
    }
    let rms = (sum / trace.rows.len() as f64).sqrt();
    [rms / largest, most / largest]
}

/// Every file of `docs/evidence/` is complete, and its trace fits the motor that its commissioning has identified.
#[test]
fn contributed_evidence_is_whole_and_its_trace_is_that_of_its_motor() {
    let table = Table::read().unwrap();
    let folder = generated::root().join("docs/evidence");
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let files: Vec<_> =
        files.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    assert!(!files.is_empty());
    for path in files {
        let evidence = Evidence::open(&path).unwrap().unwrap();
        let left = table.next(&evidence).unwrap().map(|ready| ready.place().1.name.clone());
        assert_eq!(left, None, "{path:?}");
        if evidence.verdict("trace") == Some(Verdict::Skipped) {
            continue;
        }
        let errors = replayed(&evidence, [1.0, 1.0]);
        assert!(errors[0] < 0.05 && errors[1] < 0.15, "{path:?}: {errors:?}");
        // The bounds distinguish another motor from this one.
        for factors in [[1.3, 1.0], [0.7, 1.0]] {
            let wrong = replayed(&evidence, factors);
            assert!(wrong[0] > 0.05, "{path:?} {factors:?}: {wrong:?}");
        }
    }
}
