//! The result of a learning as values in the flash. Either all of them are present or none.
//!
//! | index | value |
//! |---|---|
//! | 0 to 14 | reference at the currents of its table, except at zero |
//! | 15 to 29 | carrier current at the same, 0 where it was not learned |
//! | 30 | spread of the even part of the reference |
//! | 31, 32 | gain mismatch, its misfit |
//! | 33, 34 | saliency of the current, its misfit |
//! | 35 | saliency of the flux |
//! | 36 | points in the lowest byte, then a bit each: gains, saliency of the current, carrier, slope, both zero vectors, asymmetry at the start; rotor positions in the third byte, 0 counts as 1 |
//! | 37 | distance of the points, A; 0.25 where a record of an earlier firmware lacks it |
//! | 38 to 53 | slope of the saliency at the currents of its table, 0 where it was not learned |
//! | 54 | largest torque current, A |
//! | 55 to 57 | asymmetry: constant, sine, cosine |
//! | 58 to 60 | the same at the start, 0 where it was not seen |
//!
//! All but number 36 are in single precision. An earlier firmware had none from 38 on; a drive with such a record has to learn
//! again before it starts without an encoder. A later one had none from 58 on.

use drive_core::carrier::Asymmetry;
use drive_core::learned::{Fitted, Learned, Verdict};
use drive_core::table::{CarrierTable, Grid, POINTS, ReferenceTable, SlopeTable};

use crate::hash;

/// Number of values.
pub const WORDS: usize = AT_START + 3;
/// A bit for each value that every firmware writes.
const NEEDED: u64 = (1 << STEP) - 1;
/// The same of those that wrote the distance of the points, of those that wrote the asymmetry, and of all.
const WITH_STEP: u64 = (1 << SLOPE) - 1;
const WITH_ASYMMETRY: u64 = (1 << AT_START) - 1;
const ALL: u64 = (1 << WORDS) - 1;
/// The name that their ids derive from, and that a rejection states.
pub const NAME: &str = "learned";

const REFERENCE: usize = 0;
const CARRIER: usize = REFERENCE + POINTS - 1;
const FITS: usize = CARRIER + POINTS - 1;
const FLAGS: usize = FITS + 6;
const STEP: usize = FLAGS + 1;
const SLOPE: usize = STEP + 1;
const LIMIT: usize = SLOPE + POINTS;
const ASYMMETRY: usize = LIMIT + 1;
const AT_START: usize = ASYMMETRY + 3;

/// Place of the rotor positions in their word.
const POSITIONS: u32 = 16;
const HAS_GAINS: u32 = 1 << 8;
const HAS_CURRENT: u32 = 1 << 9;
const HAS_CARRIER: u32 = 1 << 10;
const HAS_SLOPE: u32 = 1 << 11;
const IN_BOTH: u32 = 1 << 12;
const HAS_START: u32 = 1 << 13;

/// The id of a value: the hash of the name plus its index.
pub fn id(index: usize) -> u32 {
    hash::of(NAME.bytes()).wrapping_add(index as u32)
}

/// The index of the value with this id.
pub fn index(id: u32) -> Option<usize> {
    let index = id.wrapping_sub(hash::of(NAME.bytes())) as usize;
    (index < WORDS).then_some(index)
}

/// Whether these values, a bit for each, are all that this or an earlier firmware writes.
pub fn is_whole(present: u64) -> bool {
    [NEEDED, WITH_STEP, WITH_ASYMMETRY, ALL].contains(&present)
}

/// Whether a result with these values was learned with the currents of both zero vectors.
pub fn in_both(words: &[u32; WORDS]) -> bool {
    words[FLAGS] & IN_BOTH != 0
}

/// The values of a result, and of whether it was learned with the currents of both zero vectors.
pub fn to_words(learned: &Learned, both: bool) -> [u32; WORDS] {
    let (gains, current) = (learned.gain_mismatch, learned.current_saliency);
    let fits = [
        learned.spread,
        gains.value,
        gains.misfit,
        current.value,
        current.misfit,
        learned.flux_saliency,
    ];
    let carrier = learned.carrier.map_or([0.0; POINTS], |table| *table.points());
    let reference = learned.reference.points().iter().skip(1);
    let values = reference.chain(carrier.iter().skip(1)).chain(&fits);
    let mut words = [0; WORDS];
    for (word, value) in words.iter_mut().zip(values) {
        *word = value.to_bits();
    }
    let flag = |set: bool, bit: u32| if set { bit } else { 0 };
    words[FLAGS] = learned.points as u32
        | u32::from(learned.positions) << POSITIONS
        | flag(gains.accepted, HAS_GAINS)
        | flag(current.accepted, HAS_CURRENT)
        | flag(learned.carrier.is_some(), HAS_CARRIER)
        | flag(learned.slope.is_some(), HAS_SLOPE)
        | flag(learned.at_start.is_some(), HAS_START)
        | flag(both, IN_BOTH);
    let slope = learned.slope.map_or([0.0; POINTS], |table| *table.points());
    let step = [learned.reference.grid().step_a()];
    let asymmetries = [learned.asymmetry, learned.at_start.unwrap_or_default()];
    let asymmetries = asymmetries.map(|Asymmetry { constant, sin, cos }| [constant, sin, cos]);
    let rest =
        step.iter().chain(&slope).chain([&learned.limit_a]).chain(asymmetries.as_flattened());
    for (word, value) in words[STEP..].iter_mut().zip(rest) {
        *word = value.to_bits();
    }
    words
}

/// The result with these values, if it is one that a learning accepts. `present` has a bit for each value that was
/// read.
pub fn from_words(words: &[u32; WORDS], present: u64) -> Option<Learned> {
    let step = || Grid::of_step(f32::from_bits(words[STEP]));
    let (grid, has_slope) = match present {
        NEEDED => (Grid::REFERENCE, false),
        WITH_STEP => (step()?, false),
        WITH_ASYMMETRY | ALL => (step()?, true),
        _ => return None,
    };
    let carrier = CarrierTable::from_points(grid, table(words, CARRIER, 1.0));
    let value = |index: usize| f32::from_bits(words[index]);
    let flags = words[FLAGS];
    let fitted = |index, bit| Fitted {
        value: value(index),
        misfit: value(index + 1),
        accepted: flags & bit != 0,
    };
    let points = (flags & 0xff) as usize;
    let slope = match flags & HAS_SLOPE != 0 {
        true if has_slope => {
            Some(SlopeTable::from_points(grid, core::array::from_fn(|n| value(SLOPE + n)))?)
        }
        true => return None,
        false => None,
    };
    let slope_at_rest = slope.map_or(0.0, |slope| slope.at_rest());
    let asymmetry =
        |index| Asymmetry { constant: value(index), sin: value(index + 1), cos: value(index + 2) };
    let learned = Learned {
        reference: ReferenceTable::from_points(grid, table(words, REFERENCE, 0.0))?,
        carrier: carrier.filter(|_| flags & HAS_CARRIER != 0),
        points,
        slope,
        slope_at_rest,
        limit_a: if has_slope { value(LIMIT) } else { grid.current(points) },
        spread: value(FITS),
        ripple: 0.0,
        asymmetry: if has_slope { asymmetry(ASYMMETRY) } else { Asymmetry::default() },
        at_start: (present == ALL && flags & HAS_START != 0).then(|| asymmetry(AT_START)),
        positions: ((flags >> POSITIONS) as u8).max(1),
        gain_mismatch: fitted(FITS + 1, HAS_GAINS),
        current_saliency: fitted(FITS + 3, HAS_CURRENT),
        flux_saliency: value(FITS + 5),
        verdict: slope.map_or(Verdict::Sound, |slope| Verdict::of_slope(slope.at_rest())),
    };
    let whole = learned.carrier.is_some() || flags & HAS_CARRIER == 0;
    (whole && learned.is_believable()).then_some(learned)
}

/// The points of a table whose values but the first, `at_zero`, begin at index `first`.
fn table(words: &[u32; WORDS], first: usize, at_zero: f32) -> [f32; POINTS] {
    let mut points = [at_zero; POINTS];
    for (point, word) in points.iter_mut().skip(1).zip(words.iter().skip(first)) {
        *point = f32::from_bits(*word);
    }
    points
}
