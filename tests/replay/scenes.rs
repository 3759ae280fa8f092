//! The recorded scenes: the simulated bench, and the requests and events of each scene.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::sync::LazyLock;

use drive_core::learned::Learned;
use drive_core::{Drive, Hardware, Sample, State};
use hil_sim::Config;
use hil_sim::config::plant_settings;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::plant::{Load, Plant};
use hil_sim::rig::{RATE_HZ, Rig};

use super::learned;
use super::player::Player;

/// A recorded run.
pub struct Scene {
    pub name: &'static str,
    /// Changes of the configuration, `key=value`.
    keys: &'static [&'static str],
    /// Whether the drive begins with the result of the scene `learning`.
    learned: bool,
    script: fn(&mut Bench),
}

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
        let keys = [self.keys, &["injection.allow_unlearned=yes"]].concat();
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

    /// Plays the scene on the simulated bench.
    pub fn play(&self) -> Bench {
        let config = self.config();
        let plant = Plant::new(&plant_settings(&config), 1).unwrap();
        let rig = Rig::of(plant, self.drive());
        let player = Player::new(&config.drive);
        let mut bench = Bench { rig, player, samples: Vec::new(), orders: String::new() };
        (self.script)(&mut bench);
        bench
    }
}

impl Bench {
    fn order(&mut self, line: &str) {
        writeln!(self.orders, "{} {line}", self.samples.len()).unwrap();
        self.player.order(&mut self.rig.drive, line);
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

    /// Runs until the condition on the drive, or the bench, is true; at most for this number of seconds.
    fn until(&mut self, seconds: f64, is_so: impl Fn(&Drive, &Player) -> bool) {
        for _ in 0..(seconds * RATE_HZ) as u32 {
            if is_so(&self.rig.drive, &self.player) {
                return;
            }
            self.step(|_| {});
        }
        panic!("not within {seconds} s: {}", self.rig.drive.state());
    }

    fn until_state(&mut self, wanted: State) {
        self.until(120.0, |drive, _| drive.state() == wanted);
    }

    /// Starts and waits until the drive is in this state.
    fn start(&mut self, line: &str, wanted: State) {
        self.order(line);
        self.until_state(wanted);
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

    fn load(&mut self, load: Load) {
        self.rig.set_load(load).unwrap();
    }

    fn turn_at(&mut self, rpm: f64) {
        self.load(Load::Speed { speed: rpm * TAU / 60.0 });
    }
}

const FREE: Load = Load::Free { torque: 0.0 };

pub const SCENES: &[Scene] = &[
    Scene {
        name: "volts_per_hertz",
        keys: &[],
        learned: false,
        script: |bench| {
            bench.load(FREE);
            bench.order("check wiring");
            bench.start("start vf", State::VoltsPerHertz);
            bench.run(1.0);
            bench.order("speed 600");
            bench.run(2.0);
            bench.load(Load::Free { torque: 1.5 });
            bench.run(0.5);
            bench.order("stop ramp");
            bench.run(0.2);
            bench.order("stop quick");
            bench.until_state(State::Off);
        },
    },
    Scene {
        name: "turning_start",
        keys: &[],
        learned: true,
        script: |bench| {
            for (rpm, torque) in [(400.0, "torque 1"), (-1500.0, "torque -1")] {
                bench.turn_at(rpm);
                bench.run(1.0);
                bench.start("start torque", State::Torque);
                bench.order(torque);
                bench.run(0.4);
                // The next start finds the remaining flux.
                bench.order("stop");
                bench.until_state(State::Off);
                bench.run(0.1);
                bench.start("start torque", State::Torque);
                bench.order(torque);
                bench.run(0.3);
                bench.order("stop");
                bench.until_state(State::Off);
            }
        },
    },
    Scene {
        name: "stopped_starts",
        keys: &[],
        learned: true,
        script: |bench| {
            bench.turn_at(1200.0);
            bench.run(0.5);
            bench.start("start torque", State::Torque);
            bench.run(0.2);
            bench.order("stop");
            bench.until_state(State::Off);
            // Stops during the search, then while the flux builds up, each time with remaining flux.
            for seconds in [0.015, 0.4] {
                bench.run(0.02);
                bench.start("start torque", State::FlyingStart);
                bench.run(seconds);
                bench.order("stop");
                bench.until_state(State::Off);
            }
            bench.start("start torque", State::Torque);
            bench.order("torque 1");
            bench.run(0.3);
            bench.order("stop");
            bench.until_state(State::Off);
            // Stops at rest, while the drive magnetises and while it verifies the lock.
            bench.turn_at(0.0);
            bench.run(1.0);
            for state in [State::Magnetising, State::Verifying] {
                bench.start("start torque", state);
                bench.run(0.1);
                bench.order("stop");
                bench.until_state(State::Off);
                bench.run(0.1);
            }
        },
    },
    Scene {
        name: "learning",
        keys: &[],
        learned: false,
        script: |bench| {
            bench.load(Load::Locked);
            bench.start("learn", State::Learning);
            bench.until_state(State::Off);
            bench.run(1.0);
            bench.start("start torque", State::Torque);
            bench.order("torque 1.5");
            bench.run(0.5);
            bench.order("relock");
            bench.until_state(State::Torque);
            bench.order("torque -2");
            bench.run(0.5);
            bench.order("stop");
            bench.until_state(State::Off);
        },
    },
    Scene {
        name: "commissioning",
        keys: &["nameplate.speed_rpm=1715"],
        learned: false,
        script: |bench| {
            bench.load(Load::Locked);
            bench.order("commission");
            bench.until(60.0, |_, player| player.has_commissioned);
            bench.order("accept");
            bench.run(0.5);
            bench.start("start torque", State::Torque);
            bench.order("torque 1");
            bench.run(0.3);
        },
    },
    Scene {
        name: "stops",
        keys: &[],
        learned: true,
        script: |bench| {
            bench.load(FREE);
            for stop in ["stop ramp", "stop quick", "stop"] {
                bench.start("start speed", State::Speed);
                bench.order("speed 300");
                bench.run(0.8);
                bench.order("jog 100");
                bench.run(0.7);
                bench.order("speed 300");
                bench.run(0.5);
                bench.order(stop);
                if stop == "stop ramp" {
                    bench.run(0.05);
                    bench.order("stop quick");
                }
                bench.until_state(State::Off);
                bench.load(Load::Locked);
                bench.run(2.0);
                bench.load(FREE);
            }
            // Stops in the middle of a start.
            for after in [0.1, 0.3, 0.6] {
                bench.order("start torque");
                bench.run(after);
                bench.order("stop");
                bench.until_state(State::Off);
                bench.run(1.0);
            }
        },
    },
    Scene {
        name: "stopped_learning",
        keys: &[],
        learned: false,
        script: |bench| {
            bench.load(Load::Locked);
            bench.start("learn", State::Learning);
            bench.run(3.0);
            bench.order("stop");
            bench.until_state(State::Off);
            // A stop during the magnetising before the self-commissioning.
            bench.order("learn");
            bench.run(1.0);
            bench.order("stop");
            bench.until_state(State::Off);
        },
    },
    Scene {
        name: "faults",
        keys: &[],
        learned: false,
        script: |bench| {
            bench.load(Load::Locked);
            let start = |bench: &mut Bench| {
                bench.start("start torque", State::Torque);
                bench.order("torque 1.5");
                bench.run(0.3);
            };
            start(bench);
            bench.fails(|sample| sample.current_a = 4000);
            bench.order("clear");
            start(bench);
            bench.fails(|sample| sample.hardware = Hardware::BREAK);
            bench.order("clear");
            start(bench);
            bench.fails(|sample| sample.current_b = 2010);
            bench.order("clear");
            start(bench);
            // The lock is lost: the dynamometer accelerates the shaft faster than the angle is tracked.
            bench.turn_at(-3000.0);
            bench.fails(|_| {});
        },
    },
    Scene {
        name: "weakening",
        keys: &[],
        learned: true,
        script: |bench| {
            bench.load(FREE);
            bench.start("start speed", State::Speed);
            bench.order("speed 2900");
            bench.run(3.0);
            bench.load(Load::Free { torque: 0.6 });
            bench.run(0.5);
            bench.order("speed -600");
            bench.run(3.0);
            bench.order("stop quick");
            bench.until_state(State::Off);
        },
    },
    Scene {
        name: "position",
        keys: &[],
        learned: true,
        script: |bench| {
            bench.load(FREE);
            bench.start("start position", State::Position);
            bench.order("position 0.5");
            bench.run(1.5);
            bench.order("press 30 0.8");
            bench.run(1.0);
            bench.order("origin 0.25");
            bench.run(1.0);
            bench.order("stop");
            bench.until_state(State::Off);
        },
    },
    Scene {
        name: "encoder_speed",
        keys: &["angle_source=encoder"],
        learned: false,
        script: |bench| {
            bench.load(FREE);
            bench.start("start speed", State::Speed);
            bench.order("speed 1500");
            bench.run(2.0);
            bench.order("magnetising 0.5");
            bench.run(0.5);
            bench.order("stop ramp");
            bench.until_state(State::Off);
        },
    },
];
