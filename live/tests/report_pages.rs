//! Pages of the simulator in a real browser: none overflows, and the text of every plot is readable. Pictures and prints of them can be
//! looked at.

use std::path::{Path, PathBuf};

use crate::chromium::Browser;

/// Smallest text of a plot, pixels.
const SMALLEST_PX: f64 = 9.0;

#[test]
#[ignore = "needs Chromium and pages; cargo xtask pages makes them and runs it"]
fn pages_fit_and_can_be_read() {
    let folder = std::env::var_os("PAGES").map(PathBuf::from).expect("PAGES: folder of the pages");
    let mut browser = Browser::start(&folder.join("profile"), &folder);
    let entries = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let pages: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "html")).collect();
    assert!(!pages.is_empty(), "no page in {}", folder.display());
    let mut wrong = Vec::new();
    for path in &pages {
        let mut page = browser.open(&format!("file://{}", path.display()));
        for (view, width, dark) in
            [("420", 420, false), ("420-dark", 420, true), ("1280", 1280, false)]
        {
            page.shape(width, 900, dark);
            let content = page.number("document.documentElement.scrollWidth");
            let text = page.number(
                "Math.min(99, ...[...document.querySelectorAll('.plot text')].map(text => (to => \
                 parseFloat(getComputedStyle(text).fontSize) * Math.hypot(to.a, to.b))(text.getScreenCTM())))",
            );
            if content > f64::from(width) || text < SMALLEST_PX {
                wrong.push(format!(
                    "{}, {view}: {content} px wide, text {text:.1} px",
                    path.display()
                ));
            }
            let height = page.number("document.documentElement.scrollHeight");
            page.shape(width, height as u32, dark);
            page.picture(&suffixed(path, &format!("-{view}.png")));
        }
        page.print(&suffixed(path, ".pdf"));
        page.close();
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The path of a page with another ending.
fn suffixed(page: &Path, ending: &str) -> PathBuf {
    let name = page.file_stem().unwrap().to_string_lossy();
    page.with_file_name(format!("{name}{ending}"))
}
