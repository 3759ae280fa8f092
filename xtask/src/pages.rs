//! `cargo xtask pages`: pictures of a few pages in Chromium, for a look, and a measurement of each.
//!
//! Chromium's window is at least 500 pixels wide, so that a page is shown in a frame of the width wanted. The
//! frame's page measures: the pages themselves have no scripts.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{image, run, sources, toolchain};

/// Pages, by the arguments of `cargo sim run` that make them.
const PAGES: [&str; 4] =
    ["torque-steps", "speed-profile", "monte-carlo --set runs=12", "identify-machine"];
/// Name, width in pixels and darkness of each view.
const VIEWS: [(&str, u32, bool); 3] =
    [("420", 420, false), ("420-dark", 420, true), ("1280", 1280, false)];
/// Smallest text of a plot, pixels.
const SMALLEST_PX: f64 = 9.0;

/// Makes the pages and their pictures in `target/pages`; fails if one is wider than its frame, or if the text
/// of a plot is too small to be read.
pub fn pages() -> Result<()> {
    toolchain::ensure_chromium()?;
    let folder = run::target_dir()?.join("pages");
    fs::create_dir_all(&folder)?;
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
        for (view, width, dark) in VIEWS {
            let page = Page { folder: &folder, name, view, width, dark };
            wrong.extend(page.picture()?.complaint(&format!("{name}, {view}")));
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
    let test = "test --release --package drive-live --test browser -- --ignored --nocapture";
    run::step("live page", run::cargo(test).env("LIVE_ELF", elf))
}

/// A view of a page.
struct Page<'a> {
    folder: &'a Path,
    name: &'a str,
    view: &'a str,
    width: u32,
    dark: bool,
}

/// Sizes of a page in its frame, pixels.
#[derive(Debug, PartialEq)]
struct Measured {
    content: f64,
    frame: f64,
    height: f64,
    smallest_text: f64,
}

impl Page<'_> {
    /// Measures the page, then takes a picture of all of it.
    fn picture(&self) -> Result<Measured> {
        let page = sources::read(self.folder.join(format!("{}.html", self.name)))?;
        let frame = self.folder.join(format!("{}-{}.frame.html", self.name, self.view));
        let scheme = format!("--blink-settings=preferredColorScheme={}", u8::from(!self.dark));
        fs::write(&frame, framed(&page, self.width, 900.0))?;
        let found = chromium(self.folder, &frame, &["--dump-dom", &scheme])?;
        let measured = Measured::from_dump(&found)
            .with_context(|| format!("{} was not measured", frame.display()))?;
        fs::write(&frame, framed(&page, self.width, measured.height))?;
        let picture = self.folder.join(format!("{}-{}.png", self.name, self.view));
        let picture = format!("--screenshot={}", picture.display());
        let size = format!("--window-size={},{}", self.width.max(500), measured.height);
        chromium(self.folder, &frame, &[&picture, &size, &scheme])?;
        fs::remove_file(&frame)?;
        Ok(measured)
    }
}

/// A page with another one in a frame, which it measures.
fn framed(page: &str, width: u32, height: f64) -> String {
    let page = page.replace('&', "&amp;").replace('"', "&quot;");
    format!(
        "<!DOCTYPE html><html><head><style>:root{{color-scheme:light dark}}body{{margin:0}}\
         iframe{{border:0;display:block;width:{width}px;height:{height}px}}</style><script>\
         addEventListener('load', () => {{\
           const page = document.querySelector('iframe').contentDocument, root = page.documentElement;\
           const size = text => {{\
             const to = text.getScreenCTM();\
             return parseFloat(getComputedStyle(text).fontSize) * Math.hypot(to.a, to.b);\
           }};\
           const sizes = [...page.querySelectorAll('.plot text')].map(size);\
           document.body.dataset.measured =\
             [root.scrollWidth, root.clientWidth, root.scrollHeight, Math.min(99, ...sizes)].join(' ');\
         }});</script></head><body><iframe srcdoc=\"{page}\"></iframe></body></html>"
    )
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
    let profile = folder.join("profile");
    let output = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(options)
        .arg(format!("file://{}", page.display()))
        .output()
        .context("chromium")?;
    let errors = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "chromium, {}:\n{errors}", output.status);
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
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
