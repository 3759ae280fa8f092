//! `cargo sim passport`: the [passport](crate::config::passport) of a motor, from the answers to `commission` and `learn` at the console.

use drive_stream::client::split_tag;
use serde_json::Value;

use crate::config::motors::NEEDED;
use crate::config::passport::{Measured, Passport, SCHEMA};
use crate::first_light::interruptible;
use crate::first_light::wire::{Port, Wire as _};
use crate::prelude::*;

/// Settings of the drive that the simulation model takes besides those of every motor file; a setting `auto` is left to its rule.
const ALSO: &str = "motor.inertia inverter.drop_v current_plant sequence.flux sequence.i_d limits.current_a observer.leakage_share observer.leakage_slope";
/// The lines that are sent, each with the unsolicited line that ends it.
const LINES: [(&str, Option<&str>); 6] = [
    ("commission", Some("* commissioning: ended")),
    ("accept", None),
    ("learn", Some("* learned: ")),
    ("version", None),
    ("describe", None),
    ("learned", None),
];
/// Beginnings of unsolicited lines that end the session.
const STOPS: [&str; 3] = ["* fault ", "* refused: ", "* commissioning: ended; the settings are"];
/// Time between two checks for such lines, s, and the largest number of checks.
const LOOK: (f64, u32) = (0.2, 3000);

/// Options of a passport.
#[derive(Args, Clone)]
#[group(skip)]
pub struct Options {
    /// Serial port: commissions, accepts, learns and asks, with the shaft locked
    #[arg(long, value_name = "PATH", required_unless_present = "from", conflicts_with = "from")]
    port: Option<String>,
    /// Recorded console instead of a port, with commission, accept, learn, version, describe and learned
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Bits per second
    #[arg(long, value_name = "N", default_value_t = 115_200)]
    baud: u32,
    /// File of the passport; its page (.txt) and the record of the console (.log) go beside it
    #[arg(long, value_name = "FILE", default_value = "out/passport.json")]
    out: PathBuf,
}

/// Makes a passport and its page; returns the page.
///
/// # Errors
/// [`Error::Refused`] with the data that the console lacks, or if the drive refuses; [`Error::Write`].
pub fn run(options: &Options) -> Result<String, Error> {
    let text = match (&options.port, &options.from) {
        (Some(port), _) => session(port, options.baud)?,
        (None, from) => {
            let path = from.clone().unwrap_or_default();
            let failed = |why| Error::Refused(format!("--from {}: {why}", path.display()));
            bounded::text(&path).map_err(|why: std::io::Error| failed(why.to_string()))?
        }
    };
    report::write_whole(&options.out.with_extension("log"), &text)?;
    write(&of_console(&text).map_err(Error::Refused)?, &options.out)
}

/// Writes a passport and its page; returns the page.
///
/// # Errors
/// [`Error::Write`]; [`Error::Internal`].
pub fn write(passport: &Passport, path: &Path) -> Result<String, Error> {
    let json =
        serde_json::to_string_pretty(passport).map_err(|e| Error::Internal(e.to_string()))?;
    report::write_whole(path, &json)?;
    let mut page = format!("Passport, {}\n\n", passport.image);
    for Measured { step, name, value, deviation, unit } in &passport.measured {
        let deviation = if *deviation > 0.0 { format!(" ± {deviation}") } else { String::new() };
        page.push_str(&format!("{step}: {name} {value}{deviation} {unit}\n"));
    }
    page.push_str("\nq-axis current (A), saliency offset, saliency sensitivity (/rad), injection current (A)\n");
    for row in &passport.over_torque_current {
        let cell = |cell: &Option<f64>| cell.map_or("-".to_owned(), |cell| cell.to_string());
        page.push_str(&(row.each_ref().map(cell).join(", ") + "\n"));
    }
    report::write_whole(&path.with_extension("txt"), &page)?;
    Ok(page)
}

/// Runs the session at a port, up to a line that fails; returns its record.
fn session(port: &str, baud: u32) -> Result<String, Error> {
    let (mut wire, mut text) = (Port::new(port, baud, interruptible()?)?, String::new());
    for (line, end) in LINES {
        let failed = |why: String| Error::Refused(format!("`{line}`: {why}"));
        let answer = wire.ask(line).map_err(|why| failed(why.to_string()))?;
        text.push_str(&format!("> {line}\n{}\n", answer.lines.join("\n")));
        let (mut looks, from) = (0, text.len());
        let mut stopped = answer.error().map(str::to_owned);
        while stopped.is_none() && end.is_some_and(|end| !text[from..].contains(end)) {
            wire.wait(LOOK.0);
            looks += 1;
            text.extend(wire.unasked().into_iter().map(|news| news + "\n"));
            let stop = text[from..].lines().find(|news| STOPS.iter().any(|s| news.starts_with(s)));
            let late = (looks > LOOK.1).then_some("it does not end");
            stopped = stop.or(late).map(str::to_owned);
        }
        stopped.map_or(Ok(()), |why| Err(failed(why)))?;
    }
    Ok(text)
}

/// Returns the passport of the last commissioning and saliency self-commissioning in a recorded console.
///
/// # Errors
/// The data that are missing, refused or not a number.
pub fn of_console(text: &str) -> Result<Passport, String> {
    let (mut measured, mut table, mut learned) = (Vec::new(), Vec::new(), Vec::new());
    let (mut image, mut refused, mut settings) = (None, None, BTreeMap::new());
    for line in text.lines().map(str::trim) {
        let line = split_tag(line).map_or(line, |(_, rest)| rest);
        let cells: Vec<Option<f64>> = line.split(',').map(|cell| cell.parse().ok()).collect();
        if let Some((step, rest)) =
            line.strip_prefix("* commissioning: ").and_then(|told| told.split_once(": "))
        {
            if step == "nameplate" && rest.starts_with("test current") {
                (measured, refused) = (Vec::new(), None);
            }
            match rest.starts_with("refused") {
                true => refused = Some(line.to_owned()),
                false => measured.extend(quantity(step, rest)),
            }
        } else if line.contains("; spread ") {
            // A refusal of a small saliency sensitivity states its value.
            let line = line
                .replace("weak: ", "")
                .replace(" is less than", " (")
                .replace(", q-axis", "; q-axis");
            refused = refused.or(line.starts_with("not used").then(|| line.clone()));
            let used = line.split("; ").filter(|part| !part.ends_with("not used)"));
            (learned, table) =
                (used.filter_map(|part| quantity("learned", part)).collect(), Vec::new());
        } else if line.starts_with("torque ripple") {
            learned.extend(quantity("learned", line));
        } else if let [Some(_), Some(_), _, _] = cells[..] {
            table.push([cells[0], cells[1], cells[2], cells[3]]);
        } else if line.contains(", image ") {
            image = Some(line.to_owned());
        } else if let Ok(setting) = serde_json::from_str::<Value>(line) {
            settings.insert(setting["name"].as_str().unwrap_or_default().to_owned(), setting);
        }
    }
    refused.map_or(Ok(()), |line| Err(parser_text(line)))?;
    measured.append(&mut learned);
    let found = |name: &str| {
        let found = measured.iter().rfind(|found: &&Measured| found.name == name);
        let found =
            found.ok_or_else(|| format!("`commission` and `learned` do not tell: {name}"))?;
        let number = Some(found.value).filter(|value| (value + found.deviation).is_finite());
        number.ok_or_else(|| format!("{name} = {} is not a finite number", found.value))
    };
    for name in ["r_s", "sigma L_s", "inverter voltage", "asymmetry", "q-axis current up to"] {
        found(name)?;
    }
    let get =
        |name: &str| settings.get(name).ok_or_else(|| format!("`describe` does not tell: {name}"));
    let number = |name: &str| {
        get(name)?["effective"].as_f64().ok_or_else(|| format!("{name} is not a number"))
    };
    let mut twin = toml::Table::new();
    for name in NEEDED.split(' ').chain(ALSO.split(' ')) {
        match get(name)?["value"].as_str() {
            Some("auto") => {}
            Some(word) => drop(twin.insert(name.to_owned(), word.into())),
            None => drop(twin.insert(name.to_owned(), number(name)?.into())),
        }
    }
    // Model A: for a saliency s fixed to the flux the sensitivity is 2 s, and s = a 2r/(1 + r) with r = (psi/psi_n)^2.
    // Only the flux of the saliency self-commissioning was measured: psi_n, and with it the law over the flux, come
    // from the model.
    let model = Config::default();
    let rated = number("nameplate.current_a")? / f64::from(model.drive.nameplate.current_a);
    let r = (number("sequence.i_d")? / (0.7 * rated)).powi(2);
    for (name, value) in [
        ("saliency.a_psi", 0.25 * found("slope")? * (1.0 + r) / r),
        ("saliency.psi_n", number("motor.l_m")? * 0.7 * rated),
        ("saliency.b1", found("current saliency").unwrap_or(0.0)),
        ("inverter.residual_v", number("inverter.drop_v")?.max(0.0)),
        (
            "measurement.range_a",
            0.5 * number("scales.current_a.gain")?.abs() * number("scales.full_scale")?,
        ),
    ] {
        twin.insert(name.to_owned(), value.into());
    }
    let image = image.ok_or("`version` does not tell: image")?;
    Ok(Passport { schema: SCHEMA, image, measured, over_torque_current: table, twin })
}

/// Parses the value of a text such as `r_s 5.398 +-0.001 ohm (allowed: 0.429 to 21.425)`.
fn quantity(step: &str, text: &str) -> Option<Measured> {
    let words: Vec<&str> = text.split(" (").next()?.split(' ').collect();
    let at = words.iter().rposition(|word| word.parse::<f64>().is_ok())?;
    let deviation = words.get(at + 1).and_then(|word| word.strip_prefix("+-")?.parse().ok());
    let unit = words[at + 1 + usize::from(deviation.is_some())..].join(" ");
    let (step, name, value) = (step.to_owned(), words[..at].join(" "), words[at].parse().ok()?);
    Some(Measured { step, name, value, deviation: deviation.unwrap_or(0.0), unit })
}

/// Returns the passport of a motor that `identify-trace` has identified; nameplate and dc link come from the configuration.
pub fn of_trace(outcome: &Outcome, config: &Config, file: &Path) -> Passport {
    let measured = outcome.metrics.iter().map(|(name, value)| {
        let [step, name, unit] = ["trace", name, ""].map(str::to_owned);
        Measured { step, name, value, deviation: 0.0, unit }
    });
    let of = |name| outcome.metrics.get(name).unwrap_or(f64::NAN);
    let (l_s, tau_r) = (1e-3 * of("l_s_mh"), of("tau_r_s"));
    let l_m = (l_s * (l_s - 1e-3 * of("sigma_l_s_mh"))).sqrt();
    let found = [
        ("motor.r_s", of("r_s_ohm")),
        ("motor.r_r", l_s / tau_r),
        ("motor.l_ls", l_s - l_m),
        ("motor.l_lr", l_s - l_m),
        ("motor.l_m", l_m),
        ("inverter.residual_v", of("drop_v")),
    ];
    let mut twin = toml::Table::from_iter(found.map(|(name, value)| (name.into(), value.into())));
    for key in Key::all().filter(|key| NEEDED.split(' ').any(|name| name == key.name())) {
        if let Some(value) = key.number(config) {
            twin.entry(key.name()).or_insert(value.into());
        }
    }
    let (image, measured) = (file.display().to_string(), measured.collect());
    Passport { schema: SCHEMA, image, measured, over_torque_current: Vec::new(), twin }
}
