//! The result of a learning as values in the flash. Either all of them are present or none.
//!
//! | index | value |
//! |---|---|
//! | 0 to 14 | reference at the currents of its table, except at zero |
//! | 15 to 29 | carrier current at the same, 0 where it was not learned |
//! | 30 | asymmetry of the reference |
//! | 31, 32 | gain mismatch, its misfit |
//! | 33, 34 | saliency of the current, its misfit |
//! | 35 | saliency of the flux |
//! | 36 | points in the lowest byte, then a bit each: gains, saliency of the current, carrier |
//! | 37 | distance of the points, A; 0.25 where a record of an earlier firmware lacks it |
//!
//! All but number 36 are in single precision.

use drive_core::identify::learning::{Fitted, Learned};
use drive_core::settings::table::{CarrierTable, Grid, POINTS, ReferenceTable};

use crate::hash;

/// Number of values.
pub const WORDS: usize = STEP + 1;
/// A bit for each value that every firmware writes.
const NEEDED: u64 = (1 << STEP) - 1;
/// The name that their ids derive from, and that a rejection states.
pub const NAME: &str = "learned";

const REFERENCE: usize = 0;
const CARRIER: usize = REFERENCE + POINTS - 1;
const FITS: usize = CARRIER + POINTS - 1;
const FLAGS: usize = FITS + 6;
const STEP: usize = FLAGS + 1;

const HAS_GAINS: u32 = 1 << 8;
const HAS_CURRENT: u32 = 1 << 9;
const HAS_CARRIER: u32 = 1 << 10;

/// The id of a value: the hash of the name plus its index.
pub fn id(index: usize) -> u32 {
    hash::of(NAME.bytes()).wrapping_add(index as u32)
}

/// The index of the value with this id.
pub fn index(id: u32) -> Option<usize> {
    let index = id.wrapping_sub(hash::of(NAME.bytes())) as usize;
    (index < WORDS).then_some(index)
}

/// The values of a result.
pub fn to_words(learned: &Learned) -> [u32; WORDS] {
    let (gains, current) = (learned.gain_mismatch, learned.current_saliency);
    let fits = [
        learned.asymmetry,
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
        | flag(gains.accepted, HAS_GAINS)
        | flag(current.accepted, HAS_CURRENT)
        | flag(learned.carrier.is_some(), HAS_CARRIER);
    words[STEP] = learned.reference.grid().step_a().to_bits();
    words
}

/// The result with these values, if it is one that a learning accepts. `present` has a bit for each value that was
/// read.
pub fn from_words(words: &[u32; WORDS], present: u64) -> Option<Learned> {
    let grid = match present {
        NEEDED => Grid::REFERENCE,
        _ if present == NEEDED | 1 << STEP => Grid::of_step(f32::from_bits(words[STEP]))?,
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
    let learned = Learned {
        reference: ReferenceTable::from_points(grid, table(words, REFERENCE, 0.0))?,
        carrier: carrier.filter(|_| flags & HAS_CARRIER != 0),
        points: (flags & 0xff) as usize,
        asymmetry: value(FITS),
        gain_mismatch: fitted(FITS + 1, HAS_GAINS),
        current_saliency: fitted(FITS + 3, HAS_CURRENT),
        flux_saliency: value(FITS + 5),
        accepted: true,
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
