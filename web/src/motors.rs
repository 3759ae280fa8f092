//! The motors that a page can show, each with the sensors that suit it.

use drive_settings::{Settings, find};
use motor_plant::PlantSettings;

/// The motors, from the folder `motors`; `tests/motors.rs` writes the file. A line with name and title begins a motor. The second line has
/// the numbers of [`Motor::suit`], each further line a setting of the drive and its value.
const FILE: &str = include_str!("../motors.txt");

/// A motor of the file.
#[derive(Clone, Copy)]
pub struct Motor {
    /// Name of its file in the folder `motors`.
    pub name: &'static str,
    /// Its rated data in words.
    pub title: &'static str,
    numbers: &'static str,
    settings: &'static str,
}

impl Motor {
    /// All motors; the first is that of the drive's default settings.
    pub fn all() -> impl Iterator<Item = Self> {
        FILE.split("\n\n").filter_map(|text| {
            let (head, rest) = text.split_once('\n')?;
            let (name, title) = head.split_once(": ")?;
            let (numbers, settings) = rest.split_once('\n').unwrap_or((rest, ""));
            Some(Self { name, title, numbers, settings })
        })
    }

    /// The motor of this name.
    ///
    /// # Errors
    /// The unknown name, and the names that exist.
    pub fn named(name: &str) -> Result<Self, String> {
        Self::all().find(|motor| motor.name == name).ok_or_else(|| {
            let names: Vec<_> = Self::all().map(|motor| motor.name).collect();
            format!("motor {name}: this page cannot show it; it has {}", names.join(", "))
        })
    }

    /// Sets the drive to the motor and its sensors. A test reads every line.
    pub fn set(&self, settings: &mut Settings) {
        for (name, value) in self.settings.lines().filter_map(|line| line.split_once(' ')) {
            if let Some(entry) = find(name)
                && let Ok(value) = entry.parse(value)
            {
                entry.set(settings, value);
            }
        }
    }

    /// Sets the plant to the motor and its sensors. A test compares the result with the simulator's plant.
    pub fn suit(&self, plant: &mut PlantSettings) {
        let PlantSettings { machine: m, saliency: s, mechanics, inverter, measurement, .. } = plant;
        let mut pole_pairs = 0.0;
        let places = [
            &mut m.rs,
            &mut m.rr,
            &mut m.lls,
            &mut m.llr,
            &mut m.lm,
            &mut pole_pairs,
            &mut s.b1,
            &mut s.hold_a,
            s.psi_n.insert(0.0),
            &mut mechanics.inertia,
            &mut mechanics.friction,
            &mut inverter.vdc,
            &mut inverter.residual_v,
            &mut measurement.range_a,
            &mut measurement.noise_a,
            &mut measurement.dc_link_v,
        ];
        let numbers = self.numbers.split(' ').flat_map(str::parse);
        places.into_iter().zip(numbers).for_each(|(place, number)| *place = number);
        m.pole_pairs = pole_pairs as u32;
    }
}
