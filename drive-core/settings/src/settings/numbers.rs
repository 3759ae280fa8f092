//! Numbers and roundings that the rows of the settings share with the rules.

/// Factor by which rules stay within the limits of the power stage and of other settings, since they round to four digits.
pub(super) const WITHIN: f32 = 0.998;
/// Trip current as a share of the sensors' range, and in rated currents. With the first, noise and drift leave the reading of a
/// larger current at the end of the range. The second leaves enough room for the current limit with high flux. The trip has one rule
/// for any flux, because the bench steps of a board are valid for one trip and commissioning changes the flux.
pub(super) const TRIP_OF_RANGE: f32 = 0.9614;
pub(super) const TRIP_OF_RATED: f32 = 2.2;
/// Largest braking limit of the dc link, relative to the trip voltage.
pub(super) const HIGH_OF_TRIP: f32 = 0.975;
/// Least dc link at which motoring torque ends, relative to the trip voltage.
pub(super) const LOW_OF_TRIP: f32 = 1.15;
/// Relative distance of `braking.high_v` and `.low_v` from their neighbours.
pub(super) const MARGIN: f32 = 0.05;

/// Returns the value that was set or, if none was, the value of the rule, rounded to four digits.
pub(super) fn or_rule<S>(s: &S, set: Option<f32>, rule: fn(&S) -> f32) -> f32 {
    set.unwrap_or_else(|| {
        let value = f64::from(rule(s));
        // Zero has no first digit.
        let last = libm::pow(10.0, libm::floor(libm::log10(value.abs().max(1e-30))) - 3.0);
        (libm::round(value / last) * last) as f32
    })
}

/// Returns the range of a value that may have either sign, but is not zero.
pub(super) fn either_sign(value: f32, min: f32, max: f32) -> (f32, f32) {
    if value < 0.0 { (-max, -min) } else { (min, max) }
}
