//! The reference of the printed angle error: Eq. 2.10 beside a drive whose frame is right. If the rotor time constant of Eq. 2.10 is
//! wrong, it shows an angle error that the drive does not have.

use super::LEVELS_A;
use crate::prelude::*;

/// Adds the table, the curve and the numbers of the erratum.
pub fn add(context: &Context<'_>, outcome: &mut Outcome, panel: Panel) -> Result<Panel, Error> {
    // The factor by which Eq. 3.20 and 3.22 are off.
    let slip = source::value_of("S1", "r_t*{Eq. 3.20 | k_FT}").unwrap_or(f64::NAN);
    let shares = [slip, 0.07, 0.19, 0.5, 1.0, 2.0];
    let mut config = context.config.clone();
    config.load.mode = LoadMode::Locked;
    let mut rig = Rig::started(&config, context.seed, Mode::Torque)?;
    let (start, tau_r) = (rig.time(), rig.plant.tau_r());
    // The rotor flux over L_m by Eq. 2.10, for each share. The rotor does not turn.
    let mut flux = shares.map(|_| Complex64::ZERO);
    let (mut shown, mut torque, mut trace) = (Vec::new(), Vec::new(), Vec::new());
    for level in LEVELS_A {
        rig.command(&Command::Torque(level as f32))?;
        let (mut errors, mut of_level) = (shares.map(|_| Stats::default()), Stats::default());
        for n in 1..=RATE_HZ as usize {
            let i = rig.plant.current();
            rig.step();
            let phi = TAU * f64::from(rig.drive.telemetry().phi.to_turns());
            for (flux, share) in flux.iter_mut().zip(shares) {
                *flux += (i - *flux) / (share * tau_r * RATE_HZ);
            }
            let error = flux.map(|flux| wrapped_degrees(flux.arg() - phi));
            if n % 60 == 0 {
                trace.push((rig.time() - start, error[0]));
            }
            if n > RATE_HZ as usize / 2 {
                errors.iter_mut().zip(error).for_each(|(stats, error)| stats.push(error));
                of_level.push(rig.plant.torque());
            }
        }
        outcome.metrics.set(format!("eq_2_10_error_at_{level}_a_deg"), errors[0].mean());
        shown.push(errors);
        torque.push(of_level.mean());
    }
    let mut table = texts::table("as-printed", "beside");
    for (k, share) in shares.iter().enumerate() {
        let cell = |(iq, errors): (&f64, &[Stats; 6])| {
            (format!("{iq} A (°)"), Cell::fixed(errors[k].mean(), 1))
        };
        let head = ("share of τ_r".to_owned(), Cell::significant(*share, 3));
        table.record(std::iter::once(head).chain(LEVELS_A.iter().zip(&shown).map(cell)));
    }
    outcome.tables.push(table);
    outcome.metrics.set("right_frame_torque_ratio", torque[4] / torque[0]);
    for (which, torque) in [("least", torque[0]), ("largest", torque[4])] {
        let place = beside("Abstract", &format!("torque produced, {which}"));
        outcome.compared.push(place.simulated(torque));
    }
    Ok(panel.with(Series::line("frame right, shown by Eq. 2.10 with a wrong τ_r", trace)))
}
