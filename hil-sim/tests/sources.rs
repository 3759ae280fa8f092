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

/// Values that were typed from the sources a second time, by hand. They were drawn from all numbers of both, by line and position.
#[test]
fn the_list_is_what_the_sources_print() {
    #[rustfmt::skip] // as many values as a line holds
    let typed = [
        ("S1", "Table 6, 0.5 A", "k_phi", "1.6145"), ("S0", "Tables 1 to 3", "speed", "375"), ("S1", "Table 6, 0.5 A", "Re p", "0.98668"),
        ("S0", "section 5", "M, measurements", "7"), ("S1", "Figure 22, level 3", "reference of i_q", "-2"),
        ("S0", "Table 4, f_0a", "Sg 200 us", "0.5968"), ("S1", "section 3.7", "fictitious frequency of the pole from the parameters", "1073"),
        ("S0", "Table 1, f_1b", "Sg 200 us", "4.7585"), ("S1", "section 3.10", "frequency of the pole of Eq. 3.42", "300.88"),
        ("S0", "Table 3, B, sigma_l_s", "Ss 200 us", "3.4407"), ("S1", "Table 7, i = 2", "b (LPF)", "15.501482170609810"),
        ("S1", "section 3.10", "cut-off frequency of PP", "100"), ("S1", "section 3.7", "fictitious frequency of the identified pole", "376"),
        ("S1", "Table 2, U_0", "v_b", "-1/3"), ("S0", "Table 5, sigma_l_s", "Ss 200 us", "5.2166"),
        ("S0", "Table 3, B, omega_m", "Ss 50 us", "0.6512"), ("S0", "Table 4, f_0b", "Sg 50 us", "9.4762"), ("S0", "section 5", "h_1", "50"),
        ("S0", "Table 1, f_0a", "Ss 50 us", "0.0178"), ("S0", "Table 6, rbv", "tau_r", "0.0427"), ("S1", "section 3.6.1", "r_s", "5.4"),
        ("S0", "Table 5, tau_r", "Sg 200 us", "14.394"), ("S1", "Table 2, U_180", "v_ab", "-1"), ("S1", "Table 4, 3 A", "n_ADC, channel A", "3375"),
        ("S1", "Figure 13", "sampling frequency", "6"), ("S0", "Table 1, h_0a", "Ss 200 us", "0.4305"),
        ("S1", "section 3.6.2", "L_l1 = L_l2", "27.6"), ("S1", "section 3.9", "total delay of an edge", "4.4"),
        ("S0", "Table 4, f_0a", "Ss 100 us", "0.1341"), ("S0", "Table 4, h_0a", "Ss 50 us", "2.2932"), ("S1", "Eq. 3.44", "z_s", "0.90"),
        ("S0", "Table 1, f_1b", "Ss 50 us", "0.5208"), ("S1", "Table 8, i = 2", "a (PP)", "5.61267070060141027"),
        ("S0", "Table 2, C, sigma_l_s", "Sg 50 us", "0.9470"), ("S1", "Table 2, U_180", "v_b", "1/3"),
        ("S1", "Table 8, i = 1", "a (BPF)", "-2.99899648142248898"), ("S1", "Table 2, U_60", "v_ca", "-1"), ("S1", "Table 3", "rated power", "1.1"),
        ("S0", "section 6", "lambda", "0.999"), ("S0", "Table 2, C, l_s", "Sg 100 us", "2.3822"), ("S1", "Table 2, U_240", "v_ab", "0"),
        ("S0", "Table 1, h_0b", "Sg 50 us", "19.967"), ("S1", "section 3.6.3", "L_m", "177.1"), ("S0", "Table 1, h_0b", "Ss 200 us", "1.9111"),
        ("S0", "Table 5, sigma_l_s", "Sg 200 us", "8.3994"), ("S0", "Table 5, r_s", "Ss 200 us", "9.7060"), ("S1", "Table 2, U_60", "v_a", "1/3"),
        ("S0", "Table 3, B, sigma_l_s", "Ss 50 us", "1.2353"), ("S1", "Table 7, i = 4", "a (LPF)", "37.322148071647149"),
        ("S0", "Table 1, h_0b", "Ss 100 us", "5.9875"), ("S1", "Table 7, i = 1", "a (LPF)", "-6.311293551201974"),
        ("S1", "section 4.1", "runs of the current loop for each run of the position loop", "60"), ("S0", "Table 4, f_0b", "Ss 50 us", "9.9194"),
        ("S1", "Figure 28", "delay from the command to the first switch", "2.2"), ("S1", "Figure 40", "limit of the control effort", "0.15"),
        ("S1", "section 3.6.2", "frequency", "15"), ("S1", "section 3.8", "crossover over frequency of the zero", "4"),
        ("S1", "Figure 38", "reference of current, first level", "1"), ("S0", "Table 1, h_0a", "Sg 200 us", "1.4377"),
        ("S1", "Eq. 3.5", "slope of I_A", "0.0022120"), ("S1", "Eq. 3.5", "offset of I_B", "-4.4966238"), ("S1", "Eq. 3.3", "f_c", "5305"),
        ("S1", "section 3.2", "positive full scale, channel B", "4.6432"), ("S1", "Table 3", "starting current I_p/I_n", "7.8"),
        ("S1", "Table 3", "rated current, star", "2.56"), ("S1", "Table 4, -3 A", "n_ADC, channel A", "666"),
        ("S1", "Table 4, 3 A", "n_ADC, channel B", "3356"), ("S1", "section 3.6.2", "theta_rb", "0.671"), ("S1", "Eq. 3.20", "k_FT", "0.01973"),
        ("S1", "Eq. 3.22", "T_FT", "1.0157"), ("S1", "Eq. 3.34", "gain", "0.0040532"),
        ("S1", "section 3.7", "real frequency of the pole from the parameters", "977.6"), ("S1", "Figure 24", "crossover, fictitious", "204.5"),
        ("S1", "section 3.8", "k_c", "52.48"), ("S1", "Eq. 3.41", "pole", "0.9511"), ("S1", "Eq. 3.44", "k_s", "0.132546"),
        ("S1", "Table 6, 1.5 A", "k_phi", "5.9470"), ("S1", "Table 6, 3.0 A", "Im p", "0.06461"), ("S1", "Eq. 4.1", "gain", "0.01716"),
        ("S1", "Eq. 4.2", "zero", "0.974"), ("S1", "Table 8, i = 2", "b (PP)", "0.00535736614345009"), ("S0", "Table 1, h_1b", "Sg 50 us", "10609"),
        ("S0", "Table 2, C, tau_r", "Sg 50 us", "9.8831"), ("S0", "Table 5, omega_m", "Ss 200 us", "8.6050"),
        ("S0", "Table 7, Ss", "omega_m", "56.14"), ("S0", "Figure 3", "convergence time of r_s and tau_r, the slowest, Sg", "0.8"),
    ];
    for (source, place, quantity, value) in typed {
        let found = place_of(source, place, quantity).map(|k| PRINTED[k].value.as_str());
        assert_eq!(found, Some(value), "{source} {place}, {quantity}");
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
