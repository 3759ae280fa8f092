use super::*;
use crate::generated;

/// The numbers are used in logs and manuals, so this list may grow, but no entry may change.
#[test]
fn codes_never_change() {
    let table = [
        (1, Fault::OverCurrentA),
        (2, Fault::OverCurrentB),
        (3, Fault::OverCurrentC),
        (4, Fault::DcLinkOverVoltage),
        (5, Fault::DcLinkUnderVoltage),
        (6, Fault::OverSpeed),
        (7, Fault::SensorSaturatedA),
        (8, Fault::SensorSaturatedB),
        (9, Fault::CarrierMissingA),
        (10, Fault::CarrierMissingB),
        (11, Fault::CurrentNotAsPredicted),
        (12, Fault::LostAngle),
        (13, Fault::NonFiniteSettings),
        (14, Fault::NonFiniteCommand),
        (15, Fault::NonFiniteState),
        (16, Fault::OffsetA),
        (17, Fault::OffsetB),
        (18, Fault::OverTemperature),
        (19, Fault::Encoder),
        (20, Fault::Break),
        (21, Fault::AnalogWatchdog),
        (22, Fault::DeadlineMiss),
        (23, Fault::ConverterOverrun),
        (25, Fault::NoSaliency),
        (26, Fault::LostLock),
        (27, Fault::ShaftNotLocked),
        (28, Fault::NothingLearned),
        (29, Fault::CarrierWeak),
        (30, Fault::WiringNoCurrent),
        (31, Fault::WiringPolarityA),
        (32, Fault::WiringPolarityB),
        (33, Fault::WiringExchanged),
        (34, Fault::WiringCurrent),
        (35, Fault::CarrierNoRoom),
        (36, Fault::SensorNoisyA),
        (37, Fault::SensorNoisyB),
        (38, Fault::SensorSaturatedC),
        (39, Fault::OffsetC),
        (40, Fault::CurrentSum),
        (41, Fault::FluxNotAsPredicted),
        (42, Fault::SlopeTooSmall),
        (43, Fault::MotorOverload),
        (44, Fault::InverterOverload),
        (45, Fault::ThermistorOpen),
        (46, Fault::ThermistorShorted),
        (47, Fault::NotCaught),
        (48, Fault::Stalled),
        (49, Fault::ChopperOff),
        (50, Fault::WrongClock),
        (51, Fault::WrongReference),
        (52, Fault::SensorSilentA),
        (53, Fault::SensorSilentB),
        (54, Fault::MotorSensorOpen),
        (55, Fault::MotorSensorShorted),
        (56, Fault::MotorHot),
        (57, Fault::MotorSensorUnread),
        (58, Fault::TorqueNotProven),
    ];
    for (code, fault) in table {
        assert_eq!(fault.code(), code);
    }
    assert_eq!(table.len(), Fault::ALL.len());
}

/// Texts are plain ASCII, and short enough for a line of the console together with the state of the drive.
#[test]
fn texts_fit_a_line_of_the_console() {
    for fault in Fault::ALL {
        for text in fault.causes().iter().chain([&fault.text(), &fault.cure()]) {
            assert!(text.is_ascii() && text.len() <= 110, "{text}");
            assert!(!text.ends_with('.') && !text.contains(['"', '\\']), "{text}");
        }
        assert!(fault.text().len() <= 80, "{fault}");
    }
}

/// The page of the faults lists each fault with its text and a link to its section, which gives at least one cause, and the cure.
#[test]
fn the_manual_says_the_same() {
    let manual = std::fs::read_to_string(generated::root().join("docs/faults.md")).unwrap();
    let sections: Vec<_> =
        manual.lines().filter_map(|line| line.strip_prefix("## Fault")).collect();
    let mut table = "| | meaning | cause and cure |\n|---|---|---|\n".to_owned();
    for fault in Fault::ALL {
        let section = sections.iter().find(|heading| numbers(heading).contains(&fault.code()));
        let section = section.unwrap_or_else(|| panic!("no section for {}", fault.code()));
        let anchor: String =
            section.chars().filter(|c| c.is_ascii_alphanumeric() || " -".contains(*c)).collect();
        let anchor = anchor.to_lowercase().replace(' ', "-");
        table += &format!("| {} | {fault} | [cure](#fault{anchor}) |\n", fault.code());
        assert!(!fault.causes().is_empty() && !fault.cure().is_empty(), "{fault}");
    }
    generated::check("faults.md", "faults", &table);
}

/// Returns the faults of a heading: " 4: ...", "s 1 to 3: ...", "s 7, 8 and 38: ...".
fn numbers(heading: &str) -> Vec<u8> {
    let (list, _) = heading.split_once(':').expect("numbers");
    let found: Vec<u8> = list.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    if list.contains(" to ") { (found[0]..=found[1]).collect() } else { found }
}
