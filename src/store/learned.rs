//! The result of a saliency self-commissioning as values in the flash. Either all of them are present or none.
//!
//! | index | value |
//! |---|---|
//! | 0 to 14 | saliency offset at the currents of its table, except at zero |
//! | 15 to 29 | injection current at these currents, 0 where it was not learned |
//! | 30 | spread of the even part of the saliency offset |
//! | 31, 32 | gain mismatch, its misfit |
//! | 33, 34 | saliency of the current, its misfit |
//! | 35 | saliency of the flux |
//! | 36 | points in the lowest byte, then a bit each: gains, saliency of the current, injection current, saliency sensitivity, both zero vectors, asymmetry at the start, two bits that earlier firmware set; rotor positions in the third byte; present rules in the lowest bit of the fourth |
//! | 37 | distance of the points, A |
//! | 38 to 53 | saliency sensitivity at the currents of its table, 0 where it was not learned |
//! | 54 | largest q-axis current, A |
//! | 55 to 57 | asymmetry: constant, sine, cosine |
//! | 58 to 60 | asymmetry at the start: constant, sine, cosine, 0 where it was not measured |
//!
//! All values except number 36 are in single precision. Earlier firmware learned with other rules of the torque, with another
//! compensation of the dead time, or in a frame rotated by a rotor time constant that its commissioning had measured at another current
//! than the drive's. Its results do not fit this drive: they are left out, and the motor has to be commissioned and learned again.

use core::mem::offset_of;

use bytemuck::{Pod, Zeroable, must_cast};
use drive_core::carrier::Asymmetry;
use drive_core::learned::{Fitted, Learned, Verdict};
use drive_core::table::{CarrierTable, Grid, POINTS, ReferenceTable, SlopeTable};

use crate::hash;

/// The values in their order.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Stored {
    reference: [f32; POINTS - 1],
    carrier: [f32; POINTS - 1],
    spread: f32,
    gain_mismatch: [f32; 2],
    current_saliency: [f32; 2],
    flux_saliency: f32,
    flags: u32,
    step_a: f32,
    slope: [f32; POINTS],
    limit_a: f32,
    asymmetry: [f32; 3],
    at_start: [f32; 3],
}

/// Number of values.
pub const WORDS: usize = size_of::<Stored>() / 4;
/// A bit for each value.
pub const ALL: u64 = (1 << WORDS) - 1;
/// The name from which their ids derive, and which a rejection states.
pub const NAME: &str = "learned";

const FLAGS: usize = offset_of!(Stored, flags) / 4;
/// Position of the count of rotor positions in its word.
const POSITIONS: u32 = 16;
const HAS_GAINS: u32 = 1 << 8;
const HAS_CURRENT: u32 = 1 << 9;
const HAS_CARRIER: u32 = 1 << 10;
const HAS_SLOPE: u32 = 1 << 11;
const IN_BOTH: u32 = 1 << 12;
const HAS_START: u32 = 1 << 13;
/// Set by the present rules. Firmware that set bit 14 compensated the dead time by the sign of the mean current of a period; firmware
/// that also set bit 15 measured the rotor time constant at another current than the drive's.
const TODAYS_RULES: u32 = 1 << 24;

/// The id of a value: the hash of the name plus its index.
pub fn id(index: usize) -> u32 {
    hash::of(NAME.bytes()).wrapping_add(index as u32)
}

/// The index of the value with this id.
pub fn index(id: u32) -> Option<usize> {
    let index = id.wrapping_sub(hash::of(NAME.bytes())) as usize;
    (index < WORDS).then_some(index)
}

/// Whether a result with these values was learned with the currents of both zero vectors.
pub fn in_both(words: &[u32; WORDS]) -> bool {
    words[FLAGS] & IN_BOTH != 0
}

/// Whether a result with these values was learned by earlier firmware with other rules. `present` has a bit for each value that was read.
pub fn is_of_other_rules(words: &[u32; WORDS], present: u64) -> bool {
    present & 1 << FLAGS != 0 && words[FLAGS] & TODAYS_RULES == 0
}

/// The values of a result, and whether it was learned with the currents of both zero vectors.
pub fn to_words(learned: &Learned, both: bool) -> [u32; WORDS] {
    let flag = |set: bool, bit: u32| if set { bit } else { 0 };
    let fitted = |Fitted { value, misfit, .. }| [value, misfit];
    let asymmetry = |Asymmetry { constant, sin, cos }| [constant, sin, cos];
    let [_, reference @ ..] = *learned.reference.points();
    let [_, carrier @ ..] = learned.carrier.map_or([0.0; POINTS], |table| *table.points());
    must_cast(Stored {
        reference,
        carrier,
        spread: learned.spread,
        gain_mismatch: fitted(learned.gain_mismatch),
        current_saliency: fitted(learned.current_saliency),
        flux_saliency: learned.flux_saliency,
        flags: learned.points as u32
            | u32::from(learned.positions) << POSITIONS
            | flag(learned.gain_mismatch.accepted, HAS_GAINS)
            | flag(learned.current_saliency.accepted, HAS_CURRENT)
            | flag(learned.carrier.is_some(), HAS_CARRIER)
            | flag(learned.slope.is_some(), HAS_SLOPE)
            | flag(learned.at_start.is_some(), HAS_START)
            | flag(both, IN_BOTH)
            | TODAYS_RULES,
        step_a: learned.reference.grid().step_a(),
        slope: learned.slope.map_or([0.0; POINTS], |table| *table.points()),
        limit_a: learned.limit_a,
        asymmetry: asymmetry(learned.asymmetry),
        at_start: asymmetry(learned.at_start.unwrap_or_default()),
    })
}

/// The result with these values, if it is one that a self-commissioning accepts.
pub fn from_words(words: &[u32; WORDS]) -> Option<Learned> {
    let stored: Stored = must_cast(*words);
    let has = |flag: u32| stored.flags & flag != 0;
    let grid = Grid::of_step(stored.step_a)?;
    let fitted = |[value, misfit]: [f32; 2], flag| Fitted { value, misfit, accepted: has(flag) };
    let asymmetry = |[constant, sin, cos]: [f32; 3]| Asymmetry { constant, sin, cos };
    let carrier = CarrierTable::from_points(grid, from_zero(1.0, &stored.carrier));
    let slope = SlopeTable::from_points(grid, stored.slope);
    if (has(HAS_CARRIER) && carrier.is_none()) || (has(HAS_SLOPE) && slope.is_none()) {
        return None;
    }
    let slope = slope.filter(|_| has(HAS_SLOPE));
    let learned = Learned {
        reference: ReferenceTable::from_points(grid, from_zero(0.0, &stored.reference))?,
        carrier: carrier.filter(|_| has(HAS_CARRIER)),
        points: (stored.flags & 0xff) as usize,
        slope,
        slope_at_rest: slope.map_or(0.0, |slope| slope.at_rest()),
        limit_a: stored.limit_a,
        spread: stored.spread,
        ripple: 0.0,
        asymmetry: asymmetry(stored.asymmetry),
        at_start: has(HAS_START).then(|| asymmetry(stored.at_start)),
        positions: (stored.flags >> POSITIONS) as u8,
        gain_mismatch: fitted(stored.gain_mismatch, HAS_GAINS),
        current_saliency: fitted(stored.current_saliency, HAS_CURRENT),
        flux_saliency: stored.flux_saliency,
        verdict: slope.map_or(Verdict::Sound, |slope| Verdict::of_slope(slope.at_rest())),
    };
    learned.is_believable().then_some(learned)
}

/// The points of a table with this value at zero, followed by the others.
fn from_zero(at_zero: f32, others: &[f32; POINTS - 1]) -> [f32; POINTS] {
    let mut points = [at_zero; POINTS];
    points[1..].copy_from_slice(others);
    points
}
