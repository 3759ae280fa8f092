//! The printed values beside ours: the results of the experiments, counted, and as chapters of a page.

use std::collections::HashMap;

use sim_bench::outcome::{Against, Cell, Compared, Outcome, Table};

use super::errata::{ERRATA, Erratum, OWN, rounded};
use super::{Class, FIGURES, Kind, PRINTED, Printed, Verdict, place_of, value_of, verdict};
use crate::texts;

/// Results of the experiments.
pub struct Evidence {
    /// Compared values by index in [`PRINTED`], with the experiments that report them.
    compared: HashMap<usize, (Vec<String>, Compared)>,
    /// Comparisons with a value that is not in the list.
    pub astray: Vec<String>,
    /// The experiments by name.
    runs: Vec<(String, Outcome)>,
}

/// Values that follow from the print itself; experiments add theirs.
impl Default for Evidence {
    fn default() -> Self {
        let of = |(place, printed): (usize, &'static Printed)| {
            let value = printed.recomputed()?;
            let ours = Compared::with(printed.source, &*printed.place, printed.quantity);
            Some((place, (Vec::new(), ours.of_print(value))))
        };
        let compared = PRINTED.iter().enumerate().filter_map(of).collect();
        Self { compared, astray: Vec::new(), runs: Vec::new() }
    }
}

impl Evidence {
    /// Adds the results of an experiment. If two experiments report a place, the columns are filled in turn; the value
    /// of a program goes before that of a formula.
    pub fn add(&mut self, experiment: &str, outcome: &Outcome) {
        for ours in &outcome.compared {
            let Compared { source, place, quantity, .. } = ours;
            let Some(place) = place_of(source, place, quantity) else {
                self.astray.push(format!("{experiment}: {source} {place}, {quantity}"));
                continue;
            };
            let known = self.compared.entry(place).or_insert_with(|| (Vec::new(), ours.clone()));
            known.0.push(experiment.to_owned());
            known.1.recomputed = ours.recomputed.or(known.1.recomputed);
            known.1.simulated = known.1.simulated.or(ours.simulated);
            known.1.used = known.1.used.or(ours.used);
            known.1.unknown = known.1.unknown.or(ours.unknown);
            known.1.against = known.1.against.max(ours.against);
        }
        self.runs.push((experiment.to_owned(), outcome.clone()));
    }

    /// Returns the experiments that report a place; none for values that follow from the print itself.
    pub fn by(&self, place: usize) -> impl Iterator<Item = &str> {
        self.compared.get(&place).into_iter().flat_map(|(names, _)| names).map(String::as_str)
    }

    /// Returns our value of a place.
    pub fn value(&self, place: usize) -> Option<f64> {
        self.compared.get(&place)?.1.value()
    }

    /// Returns a metric by `EXPERIMENT/METRIC`.
    pub fn metric(&self, name: &str) -> Option<f64> {
        let (experiment, metric) = name.split_once('/')?;
        self.runs.iter().find(|run| run.0 == experiment)?.1.metrics.get(metric)
    }

    /// Returns the origin of our value of a place.
    pub fn against(&self, place: usize) -> Against {
        self.compared.get(&place).map_or(Against::Nothing, |(_, ours)| ours.against)
    }

    /// Returns the verdict on a place.
    pub fn verdict(&self, place: usize) -> Verdict {
        let none = Compared::default();
        verdict(place, self.compared.get(&place).map_or(&none, |(_, ours)| ours))
    }

    /// Counts the printed values of a source, with ours of this origin (or any), by verdict in the order of [`Class::NAMES`].
    pub fn count(&self, source: &str, against: Option<Against>) -> [usize; 7] {
        let mut counts = [0; 7];
        for (place, printed) in PRINTED.iter().enumerate() {
            if printed.source == source && against.is_none_or(|one| one == self.against(place)) {
                counts[self.verdict(place).0 as usize] += 1;
            }
        }
        counts
    }

    /// Makes the table of the printed values of an experiment.
    pub fn table(&self, compared: &[Compared]) -> Table {
        let places = compared.iter().filter_map(|c| place_of(c.source, &c.place, &c.quantity));
        let mut places: Vec<_> = places.collect();
        places.sort_unstable();
        places.dedup();
        let rows = places.iter().map(|&place| self.row(place, &PRINTED[place]));
        let head = places.first().map_or(String::new(), |&place| PRINTED[place].head());
        Table::new(head, &[]).records(rows)
    }

    /// Returns the experiments and tests that give the numbers of an erratum, each once; [`OWN`] for values that follow
    /// from the print itself.
    pub fn runs_of<'a>(&'a self, erratum: &'a Erratum) -> Vec<&'a str> {
        let of = |[name, _]: &'a [String; 2]| match (erratum.place_of(name), name.split_once('/')) {
            (Some(place), _) => self.by(place).collect(),
            (None, Some((experiment, _))) if self.metric(name).is_some() => vec![experiment],
            _ => Vec::new(),
        };
        let mut runs: Vec<_> = erratum.numbers.iter().flat_map(of).collect();
        runs.extend(erratum.tests.iter().map(String::as_str));
        runs.sort_unstable();
        runs.dedup();
        if runs.is_empty() { vec![OWN] } else { runs }
    }

    /// Returns the faults of an erratum: a wrong form, a number that no run gives, and a number that no longer equals the shown one.
    fn faults_of(&self, erratum: &Erratum) -> Vec<String> {
        let mut faults = Vec::new();
        if erratum.holds.matches("{}").count() > erratum.numbers.len()
            || (erratum.numbers.is_empty() && erratum.tests.is_empty())
        {
            faults.push(format!("{}: a number is missing", erratum.place));
        }
        for of in &erratum.of {
            let mut named =
                (0..PRINTED.len()).filter(|&k| erratum.names(of, &PRINTED[k])).peekable();
            let differs = |k| self.verdict(k).0 == Class::Differs;
            if named.peek().is_none() || !named.all(differs) {
                let of = of.join(", ");
                faults.push(format!(
                    "{}: {of} is not in the list, or does not differ",
                    erratum.place
                ));
            }
        }
        for [name, shown] in &erratum.numbers {
            let value = match erratum.place_of(name) {
                Some(place) => self.value(place),
                None => self.metric(name).or_else(|| value_of(&erratum.source, name)),
            };
            match value {
                None => faults.push(format!("{}: no run gives {name}", erratum.place)),
                Some(value) if rounded(value, shown) != *shown => {
                    faults.push(format!("{}: {name} is {value}, shown as {shown}", erratum.place));
                }
                Some(_) => {}
            }
        }
        faults
    }

    /// Returns places without a verdict, comparisons with unknown values, and faults of the errata.
    pub fn faults(&self) -> Vec<String> {
        let none = |(number, printed): (usize, &Printed)| {
            let Printed { source, place, quantity, value, .. } = printed;
            let ours = self.value(number).map_or("nothing".to_owned(), |ours| ours.to_string());
            (self.verdict(number).0 == Class::None)
                .then(|| format!("{source} {place}, {quantity}: {value} printed, ours {ours}"))
        };
        let mut faults: Vec<_> = PRINTED.iter().enumerate().filter_map(none).collect();
        faults.extend(self.astray.iter().map(|astray| format!("not in the list: {astray}")));
        faults.extend(ERRATA.iter().flat_map(|erratum| self.faults_of(erratum)));
        faults
    }

    /// Makes the counts of the verdicts.
    pub fn counts(&self) -> Table {
        let mut table = Table::new("Printed values by verdict", &[]);
        for source in ["S1", "S0"] {
            use Against::{Nothing, Print, Program, Simulation};
            for against in [None, Some(Simulation), Some(Program), Some(Print), Some(Nothing)] {
                let (what, counts) =
                    (against.map_or("all", Against::name), self.count(source, against));
                let whole = |count: usize| Cell::fixed(count as f64, 0);
                let mut row = vec![
                    ("source", Cell::from(source)),
                    ("against", what.into()),
                    ("printed", whole(counts.iter().sum())),
                ];
                row.extend(Class::NAMES.into_iter().zip(counts.map(whole)));
                table.record(row);
            }
        }
        table
    }

    /// Makes the first page, and the chapters of both sources with printed, recomputed and simulated values.
    pub fn chapters(&self) -> Vec<Chapter> {
        let mut chapters = vec![self.first()];
        let mut homes: HashMap<&str, usize> = HashMap::new();
        for (place, printed) in PRINTED.iter().enumerate() {
            if chapters.last().is_none_or(|last| !last.is_of(printed)) {
                chapters.push(Chapter::of(printed));
            }
            let number = chapters.len() - 1;
            let chapter = &mut chapters[number];
            chapter.outcome.tables[0].record(self.row(place, printed));
            for run in self.by(place) {
                homes.entry(run).or_insert(number);
                if !chapter.runs.iter().any(|known| known == run) {
                    chapter.runs.push(run.to_owned());
                }
            }
        }
        let mut index = Vec::new();
        for chapter in &mut chapters[1..] {
            let values = chapter.outcome.tables[0].rows.len() as f64;
            chapter.outcome.metrics.set("printed_values", values);
        }
        for (experiment, outcome) in &self.runs {
            // An experiment that gives no printed value repeats a figure of S1.
            let home = homes.get(&**experiment).copied();
            if let Some(home) = home {
                chapters[home].outcome.remarks.extend_from_slice(&outcome.remarks);
            }
            let source = home.map_or("S1", |home| chapters[home].source);
            for figure in outcome.figures.iter().filter(|figure| figure.source.contains("Figure")) {
                // The figure belongs to the chapter in which the source has it.
                let number = figure.source.split([' ', ',']).nth(1).unwrap_or_default();
                let id =
                    FIGURES.get(&format!("{source} {number}")).map(|id| format!("{source}-{id}"));
                let at = chapters.iter().position(|chapter| Some(&chapter.name) == id.as_ref());
                let Some(at) = at.or(home) else { continue };
                let chapter = &mut chapters[at];
                let row = [
                    ("figure", Cell::from(&*figure.source)),
                    ("section", chapter.name.as_str().into()),
                    ("what it shows", figure.title.as_str().into()),
                ];
                index.push(((source, number.parse::<u32>().ok()), row));
                chapter.outcome.figures.push(figure.clone());
            }
        }
        index.sort_by_key(|entry| entry.0);
        let rows = index.into_iter().map(|(_, row)| row);
        chapters[0].outcome.tables.push(Table::new("Figures of the sources", &[]).records(rows));
        chapters
    }

    /// Makes the first page: counts, errata, and an explanation of the numbers.
    fn first(&self) -> Chapter {
        let mut outcome = Outcome::default();
        let equal = |source| {
            let of = |against| self.count(source, Some(against))[..2].iter().sum::<usize>();
            (of(Against::Program) + of(Against::Simulation)) as f64
        };
        outcome.metrics.set("equal_to_program_or_simulation_of_barroso_2017", equal("S1"));
        outcome.metrics.set("equal_to_program_or_simulation_of_jacobina_1996", equal("S0"));
        outcome.tables.push(self.counts());
        let errata = ERRATA.iter().zip(1..).map(|(erratum, number)| {
            [
                ("", Cell::fixed(f64::from(number), 0)),
                ("source", erratum.source.as_str().into()),
                ("place", erratum.place.as_str().into()),
                ("printed", erratum.printed.as_str().into()),
                ("what holds", erratum.holds().into()),
                ("run", self.runs_of(erratum).join(", ").into()),
            ]
        });
        outcome.tables.push(Table::new("Errata", &[]).records(errata));
        let faults = self.faults();
        if !faults.is_empty() {
            let title = "Without a verdict, or no longer as the errata say";
            outcome.texts.push((title.into(), faults.join("\n")));
        }
        texts::add_remarks(&mut outcome, "sources", &[]);
        Chapter {
            name: "sources".into(),
            source: "S1, S0",
            about: "What both sources print, counted by verdict; their errata; where their figures stand.".into(),
            runs: Vec::new(),
            outcome,
        }
    }

    fn row(&self, place: usize, printed: &Printed) -> [(&'static str, Cell); 10] {
        let ours = self.compared.get(&place).map(|(_, ours)| ours);
        let shown = |value: Option<f64>| {
            Cell::or_dash(value.map(|value| match (printed.kind, value) {
                (Kind::Claim, 0.0) => "no".into(),
                (Kind::Claim, _) => "yes".into(),
                _ => Cell::significant(value, 6),
            }))
        };
        let number = printed.number().unwrap_or(f64::NAN);
        let is_number = printed.kind != Kind::Claim;
        // The larger one, like the verdict.
        let both = ours.into_iter().flat_map(|o| [o.recomputed, o.simulated]).flatten();
        let differences = both.map(|value| 100.0 * (value / number - 1.0));
        let difference = differences.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let difference = difference.filter(|d| is_number && d.is_finite());
        let text = || printed.value.clone();
        let value = printed.number().filter(|_| is_number);
        let value =
            value.map_or_else(|| text().into(), |value| Cell::Number { value, text: text() });
        [
            ("place", Cell::from(printed.place.as_str())),
            ("quantity", printed.quantity.into()),
            ("unit", printed.unit.into()),
            ("printed", value),
            ("recomputed", shown(ours.and_then(|ours| ours.recomputed))),
            ("by", Cell::or_dash(printed.formula.as_deref().map(|text| notation(text).into()))),
            ("simulated", shown(ours.and_then(|ours| ours.simulated))),
            ("against", self.against(place).name().into()),
            ("difference (%)", Cell::fixed_or_dash(difference, 2)),
            ("verdict", self.verdict(place).1.into()),
        ]
    }
}

/// Returns a formula in the notation of the sources, with the quantity of a printed value in place of its name.
fn notation(formula: &str) -> String {
    let in_print = |(part, is_name): (&str, bool)| match part.split_once(" | ") {
        Some((_, quantity)) if is_name => quantity.to_owned(),
        _ => {
            let signs = [("TAU", "2π"), ("PI", "π"), ("sqrt", "√"), ("*", " · "), ("/", " / ")];
            signs.iter().fold(part.to_owned(), |text, (code, sign)| text.replace(code, sign))
        }
    };
    formula.split(['{', '}']).zip([false, true].into_iter().cycle()).map(in_print).collect()
}

/// A chapter of a source.
pub struct Chapter {
    /// Name on the page: source and number.
    pub name: String,
    /// `S0` or `S1`.
    pub source: &'static str,
    /// Number and title.
    pub about: String,
    /// Experiments that give its values.
    pub runs: Vec<String>,
    /// Table and figures.
    pub outcome: Outcome,
}

impl Chapter {
    fn of(printed: &'static Printed) -> Self {
        let mut outcome = Outcome::default();
        outcome.tables.push(Table::new(printed.head(), &[]));
        let name = format!("{}-{}", printed.source, printed.id);
        let about = printed.chapter.to_owned();
        Self { name, source: printed.source, about, runs: Vec::new(), outcome }
    }

    fn is_of(&self, printed: &Printed) -> bool {
        self.source == printed.source && self.about == printed.chapter
    }
}
