//! Any file of a user of the simulator is accepted, or refused by a message that may be sent to a terminal.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use hil_sim::config::{Config, Key};
use hil_sim::console::update::Image;
use hil_sim::experiments::scenario::Scenario;
use hil_sim::journal::{Header, Journal};
use hil_sim::{error, passport};
use induction_drive_fuzz::sum;
use libfuzzer_sys::fuzz_target;

/// Words of the files beside the keys.
const OTHERS: &str = "time_s torque_current_a speed_rpm position_turns load_nm load_rpm torque_current load [[part]] [settings] \
    [[metrics]] [[judge]] [[panel]] [[source]] seconds start stop coast ramp quick figure title source columns samples remarks of \
    statistic over within lines label dashed keys from unverified after. drive. true false 1e300 1e9 nan inf -0 null schema image \
    measured over_torque_current twin step name value deviation unit experiment seed index count runs run record version \
    sources schema_version settings commissioning: learned: nameplate refused spread effective";

/// The text of an input: a byte from 0xe0 and the next one stand for a word, which the fuzzer does not find letter by letter.
fn text(bytes: &[u8]) -> String {
    static WORDS: LazyLock<Vec<&str>> =
        LazyLock::new(|| OTHERS.split_whitespace().chain(Key::all().map(Key::name)).collect());
    let (mut text, mut bytes) = (Vec::new(), bytes.iter());
    while let Some(&byte) = bytes.next() {
        match byte {
            0xe0.. => {
                let n = usize::from(byte - 0xe0) << 8 | usize::from(*bytes.next().unwrap_or(&0));
                text.extend(WORDS[n % WORDS.len()].bytes());
            }
            _ => text.push(byte),
        }
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// An image for `cargo sim update`, and changes of it: place and value of a word, and whether the check sum is correct.
fn image(bytes: &[u8]) -> Vec<u8> {
    const LIST: usize = 0x200;
    let mut words = vec![0xffff_ffff_u32; 3 * 512];
    let list = [0, LIST, LIST, LIST + 36, LIST + 36, 2048, 2048, 4096];
    (0..8).for_each(|n| words[LIST / 4 + n] = 0x0800_0000 + list[n] as u32);
    for change in bytes.chunks_exact(6) {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % words.len();
        words[at] = u32::from_le_bytes([change[2], change[3], change[4], change[5]]);
    }
    let sealed =
        |words: &[u32]| -> Vec<u8> { words.iter().flat_map(|w| w.to_le_bytes()).collect() };
    if bytes.len() % 2 == 0 {
        let all = sealed(&words);
        let mut pieces = Vec::new();
        for two in words[LIST / 4..LIST / 4 + 8].chunks_exact(2) {
            let [from, to] = [two[0], two[1]].map(|at| at.wrapping_sub(0x0800_0000) as usize);
            pieces.extend(all.get(from..to).unwrap_or_default());
        }
        words[LIST / 4 + 8] = sum(&pieces);
    }
    sealed(&words)
}

/// Opens a file of finished runs, behind the head of this experiment if `known`.
fn resume(path: &Path, known: bool, config: &Config) -> Result<(), hil_sim::Error> {
    let header = Header::new("battery", config, 1, 10)?;
    if known {
        let text = std::fs::read(path).expect("read");
        let head = serde_json::to_vec(&header).expect("JSON");
        std::fs::write(path, [&head, b"\n".as_slice(), &text].concat()).expect("written");
    }
    Journal::open(path, &header).map(drop)
}

fuzz_target!(|bytes: &[u8]| {
    static FOLDER: LazyLock<std::path::PathBuf> = LazyLock::new(|| {
        let folder = std::env::temp_dir().join(format!("fuzz-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        folder
    });
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let (text, config) = (text(bytes), Config::default());
    let file = |name: &str| {
        let path = FOLDER.join(name);
        std::fs::write(&path, &text).expect("written");
        path
    };
    let load = |motor: Option<&Path>, file: Option<&Path>| {
        let motor = motor.map(|path| path.to_string_lossy().into_owned());
        Config::load(motor.as_deref(), file, &[""; 0]).map(drop)
    };
    let read = match kind % 8 {
        0 => Scenario::of_csv(&file("profile.csv"), &config).map(drop),
        1 => Scenario::read(&file("scenario.toml"), &config).map(drop),
        2 => load(None, Some(&file("config.toml"))),
        3 => load(Some(&file("motor.toml")), None),
        4 => load(Some(&file("passport.json")), None),
        5 => resume(&file("runs"), *kind >= 128, &config),
        6 => passport::of_console(&text).map(drop).map_err(hil_sim::Error::Refused),
        _ => Image::new(image(bytes)).map(drop).map_err(hil_sim::Error::refused),
    };
    if let Err(why) = read {
        let told = error::message(&why);
        let shown = |c: char| !c.is_control() || matches!(c, '\n' | '\t');
        assert!(told.chars().all(shown), "{told:?}");
        assert!(told.lines().all(|line| line.chars().count() < 1500), "{told}");
    }
});
