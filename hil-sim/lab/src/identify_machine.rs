//! Which machine the tables of Jacobina, Lima, Ribeiro 1996 were made with.

use sim_bench::prelude::*;

use crate::identification::{Parameters, ratios};

/// Numbers that do not depend on the noise.
pub const EXPERIMENT: Experiment = Experiment {
    name: "identify-machine",
    stands_for: "Jacobina 1996, Tables 1 to 6",
    about: "Numbers that follow from the printed tables whatever the noise, beside those of the \
            machine of Table 6 and of one inferred from them.",
    uses: &[],
    not: &[],
    run,
};

fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut table = Table::new("Deterministic ratios", &[]);
    let mut outcome = Outcome::default();
    let (mut px, mut rbv) = (0.0f64, 0.0f64);
    for ratio in ratios::all() {
        table.record([
            ("quantity", Cell::from(ratio.quantity)),
            ("h (µs)", Cell::fixed(1e6 * ratio.h, 0)),
            ("printed", Cell::significant(ratio.printed, 3)),
            ("PX", Cell::significant(ratio.px, 3)),
            ("PX/printed", Cell::fixed(ratio.px / ratio.printed, 3)),
            ("rbv", Cell::significant(ratio.rbv, 3)),
            ("rbv/printed", Cell::fixed(ratio.rbv / ratio.printed, 3)),
        ]);
        px = px.max((ratio.px / ratio.printed).ln().abs());
        rbv = rbv.max((ratio.rbv / ratio.printed).ln().abs());
    }
    outcome.metrics.set("px_largest_factor", px.exp());
    outcome.metrics.set("rbv_largest_factor", rbv.exp());
    outcome.tables.push(table.note(
        "h_0b / h_1b: both have the same absolute error, so their relative errors in Tables 1 and 4 \
         have the inverse ratio of their values. (1 - f_11)/2: what separates σ l_s by Models B \
         and C in Tables 2 and 3. The error of τ_r by Model B is almost all bias.",
    ));
    let mut machines = Table::new("Machines", &[]);
    for (name, machine) in [("PX", Parameters::PX), ("rbv", Parameters::RBV)] {
        let Parameters { r_s, tau_r, sigma_l_s, l_s, .. } = machine;
        machines.record([
            ("machine", Cell::from(name)),
            ("r_s (Ω)", Cell::fixed(r_s, 3)),
            ("τ_r (s)", Cell::fixed(tau_r, 5)),
            ("σ l_s (H)", Cell::fixed(sigma_l_s, 6)),
            ("l_s (H)", Cell::fixed(l_s, 4)),
            ("r_s/(σ l_s) (1/s)", Cell::fixed(r_s / sigma_l_s, 1)),
        ]);
    }
    outcome.tables.push(machines);
    outcome.remark(
        "The simulated tables were not made with the machine of Table 6 (rbv). PX is inferred from \
         the tables; the paper does not name it. Errors in % do not depend on the level of voltage \
         or impedance, so only r_s/(σ l_s), τ_r and l_s/(σ l_s) can be inferred at all.",
    );
    Ok(outcome)
}
