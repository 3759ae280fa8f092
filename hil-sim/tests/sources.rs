//! The printed values of both sources beside ours: every one has a verdict, and the errata agree with the runs.

use std::sync::LazyLock;

use hil_sim::Config;
use hil_sim::experiments::source::errata::{ERRATA, OWN};
use hil_sim::experiments::source::evidence::Evidence;
use hil_sim::experiments::source::{Class, PRINTED, number, place_of, value_of};
use hil_sim::experiments::{self, SOURCES};
use hil_sim::outcome::{Against, Cell, Compared};

use crate::generated;

/// All experiments that report printed values, with the default settings and seed 1.
static EVIDENCE: LazyLock<Evidence> = LazyLock::new(|| {
    let mut evidence = Evidence::default();
    for name in SOURCES.iter() {
        evidence.add(name, &experiments::run(name, &Config::default(), 1).expect(name));
    }
    evidence
});

#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn every_printed_value_has_a_verdict_and_the_errata_hold() {
    assert_eq!(EVIDENCE.faults(), Vec::<String>::new());
    // Verdicts: equal, equal but for unit or last digits, input, differs, unknown, within the spread over seeds, none.
    let against = [Against::Nothing, Against::Print, Against::Program, Against::Simulation];
    let counts = ["S1", "S0"].map(|source| against.map(|one| EVIDENCE.count(source, Some(one))));
    let s1 = [
        [0, 0, 70, 0, 2, 0, 0],
        [45, 7, 0, 18, 0, 0, 0],
        [95, 37, 0, 8, 0, 0, 0],
        [20, 0, 0, 17, 31, 0, 0],
    ];
    let s0 = [
        [0, 0, 5, 0, 11, 0, 0],
        [3, 0, 0, 0, 0, 0, 0],
        [28, 0, 0, 0, 0, 0, 0],
        [11, 0, 0, 139, 12, 50, 0],
    ];
    assert_eq!(counts, [s1, s0]);
    let k_ft = place_of("S1", "Eq. 3.20", "k_FT").expect("Eq. 3.20");
    assert_eq!(EVIDENCE.verdict(k_ft).0, Class::Differs);
}

/// Each section has a value that a change of the program can make differ.
#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn every_printed_section_reads_the_program() {
    let reads = |k: &usize| EVIDENCE.against(*k) >= Against::Program;
    let read: Vec<_> = (0..PRINTED.len()).filter(reads).map(|k| &PRINTED[k].chapter).collect();
    let unread: Vec<_> = PRINTED.iter().filter(|p| !read.contains(&&p.chapter)).collect();
    assert!(unread.is_empty(), "{unread:?}");
}

/// A chapter shows its figures, and its formulas name the quantities of the source.
#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn chapters_have_their_figures_and_readable_formulas() {
    let chapters = EVIDENCE.chapters();
    let of = |name: &str| chapters.iter().find(|chapter| chapter.name == name).expect(name);
    let has = |figure: &str| {
        let figures = of("S1-4.2").outcome.figures.iter();
        figures.filter(|one| one.source.starts_with(figure)).count()
    };
    assert!(has("Figure 38") > 0 && has("Figure 39") > 0);
    let cells = chapters[1..].iter().flat_map(|c| c.outcome.tables[0].rows.iter().flatten());
    let coded: Vec<_> = cells.filter(|cell| cell.text().contains(['{', '*'])).collect();
    assert!(coded.is_empty(), "{coded:?}");
    let text = |cells: &[Cell]| cells.iter().map(Cell::text).collect::<Vec<_>>().join(" ");
    let rows = of("S1-3.6.1").outcome.tables[0].rows.iter().map(|row| text(row));
    assert!(rows.into_iter().any(|row| row.contains("0.5 · voltage / current")));
}

/// Returns the verdict on a value that stands beside a printed value of a source, together with the formula of the list.
fn verdict(ours: &Compared) -> Class {
    let mut outcome = hil_sim::Outcome::default();
    outcome.compared.push(ours.clone());
    let mut evidence = Evidence::default();
    evidence.add("one", &outcome);
    evidence.verdict(place_of(ours.source, &ours.place, &ours.quantity).expect("in the list")).0
}

#[test]
fn a_verdict_looks_at_each_value_to_half_a_unit_of_the_last_digit() {
    let of = |quantity: &str| Compared::with("S1", "section 3.6.2", quantity);
    // 8.37 is printed, and the formula of the list gives 8.3653.
    assert_eq!(verdict(&of("|z_rb|").simulated(8.374)), Class::Equal);
    assert_eq!(verdict(&of("|z_rb|").simulated(8.376)), Class::None);
    // An input that a run takes from the list is judged by what the simulation reads.
    let differs = verdict(&of("theta_rb").simulated(0.733));
    assert_eq!(differs, Class::Differs);
    // A mean of random runs: 34.484 is printed.
    let mean = |ends| {
        let ours = Compared::with("S0", "Table 2, B, r_s", "Sg 50 us").simulated(30.0);
        verdict(&Compared { seeds: Some(ends), ..ours })
    };
    assert_eq!(mean([25.0, 35.0]), Class::WithinSpread);
    assert_eq!(mean([25.0, 34.0]), Class::Differs);
}

#[test]
fn a_comparison_is_neither_true_nor_false_by_construction() {
    let holds = ["1 < 2", "2 < 2", "3 - 1 > 2*0.9", "abs(sin(PI/4) - sin(3*PI/4)) > 0.001"];
    let value = |formula| value_of("S1", formula);
    assert_eq!(holds.map(value), [Some(1.0), Some(0.0), Some(1.0), Some(0.0)]);
}

/// Values that were typed from the sources a second time, by hand.
#[test]
fn the_list_is_what_the_sources_print() {
    let typed = include_str!("typed_values.txt").lines().filter(|line| !line.starts_with('#'));
    for line in typed {
        let [source, place, quantity, value] = line.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{line}");
        };
        let found = place_of(source, place, quantity).map(|k| PRINTED[k].value.as_str());
        assert_eq!(found, Some(value), "{line}");
    }
    let mut keys: Vec<_> = PRINTED.iter().map(|p| (&p.source, &p.place, &p.quantity)).collect();
    keys.sort_unstable();
    assert!(keys.windows(2).all(|pair| pair[0] != pair[1]), "a value stands twice");
}

/// A constant of the program or of the list that is off by a percent changes a verdict.
#[test]
fn a_wrong_constant_is_seen() {
    let compared = |place: &str, quantity: &str| {
        let outcomes = ["printed-numbers", "filters"]
            .map(|name| experiments::run(name, &Config::default(), 1).expect(name));
        let all = outcomes.into_iter().flat_map(|outcome| outcome.compared);
        let used = |one: &Compared| one.place == place && one.quantity == quantity;
        all.into_iter().find(used).expect(place)
    };
    for (place, quantity) in
        [("section 3.6.3", "L_m"), ("Table 7, i = 3", "a (LPF)"), ("Eq. 3.44", "z_s")]
    {
        let ours = compared(place, quantity);
        let verdict = |used: f64| verdict(&ours.clone().used(used));
        let used = ours.used.expect("a constant of the program");
        assert_ne!(verdict(used), Class::None, "{place}");
        assert_eq!(verdict(1.01 * used), Class::None, "{place}");
    }
    assert_eq!(number("S1", "Table 2, U_0", "v_a"), 2.0 / 3.0);
}

#[test]
#[ignore = "a table of the documents: cargo xtask test"]
fn the_errata_are_those_of_the_runs() {
    let mut text = String::new();
    let mut group = "";
    for erratum in ERRATA.iter() {
        for test in &erratum.tests {
            assert!(generated::root().join(test).is_file(), "{}: no {test}", erratum.place);
        }
        if group != erratum.group {
            group = &erratum.group;
            text +=
                &format!("\n## {group}\n\n| place | printed | holds | by |\n|---|---|---|---|\n");
        }
        let code = |run: &&str| if *run == OWN { OWN.to_owned() } else { format!("`{run}`") };
        let runs: Vec<_> = EVIDENCE.runs_of(erratum).iter().map(code).collect();
        let cells = [&erratum.place, &erratum.printed, &erratum.holds(), &runs.join(", ")]
            .map(|cell| cell.replace('|', "\\|"));
        text += &format!("| {} |\n", cells.join(" | "));
    }
    generated::check("errata.md", "errata", &text);
}
