//! Random numbers.

use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Returns the generator of a seed.
pub fn seeded(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// Returns 1 or -1 at random.
pub fn sign(random: &mut impl Rng) -> f64 {
    if random.random::<bool>() { 1.0 } else { -1.0 }
}
