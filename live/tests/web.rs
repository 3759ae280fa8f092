//! The drive in a browser, from a server that serves only files.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

use drive_live::shared::Shared;
use drive_web::talk::Talk;

use crate::browser::{pictures, state};
use crate::chromium::{Browser, Page};

const PATIENCE: Duration = Duration::from_secs(30);
/// Latest first picture, ms after the beginning of the load, on a computer that runs the drive this many times as fast as real time; a
/// slower computer has longer in proportion.
const FIRST_PICTURE_MS: f64 = 700.0;
const QUIET: f64 = 250.0;
/// Least speed relative to real time, and the simulated time that is measured, ms. The fastest of its parts counts, because the computer
/// also does other things.
const FASTER: f64 = 60.0;
const MEASURED_MS: u32 = 20_000;
const PART_MS: u32 = 200;
/// Time after which the outputs are on, ms.
const ON_MS: u32 = 5000;

/// Serves the files of a folder; returns its address.
fn served(folder: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let folder = folder.clone();
            std::thread::spawn(move || serve(&folder, stream));
        }
    });
    address
}

fn serve(folder: &Path, mut stream: TcpStream) {
    let mut request = String::new();
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let _ = reader.read_line(&mut request);
    let mut head = String::new();
    while reader.read_line(&mut head).is_ok_and(|read| read > 2) {
        head.clear();
    }
    let path = request.split_whitespace().nth(1).unwrap_or("/");
    let name = path.split('?').next().unwrap().trim_start_matches('/');
    let name = if name.is_empty() { "index.html" } else { name };
    let Ok(bytes) = std::fs::read(folder.join(name)) else {
        let _ =
            stream.write_all(b"HTTP/1.1 404 \r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        return;
    };
    let kind = match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html",
        Some("css") => "text/css",
        Some("js") => "text/javascript",
        _ => "application/octet-stream",
    };
    let length = bytes.len();
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    );
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&bytes));
}

/// Presses the button of the guide or of the motor that sends these lines.
fn play(page: &mut Page<'_>, lines: &str) {
    page.value(&format!("document.querySelector('[data-play^=\"{lines}\"]').click()"));
}

fn number(page: &mut Page<'_>, id: &str, condition: &str) {
    page.until(&format!("parseFloat($('{id}').textContent) {condition}"), PATIENCE);
}

#[test]
#[ignore = "needs Chromium and the folder of cargo xtask web; cargo xtask pages runs it"]
fn a_drive_in_the_browser_holds_torque_reverses_and_reports_a_wrong_angle() {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let folder = target.join("pages");
    let web = std::env::var_os("WEB").map_or_else(|| target.join("web"), PathBuf::from);
    std::fs::create_dir_all(&folder).unwrap();
    let address = served(web);
    let mut browser = Browser::start(&folder.join("profile-web"), &folder);

    // The best of three counts here as well.
    let mut first = f64::INFINITY;
    for _ in 0..3 {
        let mut page = browser.open(&address);
        let picture = "performance.getEntriesByName('first picture')[0]";
        page.until(&format!("!!{picture}"), PATIENCE);
        first = first.min(page.number(&format!("{picture}.startTime")));
        page.close();
    }

    let mut page = browser.open(&address);
    page.until("/[*] learned: slope/.test($('log').textContent)", PATIENCE);
    state(&mut page, "off");
    assert_eq!(page.value("!!$('guide').offsetParent && document.title"), "induction-drive");

    play(&mut page, "~off; !load locked; start torque; ~regulating; torque 2");
    state(&mut page, "regulating torque");
    number(&mut page, "torque", "> 0.5");
    number(&mut page, "speed", "< 3");
    page.until(
        "Math.abs(parseFloat($('flux-text').textContent.split('apart ')[1])) < 15",
        PATIENCE,
    );
    std::thread::sleep(Duration::from_secs(4));
    state(&mut page, "regulating torque");
    pictures(&mut page, &folder, "web");
    page.shape(390, 844, false);
    let steps = "[1, 1, 1, -3].every(by => {
        scrollTo(0, 0); const bottom = $('flux').getBoundingClientRect().bottom;
        turn(by); return bottom < innerHeight && document.documentElement.scrollWidth === innerWidth; })";
    assert_eq!(page.value(steps), true);
    page.shape(1280, 900, false);
    page.value("$('around').scrollIntoView({ block: 'end' })");
    pictures(&mut page, &folder, "web-motor");
    page.value("scrollTo(0, 0)");

    page.value("turn(1); turn(1)");
    play(&mut page, "~off; !load free 0; start speed; ~regulating; speed 150");
    number(&mut page, "speed", "> 140");
    play(&mut page, "speed -150");
    number(&mut page, "speed", "< -140");
    state(&mut page, "regulating speed");
    page.until(
        "Math.abs(parseFloat($('flux-text').textContent.split('apart ')[1])) < 20",
        PATIENCE,
    );

    page.value("turn(1)");
    play(&mut page, "!turn 150");
    page.until(
        "/Fault 2\\d/.test($('alarm').textContent) && $('alarm').querySelectorAll('li').length > 1",
        PATIENCE,
    );
    state(&mut page, "in fault");
    pictures(&mut page, &folder, "web-fault");
    play(&mut page, "~off; !open none");
    state(&mut page, "regulating torque");
    play(&mut page, "!open b");
    state(&mut page, "in fault");

    // The record of the page is a passport of the motor, which the drive has learned before.
    page.value("play('!open none; ~off; commission').then(() => 0); 0");
    page.until("/commissioning: ended/.test($('log').textContent)", PATIENCE);
    page.value("passportRecord().then(text => { globalThis.text = text; }); 0");
    page.until("!!globalThis.text", PATIENCE);
    let record = page.value("globalThis.text");
    let passport = hil_sim::passport::of_console(record.as_str().unwrap()).unwrap();
    let r_s = passport.measured.iter().find(|found| found.name == "r_s").unwrap().value;
    assert!((r_s - 5.4).abs() < 0.1, "{r_s}");

    // As fast as the browser can, with the same bits as the same steps give here.
    page.value(&format!(
        "fetch('drive.wasm').then(file => file.arrayBuffer()).then(bytes => WebAssembly.instantiate(bytes, {{}})).then(({{ instance: {{ exports: own }} }}) => {{
            const name = new TextEncoder().encode('dissertation'); const place = own.line(name.length); new Uint8Array(own.memory.buffer, place, name.length).set(name); own.init(7); let least = 1e9;
            for (let passed = 0; passed < {MEASURED_MS}; passed += {PART_MS}) {{
                const began = performance.now(); own.advance({PART_MS}); if (passed > {ON_MS}) least = Math.min(least, performance.now() - began); }}
            globalThis.measured = [{PART_MS} / least, BigInt.asUintN(64, own.fingerprint()).toString()]; }}); 0"
    ));
    page.until("!!globalThis.measured", PATIENCE);
    let faster = page.number("measured[0]");
    let mut here = Talk::learning("dissertation", 7).unwrap();
    here.advance(MEASURED_MS);
    let fingerprint = here.board.machine.fingerprint.to_string();
    assert_eq!(page.value("measured[1]"), fingerprint.as_str());
    let longest = FIRST_PICTURE_MS * (QUIET / faster).max(1.0);
    assert!(first < longest, "{first} ms, {longest} here");
    assert!(faster > FASTER, "{faster}");

    // The address of a state gives it to another page: seed, motor, load, mode and set-point.
    page.close();
    let mut page = browser.open(&format!("{address}?seed=3&motor=kart-5kw3"));
    page.until("/[*] learned: slope/.test($('log').textContent)", PATIENCE);
    state(&mut page, "off");
    page.value(
        "play('~off; !load free 0.4; start speed; ~regulating; speed 120').then(() => 0); 0",
    );
    number(&mut page, "speed", "> 110");
    let shared = page.value("address()").as_str().unwrap().to_owned();
    page.close();
    let mut other = browser.open(&shared);
    number(&mut other, "speed", "> 110");
    state(&mut other, "regulating speed");
    let shown = "[location.search.slice(0, 23), $('motor').value, document.querySelector('[data-line=\"!dc\"]').value, !!$('guide').offsetParent,
        $('reference').value, $('around').querySelector('input').value, $('links').textContent].join()";
    let wanted = "?seed=3&motor=kart-5kw3,kart-5kw3,36,false,120,0.4, · project · manual · licence (not public yet)";
    assert_eq!(other.value(shown), wanted);
    other.close();
    let mut refused = browser.open(&format!("{address}?motor=kart"));
    let why = "motor kart: this page cannot show it; it has dissertation, buildings-4kw";
    refused.until(&format!("$('alarm').textContent.includes('{why}')"), PATIENCE);
}

/// The same board with `cargo live --simulated`, in real time.
#[test]
fn the_simulated_board_starts_holds_torque_and_reports_an_open_wire() {
    let shared = Shared::new();
    let mut link = drive_live::simulated::connect(&shared, 1).unwrap();
    link.begin();
    let mut ask = |line: &str| link.ask(line, |_| ()).unwrap().lines.pop().unwrap();
    assert!(ask("version").contains("simulated"));
    for (line, wanted) in [("start torque", "regulating torque"), ("!open b", "in fault")] {
        let answer = ask(line);
        assert!(answer.starts_with("ok"), "{line}: {answer}");
        let began = std::time::Instant::now();
        while !ask("status").starts_with(wanted) {
            assert!(began.elapsed() < PATIENCE, "{wanted}: {}", ask("status"));
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}
