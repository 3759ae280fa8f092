//! The time that `cargo xtask test` may take: 30 minutes on two quiet cores.

use std::time::Duration;

/// Minutes of each step.
const STEPS: [(&str, f64); 11] = [
    ("format", 0.2),
    ("rooms", 0.1),
    ("lints", 2.0),
    ("host tests", 5.0),
    ("documentation", 0.7),
    ("drive-core for the controller", 0.5),
    ("lints of the firmware", 0.5),
    ("firmware", 2.0),
    ("the image on the virtual board", 6.0),
    ("campaign of faults", 2.0),
    ("cycles of the control interrupt", 1.0),
];

/// Minutes kept for tests to come.
const KEPT: [(&str, f64); 3] = [("boards", 4.0), ("any motor and plant", 3.0), ("rest", 3.0)];

/// Prints the time of each step beside its budget; warns when the whole budget is exceeded.
pub fn report(times: &[(String, Duration)]) {
    let mut taken = 0.0;
    println!("\n{:<34}{:>8}{:>8}", "step", "minutes", "budget");
    for (name, budget) in STEPS {
        let time = times.iter().filter(|(step, _)| step == name).map(|(_, time)| time);
        let minutes = time.sum::<Duration>().as_secs_f64() / 60.0;
        println!("{name:<34}{minutes:>8.1}{budget:>8.1}");
        taken += minutes;
    }
    for (name, budget) in KEPT {
        println!("{:<34}{:>8}{budget:>8.1}", format!("kept for {name}"), "");
    }
    let whole: f64 = STEPS.iter().chain(&KEPT).map(|(_, budget)| budget).sum();
    println!("{:<34}{taken:>8.1}{whole:>8.1}", "all");
    if taken > whole {
        println!("\nWARNING: the test took {taken:.0} minutes, its budget is {whole:.0}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_budget_is_half_an_hour() {
        let sum = |rows: &[(&str, f64)]| rows.iter().map(|(_, minutes)| minutes).sum::<f64>();
        assert!((sum(&STEPS) - 20.0).abs() < 1e-9);
        assert!((sum(&KEPT) - 10.0).abs() < 1e-9);
    }
}
