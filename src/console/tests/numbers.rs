//! Permanent numbers: of settings with their words, signals, faults and records, commands, and registers.
//!
//! `tests/numbers.txt` has every number that was ever given, one per line: `KIND NUMBER NAME`, or `KIND NUMBER retired: NAME`. A new one
//! is added with `WRITE_DOCS=1`. If an item is renamed, its name in the file is changed by hand; nothing else of the file ever changes.

use std::collections::{BTreeMap, BTreeSet};
use std::{env, fs};

use drive_settings::entry;
use drive_settings::entry::{Access, Entry};
use drive_settings::value::Words;

use super::*;
use crate::console::grammar::{COMMANDS, NUMBERS};
use crate::desk::handle::DriveHandle as _;
use crate::generated;
use crate::modbus::float::to_float;
use crate::modbus::registers::{self, ROWS};
use crate::modbus::tests::beside_console::Both;
use crate::monitor::record::Reason;
use crate::recording::trace::{self, SIGNALS, Sampled};
use crate::settings::keys::Key;
use crate::store::codec::Rejected;

const FILE: &str = "tests/numbers.txt";
const RETIRED: &str = "retired: ";

/// A number: kind and number as in the list, and name.
type Given = (String, String);

fn given(kind: &str, number: impl ToString, name: impl ToString) -> Given {
    (format!("{kind} {}", number.to_string()), name.to_string())
}

/// The numbers that the code declares.
fn declared() -> Vec<Given> {
    let mut all: Vec<_> =
        ROWS.iter().map(|row| given("register", format!("0x{:04x}", row.at), row.help)).collect();
    all.extend(keys::all().map(|key| given("setting", key.id(), key.name())));
    for key in keys::all() {
        let words = (0..).zip(key.words());
        all.extend(words.map(|(n, word)| given("word", format!("{}.{n}", key.id()), word)));
    }
    all.extend(SIGNALS.iter().map(|signal| given("signal", signal.id, signal.name)));
    all.extend(Fault::ALL.iter().map(|fault| given("fault", fault.code(), fault.text())));
    all.extend(Reason::ALL.iter().map(|(reason, text)| given("fault", *reason as u8, text)));
    for (why, text) in [
        (Rejected::Broken, "saved settings: no whole record"),
        (Rejected::Newer(9), "saved settings: of a later version"),
        (Rejected::Value(""), "saved settings: unknown value"),
        (Rejected::Refused, "saved settings: out of range"),
        (Rejected::Board(""), "saved settings: of another board"),
    ] {
        all.push(given("fault", why.code(), text));
    }
    all.extend(NUMBERS.iter().zip(COMMANDS).map(|(n, word)| given("command", n, word)));
    all
}

/// The lines of the list.
fn listed(list: &str) -> Vec<Given> {
    let line = |line: &str| {
        let mut words = line.splitn(3, ' ').map(str::to_owned);
        let mut word = || words.next().unwrap_or_else(|| panic!("{FILE}: {line}"));
        given(&word(), word(), word())
    };
    list.lines().map(line).collect()
}

/// Errors between the list and the declared numbers.
fn wrong(list: &[Given], declared: &[Given]) -> BTreeSet<String> {
    let mut wrong = BTreeSet::new();
    for (place, all) in [(FILE, list), ("the code", declared)] {
        let mut seen = BTreeMap::new();
        for (number, name) in all {
            if let Some(other) = seen.insert(number, name) {
                wrong.insert(format!("{number} is given twice in {place}: {other}, {name}"));
            }
        }
    }
    let names = |all: &[Given]| all.iter().cloned().collect::<BTreeMap<_, _>>();
    let (kept, now) = (names(list), names(declared));
    for (number, name) in &now {
        match kept.get(number) {
            None => wrong.insert(format!("{number} {name} is new: add this line to {FILE}")),
            Some(kept) if kept.starts_with(RETIRED) => {
                wrong.insert(format!("{number} {name}: the number of another, {kept}"))
            }
            Some(kept) if kept != name => wrong.insert(format!(
                "{number} was {kept}, is {name}: a new one takes a new number; a new name is written into {FILE}"
            )),
            Some(_) => false,
        };
    }
    let gone = kept.iter().filter(|(number, _)| !now.contains_key(*number));
    let gone = gone.filter(|(_, name)| !name.starts_with(RETIRED));
    wrong.extend(gone.map(|(n, name)| format!("{n} {name} is gone: `{n} {RETIRED}{name}`")));
    wrong
}

#[test]
fn numbers_are_for_life() {
    let path = generated::root().join(FILE);
    let mut text = fs::read_to_string(&path).unwrap();
    let declared = declared();
    if env::var_os("WRITE_DOCS").is_some() {
        let list = listed(&text);
        let is_new = |(number, _): &&Given| list.iter().all(|(kept, _)| kept != number);
        declared.iter().filter(is_new).for_each(|(n, name)| text += &format!("{n} {name}\n"));
        fs::write(&path, &text).unwrap();
    }
    let wrong = wrong(&listed(&text), &declared);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A number that changed, vanished, was given twice or belongs to another item is reported; a new name or a retirement that is in the
/// list is not.
#[test]
fn what_is_wrong_with_numbers_is_told() {
    let list = "setting 0 a\nsetting 1 b\nfault 1 c\nfault 2 retired: d\n";
    let told = |list: &str, now: &str| wrong(&listed(list), &listed(now)).len();
    for (now, wrongs) in [
        ("setting 0 a\nsetting 1 b\nfault 1 c", 0),
        ("fault 1 c\nsetting 1 b\nsetting 0 a", 0),
        // New and not in the list, vanished, renamed, another number, exchanged, taken twice, reused after retirement.
        ("setting 0 a\nsetting 1 b\nfault 1 c\nfault 3 e", 1),
        ("setting 0 a\nfault 1 c", 1),
        ("setting 0 a\nsetting 1 e\nfault 1 c", 1),
        ("setting 0 a\nsetting 2 b\nfault 1 c", 2),
        ("setting 1 a\nsetting 0 b\nfault 1 c", 2),
        ("setting 0 a\nsetting 1 b\nsetting 1 b\nfault 1 c", 1),
        ("setting 0 a\nsetting 1 b\nfault 1 c\nfault 2 d", 1),
    ] {
        assert_eq!(told(list, now), wrongs, "{now}");
    }
    let edited =
        list.replace("setting 1 b", "setting 1 e").replace("fault 1 c", "fault 1 retired: c");
    assert_eq!(told(&edited, "setting 0 a\nsetting 1 e"), 0);
    assert_eq!(told(&format!("{list}setting 0 f\n"), "setting 0 f\nsetting 1 b\nfault 1 c"), 1);
}

/// The registers of the settings follow from their numbers; all other registers of their page read as 0 and cannot be written.
#[test]
fn registers_of_settings_follow_from_their_numbers() {
    let mut both = Both::by_bus();
    let settings = both.talk.front.desk.settings().in_force();
    let expected: BTreeMap<u16, u32> =
        keys::all().map(|key| (key.id(), to_float(key, settings).to_bits())).collect();
    assert_eq!(expected.len(), keys::COUNT, "each its own");
    let last = (registers::STAGED - registers::SETTINGS) / 2;
    assert!(expected.keys().all(|id| *id < last));
    for id in 0..=last {
        let at = registers::SETTINGS + 2 * id;
        let bits = u32::from(both.read(at)) << 16
            | u32::from(if id < last { both.read(at + 1) } else { 0 });
        assert_eq!(bits, expected.get(&id).copied().unwrap_or(0), "{at:#x}");
        if !expected.contains_key(&id) {
            let [high, low] = at.to_be_bytes();
            assert_eq!(both.ask(&[16, high, low, 0, 2, 4, 0, 0, 0, 0]), [0x90, 2], "{at:#x}");
        }
    }
}

/// Each signal reads as in a trace; the other registers of the page read as 0.
#[test]
fn signals_have_registers_by_their_numbers() {
    let mut both = Both::by_bus();
    both.talk.say("start\n");
    let status = both.talk.drive.status().unwrap();
    let sampled = Sampled::new(&status.sample, status.state, status.limiting);
    let settings = both.talk.front.desk.settings().in_force().drive;
    let values = SIGNALS.iter().zip(trace::values(&status.telemetry, &sampled));
    let expected: BTreeMap<_, _> = values
        .map(|(signal, value)| (signal.id, signal.shown(value, &settings).to_bits()))
        .collect();
    assert_eq!(expected.len(), SIGNALS.len(), "each its own");
    assert!(expected.values().filter(|bits| **bits != 0).count() > 2, "{expected:?}");
    for id in 0..256 {
        let at = registers::SIGNALS + 2 * id;
        let bits = u32::from(both.read(at)) << 16 | u32::from(both.read(at + 1));
        assert_eq!(bits, expected.get(&id).copied().unwrap_or(0), "{id}");
    }
    assert_eq!(both.ask(&[16, 0x30, 0, 0, 2, 4, 0, 0, 0, 0]), [0x90, 2]);
}

/// A master set up today still works: with 20 settings inserted and five renamed, each of its numbers has the same value.
#[test]
fn inserted_and_renamed_settings_leave_the_others_where_they_are() {
    use drive_core::AngleSource;

    use FirmwareSettings as Settings;
    let leaked = |entry: Entry<Settings>| Key::Own(Box::leak(Box::new(entry)));
    let mut many: Vec<Key> = keys::all().collect();
    let renamed = [
        entry!(0: number("ohm"), "stator.ohm", [drive.motor] r_s: f32, ""),
        entry!(9: number("A"), "plate.current_a", [drive.nameplate] current_a: f32, ""),
        entry!(37: word(), "angle", [drive] angle_source: AngleSource, ""),
        entry!(101: number("s"), "command.silence_s", [command] timeout_s: f32, ""),
        entry!(105: whole(), "bus.slave", [modules.bus] address: u32, ""),
    ];
    for entry in renamed {
        let place = many.iter().position(|key| key.id() == entry.id).unwrap();
        assert_ne!(many[place].name(), entry.name);
        many[place] = leaked(entry);
    }
    for n in 0..20 {
        let access = Access::Number(|s: &Settings| s.command.timeout_s, |_, _| {});
        let place = usize::from(n) * 37 % many.len();
        many.insert(place, leaked(Entry::new(1000 + n, "inserted", "s", access, "")));
    }
    let settings = Settings::of_the_board();
    for key in keys::all() {
        let found = keys::of_id(many.iter().copied(), key.id()).unwrap();
        assert_eq!(
            to_float(found, &settings).to_bits(),
            to_float(key, &settings).to_bits(),
            "{key:?}"
        );
    }
}
