//! `cargo xtask pages`: pictures of a few pages in Chromium, for a look, and a measurement of each.
//!
//! Chromium's window is at least 500 pixels wide, so that a page is shown in a frame of the width wanted. The
//! frame's page measures: the pages themselves have no scripts.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::{image, run, sources, toolchain};

/// Pages, by the arguments of `cargo sim run` that make them.
const PAGES: [&str; 4] =
    ["torque-steps", "speed-profile", "monte-carlo --set runs=12", "identify-machine"];
/// Name, width in pixels and darkness of each view.
const VIEWS: [View; 3] = [("420", 420, false), ("420-dark", 420, true), ("1280", 1280, false)];
type View = (&'static str, u32, bool);
/// Smallest text of a plot, pixels.
const SMALLEST_PX: f64 = 9.0;

/// Makes the pages and their pictures in `target/pages`; fails if one is wider than its frame, or if the text
/// of a plot is too small to be read.
pub fn pages() -> Result<()> {
    toolchain::ensure_chromium()?;
    let folder = run::folder("pages")?;
    for arguments in PAGES {
        let mut command = run::cargo("run --quiet --release --package hil-sim -- run");
        let command = command.args(arguments.split(' ')).arg("--out").arg(&folder);
        run::step(arguments, command.stdout(std::process::Stdio::null()))?;
    }
    let mut names: Vec<_> = PAGES.iter().filter_map(|page| page.split(' ').next()).collect();
    // The page of the last session with the virtual board, if there was one.
    let board = run::root().join("out/board.html");
    if board.is_file() {
        fs::copy(board, folder.join("board.html"))?;
        names.push("board");
    }
    let mut wrong = Vec::new();
    for name in names {
        for view in VIEWS {
            let measured = picture(&folder, name, view)?;
            wrong.extend(measured.complaint(&format!("{name}, {}", view.0)));
        }
        let pdf = format!("--print-to-pdf={}", folder.join(format!("{name}.pdf")).display());
        let page = folder.join(format!("{name}.html"));
        chromium(&folder, &page, &["--no-pdf-header-footer", &pdf])?;
    }
    live()?;
    println!("\npictures: {}", folder.display());
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

/// Drives the live page in Chromium, on the virtual board with the image of the reference board.
fn live() -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let elf = image::build()?;
    let test = "test --release --package drive-live --test page browser -- --ignored --nocapture";
    run::step("live page", run::cargo(test).env("LIVE_ELF", elf))
}

/// Sizes of a page in its frame, pixels.
#[derive(Debug, PartialEq)]
struct Measured {
    content: f64,
    frame: f64,
    height: f64,
    smallest_text: f64,
}

/// Measures a page, then takes a picture of all of it.
fn picture(folder: &Path, name: &str, (view, width, dark): View) -> Result<Measured> {
    let page = sources::read(folder.join(format!("{name}.html")))?;
    let frame = folder.join(format!("{name}-{view}.frame.html"));
    let scheme = format!("--blink-settings=preferredColorScheme={}", u8::from(!dark));
    fs::write(&frame, framed(&page, width, 900.0))?;
    let found = chromium(folder, &frame, &["--dump-dom", &scheme])?;
    let measured = Measured::from_dump(&found)
        .with_context(|| format!("{} was not measured", frame.display()))?;
    fs::write(&frame, framed(&page, width, measured.height))?;
    let picture = folder.join(format!("{name}-{view}.png"));
    let picture = format!("--screenshot={}", picture.display());
    let size = format!("--window-size={},{}", width.max(500), measured.height);
    chromium(folder, &frame, &[&picture, &size, &scheme])?;
    fs::remove_file(&frame)?;
    Ok(measured)
}

/// A page with another one in a frame, which it measures.
fn framed(page: &str, width: u32, height: f64) -> String {
    let page = page.replace('&', "&amp;").replace('"', "&quot;");
    let size = format!("width:{width}px;height:{height}px");
    include_str!("frame.html").replace("SIZE", &size).replace("PAGE", &page)
}

impl Measured {
    /// From the document that Chromium prints.
    fn from_dump(document: &str) -> Option<Self> {
        let (_, rest) = document.split_once("data-measured=\"")?;
        let numbers =
            rest.split('"').next()?.split(' ').map(str::parse).collect::<Result<Vec<_>, _>>();
        let [content, frame, height, smallest_text] = numbers.ok()?[..] else { return None };
        Some(Self { content, frame, height, smallest_text })
    }

    fn complaint(&self, view: &str) -> Option<String> {
        let Self { content, frame, smallest_text, .. } = self;
        println!(
            "{view}: {content} of {frame} px wide, smallest text of a plot {smallest_text:.1} px"
        );
        (content > frame || *smallest_text < SMALLEST_PX).then(|| {
            format!(
                "{view}: {content} px wide in {frame} px, smallest text {smallest_text:.1} px; \
                 allowed: no overflow, at least {SMALLEST_PX} px"
            )
        })
    }
}

/// Output of Chromium for a page.
fn chromium(folder: &Path, page: &Path, options: &[&str]) -> Result<String> {
    let mut command = run::command("chromium");
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]);
    command.arg(format!("--user-data-dir={}", folder.join("profile").display()));
    run::said(command.args(options).arg(format!("file://{}", page.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_is_too_wide_or_too_small_is_named() {
        let measured = |numbers: &str| {
            Measured::from_dump(&format!("<body data-measured=\"{numbers}\"><p>")).unwrap()
        };
        assert_eq!(measured("420 420 900 10.5").complaint("page"), None);
        assert!(
            measured("421 420 900 10.5").complaint("page").unwrap().contains("421 px wide in 420")
        );
        assert!(measured("420 420 900 4.1").complaint("page").unwrap().contains("4.1 px"));
        assert_eq!(Measured::from_dump("<body>"), None);
    }
}
