//! The recorded scenes: the simulated bench, and the requests and events of each scene, which are in `scenes.txt`.

use std::fmt::Write as _;
use std::sync::LazyLock;

use drive_core::learned::Learned;
use drive_core::{Drive, Hardware, Sample, State};
use hil_sim::Config;
use hil_sim::config::plant_settings;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::plant::{Load, Plant};
use hil_sim::rig::{RATE_HZ, Rig};

use induction_drive::settings::FirmwareSettings;

use super::learned;
use super::player::Player;

/// A recorded run.
pub struct Scene {
    pub name: &'static str,
    /// Changes of the configuration, `key=value`.
    keys: Vec<&'static str>,
    /// Whether the drive begins with the result of the scene `learning`.
    learned: bool,
    lines: Vec<&'static str>,
}

/// All scenes.
pub static SCENES: LazyLock<Vec<Scene>> = LazyLock::new(|| {
    let lines = include_str!("scenes.txt").lines();
    let mut scenes: Vec<Scene> = Vec::new();
    for line in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
        match (line.strip_prefix("scene "), scenes.last_mut()) {
            (Some(head), _) => {
                let (name, rest) = head.split_once(' ').unwrap_or((head, ""));
                let (keys, learned) = if rest == "learned" {
                    (vec![], true)
                } else {
                    (rest.split_terminator(' ').collect(), false)
                };
                scenes.push(Scene { name, keys, learned, lines: Vec::new() });
            }
            (None, Some(scene)) => scene.lines.push(line),
            (None, None) => panic!("{line}: no scene has begun"),
        }
    }
    scenes
});

/// The bench of a recording.
pub struct Bench {
    pub rig: Rig,
    player: Player,
    pub samples: Vec<Sample>,
    pub orders: String,
}

impl Scene {
    /// The configuration: for the whole speed range, without a self-commissioning before the start.
    pub fn config(&self) -> Config {
        let keys = [&self.keys[..], &["injection.allow_unlearned=yes"]].concat();
        for_the_range(&Config::load(None, None, &keys).unwrap()).unwrap()
    }

    /// The drive, off.
    pub fn drive(&self) -> Drive {
        static LEARNED: LazyLock<Learned> = LazyLock::new(learned);
        let mut coefficients = self.config().drive.build().unwrap();
        if self.learned {
            coefficients.take(&LEARNED);
        }
        Drive::new(coefficients)
    }

    /// Its settings, with those of the reference board.
    pub fn firmware_settings(&self) -> FirmwareSettings {
        FirmwareSettings { drive: self.config().drive, ..FirmwareSettings::of_the_board() }
    }

    /// Plays the scene on the simulated bench.
    pub fn play(&self) -> Bench {
        let config = self.config();
        let plant = Plant::new(&plant_settings(&config), 1).unwrap();
        let rig = Rig::of(plant, self.drive());
        let player = Player::new(&self.firmware_settings());
        let mut bench = Bench { rig, player, samples: Vec::new(), orders: String::new() };
        self.lines.iter().for_each(|line| bench.play(line));
        bench
    }
}

impl Bench {
    fn play(&mut self, line: &str) {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |word: &str| word.parse().unwrap_or_else(|_| panic!("{line}"));
        match words[..] {
            ["shaft", "locked"] => self.rig.set_load(Load::Locked).unwrap(),
            ["shaft", "free", torque] => {
                self.rig.set_load(Load::Free { torque: number(torque) }).unwrap();
            }
            ["shaft", rpm] => {
                self.rig.turn(number(rpm)).unwrap();
            }
            [seconds, "s"] => self.run(number(seconds)),
            ["until", state] => self.until(state),
            ["fault"] => self.fails(|_| {}),
            ["fault", place, value] => {
                let value = number(value) as u16;
                self.fails(|sample| match place {
                    "current_a" => sample.current_a = value,
                    "current_b" => sample.current_b = value,
                    "hardware" => sample.hardware = Hardware::from_bits_retain(value as u8),
                    _ => panic!("{line}"),
                });
            }
            _ => {
                writeln!(self.orders, "{} {line}", self.samples.len()).unwrap();
                self.player.order(&mut self.rig.drive, line);
            }
        }
    }

    fn step(&mut self, disturb: impl Fn(&mut Sample)) {
        let mut sample = self.rig.plant.sample();
        disturb(&mut sample);
        self.samples.push(sample);
        self.rig.step_with(&sample);
        self.player.end_period(&mut self.rig.drive);
    }

    fn run(&mut self, seconds: f64) {
        (0..(seconds * RATE_HZ) as u32).for_each(|_| self.step(|_| {}));
    }

    /// Runs until the drive is in this state, or has commissioned.
    fn until(&mut self, state: &str) {
        for _ in 0..(120.0 * RATE_HZ) as u32 {
            let now = format!("{:?}", self.rig.drive.state());
            if now == state || state == "commissioned" && self.player.has_commissioned {
                return;
            }
            self.step(|_| {});
        }
        panic!("not {state} within 120 s: {}", self.rig.drive.state());
    }

    /// Disturbs one sample, or several, after which the drive is in fault.
    fn fails(&mut self, disturb: impl Fn(&mut Sample)) {
        for _ in 0..6000 {
            self.step(&disturb);
            if let State::Fault(_) = self.rig.drive.state() {
                self.run(0.2);
                return;
            }
        }
        panic!("no fault");
    }
}
