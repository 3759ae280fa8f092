//! Part of `cargo xtask rooms`: the modules of the firmware.
//!
//! The fewer files outside its folder name a module's types or its feature, the sooner it is understood, changed and left out. Tests and
//! comments do not count.

use anyhow::Result;

use crate::{budget, run, sources};

/// Prints the files that name each module; fails above a budget, or if the firmware does not compile with no module, or with one alone.
pub fn check() -> Result<()> {
    let alone = "check --package induction-drive --no-default-features";
    run::step("no modules", &mut run::cargo(alone))?;
    for (module, (feature, most)) in budget::read()?.modules {
        if !feature.is_empty() {
            let check = format!("{alone} --features {feature}");
            run::step(&format!("{module} alone"), &mut run::cargo(&check))?;
        }
        let mut files = sources::files("rs")?;
        files.retain(|file| file.starts_with("src") && !file.iter().any(|part| part == "tests"));
        let own = [format!("src/{module}/"), format!("src/{module}.rs")];
        let mut found = Vec::new();
        for file in files.iter().map(|file| file.to_string_lossy()) {
            let outside =
                !own.iter().any(|own| file.starts_with(own)) && !file.ends_with("tests.rs");
            if outside && names(&sources::read(&*file)?, &module, &feature) {
                found.push(file);
            }
        }
        println!("\n{module} is named in {}", found.join(", "));
        run::limit(&format!("files that name {module}"), found.len(), most, "files")?;
    }
    Ok(())
}

/// Whether a line of code names the module in a path, or its feature.
fn names(text: &str, module: &str, feature: &str) -> bool {
    let names = [format!("{module}::"), format!("::{module}"), format!("feature = \"{feature}\"")];
    let mut code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.any(|line| names.iter().any(|name| line.contains(name)))
}
