//! The page in a real browser, on the virtual board: Chromium without a window, driven over its DevTools protocol.
//!
//! `cargo xtask pages` runs it: it needs Chromium and the virtual board. The pictures are in `target/pages`.

mod chromium;

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use chromium::{Browser, Page};

/// Simulated time may pass at a tenth of the clock's: a start takes 2 s, a design as long.
const PATIENCE: Duration = Duration::from_secs(90);

/// `cargo live` with the virtual board.
struct Live {
    child: Child,
    lines: Receiver<(Instant, String)>,
    address: String,
}

impl Live {
    fn start(folder: &Path) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drive-live"));
        command.args(["--no-browser", "--", "--load", "locked", "--out"]).arg(folder);
        if let Some(elf) = std::env::var_os("LIVE_ELF") {
            command.arg("--elf").arg(elf);
        }
        let mut child = command.stdout(Stdio::piped()).spawn().expect("it runs");
        let out = BufReader::new(child.stdout.take().unwrap());
        let (send, lines) = channel();
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                let _ = send.send((Instant::now(), line));
            }
        });
        let mut live = Self { child, lines, address: String::new() };
        live.address = live.line("page: ", Duration::from_secs(600)).1;
        live
    }

    /// The rest of the next line that begins so, and when it came.
    fn line(&self, beginning: &str, patience: Duration) -> (Instant, String) {
        let until = Instant::now() + patience;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let (at, line) = self.lines.recv_timeout(left).expect(beginning);
            if let Some(rest) = line.strip_prefix(beginning) {
                return (at, rest.to_owned());
            }
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn state(page: &mut Page<'_>, wanted: &str) {
    page.until(&format!("$('state').textContent.startsWith('{wanted}')"), PATIENCE);
}

fn pictures(page: &mut Page<'_>, folder: &Path, name: &str) {
    for (width, dark) in [(1280, false), (390, false), (390, true)] {
        page.shape(width, 900, dark);
        std::thread::sleep(Duration::from_millis(700));
        let suffix = if dark { "-dark" } else { "" };
        page.picture(&folder.join(format!("live-{name}-{width}{suffix}.png")));
        let wide = page.value("document.documentElement.scrollWidth - innerWidth");
        assert!(wide.as_f64() <= Some(0.0), "{name}, {width} px: {wide} px too wide");
        let stop = page.value("(r => r.top >= 0 && r.bottom <= innerHeight && r.right <= innerWidth)($('stop').getBoundingClientRect())");
        assert_eq!(stop, true, "{name}, {width} px: the stop is not in sight");
    }
    page.shape(1280, 900, false);
}

#[test]
#[ignore = "needs Chromium and the virtual board; cargo xtask pages runs it"]
fn the_page_shows_and_drives_the_virtual_board() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("pages");
    std::fs::create_dir_all(&folder).unwrap();
    let folder: PathBuf = folder;
    let live = Live::start(&folder);
    let mut browser = Browser::start(&folder.join("profile-live"));
    let mut page = browser.open(&live.address);

    // It opens.
    state(&mut page, "off");
    page.until("hello && !hello.misfit && settings.length > 50", PATIENCE);

    // It starts the drive, and the curves move.
    page.value("$('start').click()");
    state(&mut page, "regulating torque");
    page.until("plots.length > 1 && plots[0].plot.data[0].length > 20", PATIENCE);
    let last = page.number("plots[0].plot.data[0].at(-1)");
    page.until(&format!("plots[0].plot.data[0].at(-1) > {last} + 0.2"), PATIENCE);
    assert_eq!(page.number("+$('count').textContent.match(/(\\d+) dropped/)[1]"), 0.0);

    // A step of the torque, in the curve and in the number.
    page.value("$('reference').value = 2; $('run').requestSubmit()");
    page.until(
        "(q => q.length > 20 && Math.abs(q.slice(-20).reduce((a, b) => a + b) / 20 - 2) < 0.1)(columns[streamed.indexOf('i_q_a')])",
        PATIENCE,
    );
    page.until("parseFloat($('torque').textContent) > 0.3", PATIENCE);
    page.until("/apart/.test($('flux-text').textContent)", PATIENCE);
    pictures(&mut page, &folder, "running");

    // A trace at the full rate.
    page.value("view('view-trace'); $('trace').requestSubmit()");
    page.until("tracePlots.length && tracePlots[0].plot.data[0].length == 500", PATIENCE);
    pictures(&mut page, &folder, "trace");

    // It stops by keyboard.
    page.value("view('view-live')");
    page.key("Escape", 27);
    state(&mut page, "off");

    // A setting is changed, and put in force.
    page.value("view('view-settings'); $('filter').value = 'motor.r_s'; showSettings()");
    page.value("(i => { i.value = '5.5'; i.dispatchEvent(new Event('change')); })(document.querySelector('[aria-label=\"motor.r_s\"]'))");
    page.until("settings.find(s => s.name == 'motor.r_s').staged", PATIENCE);
    page.value("document.querySelector('[data-ask=apply]').click()");
    page.until(
        "(s => s.value == 5.5 && !s.staged)(settings.find(s => s.name == 'motor.r_s'))",
        PATIENCE,
    );
    page.value("$('filter').value = ''; showSettings()");
    pictures(&mut page, &folder, "settings");

    // Files: what differs is marked, and a file is loaded line by line.
    page.value("$('compare').onchange({ target: { files: [new File(['set motor.r_s 5.4'], 'mine.txt')] } })");
    page.until("compared.get('motor.r_s') === '5.4' && !compared.has('motor.r_r')", PATIENCE);
    page.value("$('from-file').onchange({ target: { files: [new File(['# mine\\nset motor.r_s 5.4\\napply\\nset motor.r_s -1'], 'mine.txt')] } })");
    page.until("/line 3: set motor.r_s -1.*2 lines before it are set/.test($('settings-said').textContent)", PATIENCE);
    page.until("settings.find(s => s.name == 'motor.r_s').value == 5.4", PATIENCE);

    // The wiring is checked as a guided step.
    page.value("view('view-setup'); document.querySelector('#steps button').click()");
    page.until(
        "/done: the wiring/.test(document.querySelector('#steps strong').textContent)",
        PATIENCE,
    );
    state(&mut page, "off");
    pictures(&mut page, &folder, "setup");

    // A recording has its schema, units and image, and every frame.
    page.value(
        "download = (name, text) => { globalThis.saved = [name, text]; }; $('record').click()",
    );
    page.until("recorded.rows.length > 50", PATIENCE);
    page.value("$('record').click()");
    for part in ["schema 1", "build [0-9a-f]{16}", "# units s,1,", "\\nt_s,sequence,", "phi_deg"] {
        assert_eq!(page.value(&format!("/{part}/.test(saved[1])")), true, "{part}");
    }

    // Closed while the drive runs: it stops in time.
    page.value("view('view-live'); $('start').click()");
    state(&mut page, "regulating torque");
    let closed = Instant::now();
    page.close();
    let (stopped, why) = live.line("drive stopped: the page was ", PATIENCE);
    let after = stopped - closed;
    println!("stopped {} ms after the page was closed: {why}", after.as_millis());
    assert!(after < Duration::from_millis(500), "{after:?}");
    let mut page = browser.open(&live.address);
    state(&mut page, "off");

    // A fault, in words with what to do.
    page.value("tell('set limits.dc_over_v 300').then(() => tell('start torque'))");
    page.until("/Fault 4.*dc link/.test($('alarm').textContent) && $('alarm').querySelectorAll('li').length > 1", PATIENCE);
    pictures(&mut page, &folder, "fault");
}
