//! Changes around the drive while it runs: load, motor, wires and sensors.

use std::f64::consts::TAU;

use induction_drive::boards::{ANALOG, CONTACTS, TERMINALS};
use induction_drive::terminals::Contacts;
use motor_plant::{Channel, CurrentFault, Load, Plant, PlantSettings, SaliencySettings};

/// The allowed words.
const WORDS: &str = "load locked, load free NM, load speed RPM, turn DEG, open a|b|c|none, saliency \
                     SHARE, warm PERCENT, sensor a|b none|open|high|low, dc VOLT, strip CONTACT ...";

/// Changes the plant, which began with the settings `healthy`, as requested by these words.
///
/// | words | effect |
/// |---|---|
/// | `load locked`, `load free NM`, `load speed RPM` | blocks the shaft, brakes it with a torque, turns it |
/// | `turn DEG` | rotates the motor's flux by an electrical angle at once, so that the drive's angle is off by this angle |
/// | `open a`, `b`, `c`, `none` | opens the wire of a phase, or closes all |
/// | `saliency SHARE` | remaining share of the saliency of the cold motor; 0 is the textbook machine |
/// | `warm PERCENT` | resistances of stator and rotor above those at the start |
/// | `sensor a FAULT`, `b FAULT` | a current sensor: `none`, `open` (reads no current), `high`, `low` (at an end of the range) |
/// | `dc VOLT` | voltage of the dc link |
///
/// # Errors
/// The error, and the allowed words.
pub fn change(plant: &mut Plant, healthy: &PlantSettings, words: &str) -> Result<(), String> {
    let words: Vec<&str> = words.split_whitespace().collect();
    let number = |word: &str| {
        let value = word.parse().ok().filter(|value: &f64| value.is_finite());
        value.ok_or_else(|| format!("{word}: a number is expected"))
    };
    let done = match words[..] {
        ["load", "locked"] => plant.set_load(Load::Locked),
        ["load", "free", nm] => plant.set_load(Load::Free { torque: number(nm)? }),
        ["load", "speed", rpm] => plant.set_load(Load::Speed { speed: number(rpm)? * TAU / 60.0 }),
        ["turn", degrees] => {
            plant.turn_rotor_flux(number(degrees)?.to_radians());
            Ok(())
        }
        ["open", phase] => {
            let phases = [("none", None), ("a", Some(0)), ("b", Some(1)), ("c", Some(2))];
            plant.set_open_phase(named(phase, &phases)?)
        }
        ["saliency", share] => {
            let (share, own) = (number(share)?, healthy.saliency);
            let s = SaliencySettings { a_psi: share * own.a_psi, b1: share * own.b1, ..own };
            plant.set_saliency(&healthy.machine, &s)
        }
        ["warm", percent] => {
            let (own, factor) = (healthy.machine, 1.0 + number(percent)? / 100.0);
            plant.set_resistances(own.rs * factor, own.rr * factor)
        }
        ["sensor", channel, fault] => {
            let channel = named(channel, &[("a", Channel::A), ("b", Channel::B)])?;
            let faults = [
                ("none", CurrentFault::None),
                ("open", CurrentFault::Open),
                ("high", CurrentFault::SaturatedHigh),
                ("low", CurrentFault::SaturatedLow),
            ];
            plant.set_current_fault(channel, named(fault, &faults)?);
            Ok(())
        }
        ["dc", volts] => plant.set_dc_link(number(volts)?),
        _ => return Err(WORDS.to_owned()),
    };
    done.map_err(|why| why.to_string())
}

/// The contacts of the terminal strip with these names.
///
/// # Errors
/// The unknown name, and the names that exist.
pub fn contacts(names: &str) -> Result<Contacts, String> {
    let all = &TERMINALS[ANALOG..ANALOG + CONTACTS];
    let known: Vec<(&str, u8)> = all.iter().enumerate().map(|(n, name)| (*name, 1 << n)).collect();
    names.split_whitespace().try_fold(Contacts(0), |closed, name| {
        Ok(Contacts(closed.0 | named(&name.to_ascii_uppercase(), &known)?))
    })
}

/// The value of a word.
fn named<T: Copy>(word: &str, of: &[(&str, T)]) -> Result<T, String> {
    of.iter().find(|(name, _)| *name == word).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = of.iter().map(|(name, _)| *name).collect();
        format!("{word}: allowed is {}", names.join(", "))
    })
}
