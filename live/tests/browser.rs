//! The page in a real browser, on the virtual board: Chromium without a window, driven over its DevTools protocol.
//!
//! `cargo xtask pages` runs it: it needs Chromium and the virtual board. The pictures are in `target/pages`.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::chromium::{Browser, Page};

/// Simulated time may pass at a tenth of real time: a start takes 2 s, and a design takes as long.
const PATIENCE: Duration = Duration::from_secs(90);
/// A self-commissioning takes 50 s of simulated time.
const LEARNING: Duration = Duration::from_secs(500);

/// `cargo live` with the virtual board.
struct Live {
    child: Child,
    lines: Receiver<(Instant, String)>,
    address: String,
}

impl Live {
    fn start(folder: &Path, load: &str) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drive-live"));
        command.args(["--no-browser", "--", "--load", load, "--out"]).arg(folder);
        // `cargo test` sets the variable: the build of the emulator would take it for a change.
        command.env_remove("CARGO_MANIFEST_DIR");
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

    /// The rest of the next line that begins with this text, and the time when it came.
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

pub fn state(page: &mut Page<'_>, wanted: &str) {
    page.until(&format!("$('state').textContent.startsWith('{wanted}')"), PATIENCE);
}

/// A file that the page has saved.
fn saved(folder: &Path, name: &str) -> String {
    let (file, began) = (folder.join(name), Instant::now());
    while !file.is_file() && began.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(50));
    }
    std::fs::read_to_string(file).expect(name)
}

/// Checks the head of a CSV file; returns its rows.
fn rows(text: &str, what: &str, units: &str, names: &str) -> Vec<Vec<f64>> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(&*format!("# induction-drive {what}, schema 1")));
    let firmware = lines.next().unwrap();
    let (_, build) = firmware.split_once("build ").expect(firmware);
    assert!(build.len() >= 16 && u64::from_str_radix(&build[..16], 16).is_ok(), "{firmware}");
    let rest: Vec<_> =
        lines.filter(|line| !line.starts_with("# page") && !line.starts_with("# begun")).collect();
    assert_eq!(rest[..2], [format!("# units {units}"), names.to_owned()]);
    rest[2..].iter().map(|row| row.split(',').map(|n| n.parse().expect(row)).collect()).collect()
}

/// Presses the button of a guided step that has this text, and waits for its verdict.
fn step(page: &mut Page<'_>, name: &str, button: &str, expected: &str, patience: Duration) {
    let button = format!(
        "[...{}.querySelectorAll('button')].find(b => b.textContent == '{button}')",
        item(name)
    );
    // The button waits for the state of the drive, which the page receives five times a second.
    page.until(&format!("!{button}.disabled"), PATIENCE);
    page.value(&format!("{button}.click()"));
    verdict(page, name, expected, patience);
}

/// The item of a guided step.
fn item(name: &str) -> String {
    format!(
        "[...$('steps').children].find(item => item.querySelector('h2').textContent == '{name}')"
    )
}

/// Waits for the verdict of a guided step.
fn verdict(page: &mut Page<'_>, name: &str, expected: &str, patience: Duration) {
    page.until(
        &format!("/{expected}/.test({}.querySelector('strong').textContent)", item(name)),
        patience,
    );
}

/// Streams these signals, with this number of samples per second.
fn stream(page: &mut Page<'_>, names: &str, rate: u32) {
    page.value(&format!("document.querySelectorAll('#signals input').forEach(box => {{ box.checked = '{names}'.split(' ').includes(box.value); }}); $('rate').value = {rate}; restream()"));
    page.until(&format!("streamed.toSorted().join(' ') == '{names}'.split(' ').toSorted().join(' ') && times.length > 100"), PATIENCE);
}

/// Whether a control is disabled and its view gives the reason.
fn waits(page: &mut Page<'_>, id: &str, reason: &str) {
    let waits = page.value(&format!("$('{id}').disabled && $('{id}').title.startsWith('{reason}') && $('{id}').closest('section').querySelector('.why').textContent.includes('{reason}')"));
    assert_eq!(waits, true, "{id}: {reason}");
}

pub fn pictures(page: &mut Page<'_>, folder: &Path, name: &str) {
    for (width, dark) in [(1280, false), (1280, true), (390, false), (390, true)] {
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
    let files = folder.join("saved");
    let _ = std::fs::remove_dir_all(&files);
    std::fs::create_dir_all(&files).unwrap();
    let mut browser = Browser::start(&folder.join("profile-live"), &files);
    let live = Live::start(&folder, "free");
    let mut page = browser.open(&live.address);
    begins(&mut page);
    jogs(&mut page, &folder);
    page.close();
    drop(live);

    let live = Live::start(&folder, "locked");
    let mut page = browser.open(&live.address);
    begins(&mut page);

    runs_and_shows(&mut page, &folder);
    records(&mut page, &folder, &files);
    // The drive is stopped by keyboard, from a field as well.
    page.value("view('view-live'); $('reference').focus()");
    page.key("Escape", 27);
    state(&mut page, "off");
    settings(&mut page, &folder, &files);
    loops(&mut page, &folder);
    limits(&mut page);
    sets_up(&mut page, &folder);
    begins_again(&mut page);

    // If the page is closed while the drive runs, the drive stops in time.
    page.value("view('view-live'); $('start').click()");
    state(&mut page, "regulating torque");
    // The end of the connection that the set-up has closed was reported as well.
    live.lines.try_iter().for_each(drop);
    let closed = Instant::now();
    page.close();
    let (stopped, why) = live.line("drive stopped: the page was ", PATIENCE);
    let after = stopped - closed;
    assert!(after < Duration::from_millis(500), "{after:?}: {why}");
    let mut page = browser.open(&live.address);
    state(&mut page, "off");
    fails(&mut page, &folder);
}

fn begins(page: &mut Page<'_>) {
    state(page, "off");
    page.until(
        "typeof $ == 'function' && hello && !hello.misfit && settings.length > 50",
        PATIENCE,
    );
    assert_eq!(page.value("$('start').disabled"), false);
    waits(page, "set", "the drive does not run");
    // Currents and speed come first, the angle last, above one time axis.
    page.until("plots.length == 4", PATIENCE);
    assert_eq!(page.value("plots.map(({ plot }) => plot.axes[1].label).join()"), "A,rpm,Nm,°");
    assert_eq!(page.value("plots.map(({ plot }) => plot.axes[0].label || '-').join()"), "-,-,-,s");
}

/// The newest values are in the legend; signals of the control are there beside the measured ones.
fn shows_signals(page: &mut Page<'_>) {
    page.until("/^1\\.9|^2\\.0/.test(document.querySelectorAll('#curves .u-legend .u-value')[1].textContent)", PATIENCE);
    stream(page, "torque_nm i_a_a i_b_a heat_sink_c state limit i_d_a i_q_a", 200);
    let last = |page: &mut Page<'_>, name: &str| {
        page.number(&format!("columns[streamed.indexOf('{name}')].at(-1)"))
    };
    let [torque, i_d, i_q] = ["torque_nm", "i_d_a", "i_q_a"].map(|name| last(page, name));
    let by_status = page.number("parseFloat($('torque').textContent)");
    assert!((torque - by_status).abs() < 0.05 * by_status, "{torque}, {by_status} Nm");
    // With an amplitude-invariant transformation the phase currents are as large as the dq currents, apart from the injection.
    let [a, b] = ["i_a_a", "i_b_a"].map(|name| last(page, name));
    let peak = (4.0 / 3.0 * (a * a + a * b + b * b)).sqrt();
    assert!((peak - i_d.hypot(i_q)).abs() < 0.5, "{peak} A, {i_d} A, {i_q} A");
    assert!((last(page, "heat_sink_c") - 25.0).abs() < 2.0);
    assert_eq!((last(page, "state"), last(page, "limit")), (2.0, 0.0));
    page.until("/state:?\\s*running/.test($('curves').innerText) && /limited by:?\\s*none/.test($('curves').innerText)", PATIENCE);
}

/// No peak of a sample disappears if many samples share a pixel.
fn draws_peaks(page: &mut Page<'_>) {
    stream(page, "i_d_a i_q_a", 2000);
    page.until("times.length > 8000", PATIENCE);
    page.value("draw(); paused = true; globalThis.spike = times.length - 3000; columns[plots[0].indices[0]][spike] = 50; paused = false; draw(); paused = true");
    std::thread::sleep(Duration::from_millis(300));
    let samples = page.number("plots[0].plot.data[0].length / plots[0].plot.bbox.width");
    assert!(samples > 4.0, "{samples} samples a pixel");
    let drawn = page.value("(({ plot }) => { const x = Math.round(plot.valToPos(times[spike], 'x', true)), y = Math.round(plot.valToPos(43, 'y', true)), [r, g, b, a] = [0, 1, 2, 3].map(n => Math.max(...[...plot.ctx.getImageData(x - 1, y, 3, 1).data].filter((_, i) => i % 4 == n))); return a > 100 && b > 200 && r < 150; })(plots[0])");
    assert_eq!(drawn, true, "a peak of one sample in {samples} a pixel");
    page.value("paused = false; draw(); plots.forEach(({ plot }) => plot.redraw(false))");
    stream(page, "i_q_a i_q_ref_a i_d_a speed_rpm torque_nm phi_deg", 200);
}

/// The drive is started, the curves move, and a step of the torque appears in the curves and in the number.
fn runs_and_shows(page: &mut Page<'_>, folder: &Path) {
    page.value("$('start').click()");
    state(page, "regulating torque");
    page.until("plots.length > 1 && plots[0].plot.data[0].length > 20", PATIENCE);
    let last = page.number("plots[0].plot.data[0].at(-1)");
    page.until(&format!("plots[0].plot.data[0].at(-1) > {last} + 0.2"), PATIENCE);
    assert_eq!(page.number("+$('count').textContent.match(/(\\d+) dropped/)[1]"), 0.0);
    page.value("$('reference').value = 2; $('run').requestSubmit()");
    page.until(
        "(q => q.length > 20 && Math.abs(q.slice(-20).reduce((a, b) => a + b) / 20 - 2) < 0.1)(columns[streamed.indexOf('i_q_a')])",
        PATIENCE,
    );
    page.until("parseFloat($('torque').textContent) > 0.3", PATIENCE);
    page.until("/apart/.test($('flux-text').textContent)", PATIENCE);
    for id in ["start", "mode"] {
        waits(page, id, "the drive must be off");
    }
    page.value("view('view-settings')");
    waits(page, "settings", "the drive must be off");
    page.value("view('view-live')");
    shows_signals(page);
    draws_peaks(page);
    pictures(page, folder, "running");
    page.key("p", 80);
    page.until("paused", PATIENCE);
    page.key("p", 80);
}

/// A jog turns a free shaft while its button is held, in speed mode; a stop by ramp ends in off. Every mode shows its controls.
fn jogs(page: &mut Page<'_>, folder: &Path) {
    let choose = |page: &mut Page<'_>, mode: &str| {
        page.value(&format!("$('mode').value = '{mode}'; $('mode').onchange()"));
        page.value("[...document.querySelectorAll('[data-mode]')].filter(part => part.offsetParent).map(part => part.dataset.mode).join()")
    };
    assert_eq!(choose(page, "torque"), "");
    assert_eq!(choose(page, "position"), "position");
    pictures(page, folder, "homing");
    waits(page, "home", "the drive does not regulate the position");
    // The page shows the mode of the drive, regardless of which side has started it.
    page.value("tell('start speed')");
    state(page, "regulating speed");
    assert_eq!(choose(page, "speed"), "speed");
    page.value("$('mode').value = 'torque'; follow()");
    assert_eq!(page.value("$('mode').value"), "speed");
    page.value(
        "$('reference').value = 60; document.querySelector('[data-jog=\"-1\"]').onpointerdown()",
    );
    page.until("Math.abs(parseFloat($('speed').textContent) + 60) < 10", PATIENCE);
    page.value("document.querySelector('[data-jog=\"-1\"]').onpointerup()");
    page.until("Math.abs(parseFloat($('speed').textContent)) < 10", PATIENCE);
    page.value("document.querySelector('[data-ask=\"stop ramp\"]').click()");
    state(page, "off");
    choose(page, "torque");
}

/// A recording has every frame; a trace has the full rate, at once and around its trigger.
fn records(page: &mut Page<'_>, folder: &Path, files: &Path) {
    page.value("$('record').click()");
    page.until("recorded.rows.length > 200", PATIENCE);
    page.value("$('record').click()");
    let names = "i_d_a,i_q_a,i_q_ref_a,phi_deg,speed_rpm,torque_nm";
    let order = page.value("streamed.slice().sort().join()");
    assert_eq!(order, names);
    let (units, columns) = (page.value("streamed.map(unit)"), page.value("streamed.join()"));
    let units: Vec<_> =
        units.as_array().unwrap().iter().map(|unit| unit.as_str().unwrap()).collect();
    let columns = format!("t_s,sequence,{}", columns.as_str().unwrap());
    let rows_of =
        rows(&saved(files, "record.csv"), "record", &format!("s,1,{}", units.join(",")), &columns);
    assert!(rows_of.len() > 200);
    // 200 frames a second, none missing; a frame may wait for two control periods.
    for two in rows_of.windows(2) {
        assert!((two[1][0] - two[0][0] - 0.005).abs() < 0.001, "{two:?}");
        assert_eq!((two[0][1] + 1.0) % 65536.0, two[1][1]);
    }
    let torque = columns.split(',').position(|name| name == "i_q_a").unwrap();
    let mean = rows_of.iter().map(|row| row[torque]).sum::<f64>() / rows_of.len() as f64;
    assert!((mean - 2.0).abs() < 0.05, "{mean} A");

    page.value("view('view-trace'); $('trace').requestSubmit()");
    page.until("tracePlots.length && tracePlots[0].plot.data[0].length == 500", PATIENCE);
    pictures(page, folder, "trace");
    page.value("$('t-divider').value = 1; $('t-trigger').value = 'below'; $('t-signal').value = 'i_q_a'; $('t-level').value = 1.5; $('trace').requestSubmit()");
    page.until("/waiting/.test($('t-said').textContent)", PATIENCE);
    std::thread::sleep(Duration::from_secs(1));
    page.value("tell('torque 1')");
    page.until("tracePlots[0].plot.data[0][0] < 0", PATIENCE);
    page.value("$('t-csv').click()");
    let rows = rows(
        &saved(files, "trace.csv"),
        "trace",
        &format!("s,{}", units.join(",")),
        &columns.replace("sequence,", ""),
    );
    assert_eq!(rows.len(), 500);
    assert!(rows.windows(2).all(|two| (two[1][0] - two[0][0] - 1.0 / 6000.0).abs() < 1e-6));
    let below = rows.iter().find(|row| row[torque - 1] < 1.5).unwrap();
    assert!(below[0].abs() < 1.5 / 6000.0, "triggered at {} s", below[0]);
}

/// A setting is changed and put in force; files are saved, compared and loaded.
fn settings(page: &mut Page<'_>, folder: &Path, files: &Path) {
    page.value("view('view-settings')");
    // The twelve settings to set first are open, the others are folded, and those of the board come last.
    assert_eq!(page.value("[...$('settings').children].filter(group => group.open).map(group => group.querySelectorAll('tbody tr').length).join()"), "12");
    let order = page.value("[$('settings').firstChild, $('settings').lastChild].map(group => group.querySelector('summary').textContent).join()");
    assert!(order.as_str().unwrap().starts_with("Set these first: 12,Board: "), "{order}");
    let all = page.value("$('settings').querySelectorAll('tbody tr').length == settings.length");
    assert_eq!(all, true);
    let shown = page.value("$('settings').querySelector('[aria-label=\"inverter.dead_time_s\"]').parentElement.textContent");
    assert_eq!(shown, " = 2.2 µs");
    page.value("$('filter').value = 'motor.r_s'; showSettings()");
    let change = |page: &mut Page<'_>, value: &str| {
        page.value(&format!("(i => {{ i.value = '{value}'; i.dispatchEvent(new Event('change')); }})(document.querySelector('#settings [aria-label=\"motor.r_s\"]'))"));
    };
    change(page, "-1");
    page.until("/allowed is 0.0001 to 1000 ohm/.test($('settings-said').textContent)", PATIENCE);
    change(page, "5.5");
    page.until("settings.find(s => s.name == 'motor.r_s').staged", PATIENCE);
    page.value("document.querySelector('[data-ask=apply]').click()");
    page.until(
        "(s => s.value == 5.5 && !s.staged)(settings.find(s => s.name == 'motor.r_s'))",
        PATIENCE,
    );
    page.value("$('filter').value = ''; showSettings(); $('to-file').click()");
    let file = saved(files, "settings.txt");
    assert!(file.starts_with("# 0.") && file.contains("motor.r_s 5.5"), "{file}");
    pictures(page, folder, "settings");

    // Differences are marked.
    let with = |text: &str| {
        format!("{{ target: {{ files: [new File([{}], 'mine.txt')] }} }}", serde_json::json!(text))
    };
    page.value(&format!("$('compare').onchange({})", with(&file)));
    page.until("/same settings/.test($('settings-said').textContent)", PATIENCE);
    page.value(&format!(
        "$('compare').onchange({})",
        with(&file.replace("motor.r_s 5.5", "motor.r_s 5.4"))
    ));
    page.until("/1 settings differ/.test($('settings-said').textContent) && compared.get('motor.r_s') === '5.4'", PATIENCE);
    // A file is loaded line by line, up to a line that is refused.
    page.value(&format!(
        "$('from-file').onchange({})",
        with("# mine\nset motor.r_s 5.4\napply\nset motor.r_s -1")
    ));
    page.until("/line 3: set motor.r_s -1.*2 lines before it are set/.test($('settings-said').textContent)", PATIENCE);
    page.until("settings.find(s => s.name == 'motor.r_s').value == 5.4", PATIENCE);
    page.value(&format!("$('from-file').onchange({})", with(&file)));
    page.until("/lines are in force/.test($('settings-said').textContent)", PATIENCE);
    page.until(
        "(s => s.value == 5.5 && !s.staged)(settings.find(s => s.name == 'motor.r_s'))",
        PATIENCE,
    );
}

const BOARD: &str = "Check the board";
const WIRING: &str = "Check the wiring";
const TENTH: &str = "Start with a tenth of the current";

/// From the board and the nameplate to a drive that has learned its motor and turns it.
fn sets_up(page: &mut Page<'_>, folder: &Path) {
    page.value("view('view-setup')");
    step(page, BOARD, BOARD, "^done: confirmed", PATIENCE);
    let read = page.value("$('reading').textContent");
    assert!(read.as_str().unwrap().contains("dc link 31"), "{read}");
    step(page, BOARD, "Confirm", "^ok", PATIENCE);
    page.value("(i => { i.value = '1715'; i.dispatchEvent(new Event('change')); })(document.querySelector('#nameplate [aria-label=\"nameplate.speed_rpm\"]'))");
    page.until("settings.find(s => s.name == 'nameplate.speed_rpm').staged", PATIENCE);
    step(page, WIRING, WIRING, "^done: the wiring", PATIENCE);
    state(page, "off");
    // If a step is stopped, the page says so.
    step(page, "Commission", "Commission", "sensors: sound", PATIENCE);
    page.key("Escape", 27);
    verdict(page, "Commission", "^not done: stopped", PATIENCE);
    // The page receives the stop before the outputs are off.
    std::thread::sleep(Duration::from_secs(6));
    state(page, "off");
    // The same holds if the connection is lost, which stops the drive.
    step(page, "Commission", "Commission", "sensors: sound", PATIENCE);
    page.value("socket.close()");
    verdict(page, "Commission", "^not done: stopped: the program that serves", PATIENCE);
    std::thread::sleep(Duration::from_secs(6));
    state(page, "off");
    step(page, "Commission", "Commission", "^done: commissioning: ended; .Accept.", PATIENCE);
    let commission = item("Commission");
    assert_eq!(page.value(&format!("{commission}.querySelector('progress').value")), 7.0);
    // Found and allowed values are in a table.
    let found = page.value(&format!("[...{commission}.querySelectorAll('tbody tr')].map(row => [...row.cells].map(cell => cell.textContent.trim()).join('|')).find(row => /[|]r_s[|]/.test(row))"));
    assert!(
        found.as_str().unwrap().starts_with("levels|r_s|5.")
            && found.as_str().unwrap().contains(" ohm|0."),
        "{found}"
    );
    step(page, "Commission", "Accept", "^ok", PATIENCE);
    // The simulated motor has 5.4 ohm; the commissioning is within 0.5 % of it.
    page.until("Math.abs(settings.find(s => s.name == 'motor.r_s').value - 5.4) < 0.027", PATIENCE);
    step(page, "Learn", "Learn", "^learning: point 3 of", PATIENCE);
    pictures(page, folder, "setup");
    verdict(page, "Learn", "^done: learned: slope", LEARNING);
    state(page, "off");
    step(page, "Learn", "Save", "^ok", PATIENCE);
    step(page, TENTH, TENTH, "^done: with 0.3.* A: torque 0.*Nm, speed", PATIENCE);
    state(page, "off");
    page.value("view('view-settings'); $('get-learned').click()");
    page.until("$('learned').textContent.split('\\n').length > 5", PATIENCE);
}

/// The figures of the loops follow a staged setting, and a step is recorded and evaluated.
fn loops(page: &mut Page<'_>, folder: &Path) {
    page.value("view('view-loops')");
    let cell = |page: &mut Page<'_>, row: usize, column: usize| {
        page.number(&format!("parseFloat($('loops').rows[{row}].cells[{column}].textContent)"))
    };
    assert!((cell(page, 2, 2) - 60.0).abs() < 0.1);
    let crossover = [0, 2].map(|row| cell(page, row, 1));
    assert!(crossover[0] > 50.0 && crossover[1] < 10.0, "{crossover:?} Hz");
    page.value("(i => { i.value = '70'; i.onchange(); })(document.querySelector('#knobs [aria-label=\"speed.phase_margin_deg\"]'))");
    page.until(
        "Math.abs(parseFloat($('loops').rows[2].cells[2].textContent) - 70) < 0.1",
        PATIENCE,
    );
    assert!(cell(page, 2, 1) < crossover[1]);
    page.value("document.querySelector('#view-loops [data-ask=revert]').click()");
    page.until(
        "Math.abs(parseFloat($('loops').rows[2].cells[2].textContent) - 60) < 0.1",
        PATIENCE,
    );
    page.value("tell('start torque')");
    state(page, "regulating torque");
    page.value("$('l-by').value = 1; $('step').requestSubmit()");
    page.until("stepPlots.length && stepPlots[0].plot.data[0].length == 500", PATIENCE);
    let said = page.value("$('l-said').textContent");
    let figures: Vec<f64> = said
        .as_str()
        .unwrap()
        .split(|c: char| !c.is_ascii_digit() && c != '.')
        .filter_map(|word| word.parse().ok())
        .collect();
    // Rise time from 10 to 90 % in ms, overshoot, and final value.
    let [_, _, rise_ms, overshoot, end] = figures[..] else { panic!("{said}") };
    assert!((1.0..20.0).contains(&rise_ms) && overshoot < 20.0, "{said}");
    assert!((end - 100.0).abs() < 5.0, "{said}");
    pictures(page, folder, "loops");
    page.value("tell('stop')");
    state(page, "off");
}

/// A limit that acts is told in words, and there is a signal for it.
fn limits(page: &mut Page<'_>) {
    page.value("view('view-live'); tell('set limits.derate_c 0').then(() => tell('apply')).then(() => tell('start torque'))");
    state(page, "regulating torque");
    page.value("tell('torque 3.4')");
    page.until(
        "/heat sink is hot/.test($('limit').textContent) && !!$('limit').offsetParent",
        PATIENCE,
    );
    stream(page, "limit i_q_a", 200);
    page.until("columns[streamed.indexOf('limit')].at(-1) === 2", PATIENCE);
    page.key("Escape", 27);
    state(page, "off");
    page.value("tell('set limits.derate_c auto').then(() => tell('apply'))");
    stream(page, "i_q_a i_q_ref_a i_d_a speed_rpm torque_nm phi_deg", 200);
}

/// A drive that was reset streams again, from 0 s: when it says so, and also when that line is lost.
fn begins_again(page: &mut Page<'_>) {
    page.value("globalThis.kept = announced");
    for deaf in [false, true] {
        page.value(&format!(
            "announced = {deaf} ? () => {{}} : kept; globalThis.before = times; tell('reboot')"
        ));
        page.until("times !== before && times[0] === 0 && times.at(-1) > 1", PATIENCE);
        state(page, "off");
    }
    page.value("announced = kept");
}

/// A fault is shown in words with its cure, and is cleared. A value that does not fit is reported.
fn fails(page: &mut Page<'_>, folder: &Path) {
    page.value("tell('set limits.heat_sink_c 10').then(() => tell('apply')).then(() => tell('confirm board')).then(() => tell('start torque'))");
    page.until("/Fault 18.*heat sink/.test($('alarm').textContent) && $('alarm').querySelectorAll('li').length > 1", PATIENCE);
    state(page, "in fault");
    pictures(page, folder, "fault");
    page.value("tell('set limits.heat_sink_c 85').then(() => tell('apply')).then(() => tell('confirm board')).then(() => document.querySelector('[data-ask=clear]').click())");
    state(page, "off");
    page.until("$('alarm').hidden", PATIENCE);
    page.value("heard({ status: 'READY 3 4' })");
    assert_eq!(page.value("/does not understand.*READY 3 4/.test($('alarm').textContent)"), true);
}
