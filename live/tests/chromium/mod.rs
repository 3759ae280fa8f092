//! Chromium without a window, over its DevTools protocol.
//!
//! Own code, because the crates for it (`chromiumoxide`, `headless_chrome`) bring a hundred thousand generated lines for the six methods
//! that are used here.

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// A browser, which ends when this value is dropped.
pub struct Browser {
    child: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    number: u64,
}

/// A page of the browser.
pub struct Page<'a> {
    browser: &'a mut Browser,
    target: Value,
    session: Value,
}

impl Browser {
    /// Starts the browser. Files that a page saves go to `files`.
    pub fn start(profile: &Path, files: &Path) -> Self {
        let mut child = Command::new("chromium")
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .stderr(Stdio::piped())
            .spawn()
            .expect("chromium runs");
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        let address = lines
            .find_map(|line| line.strip_prefix("DevTools listening on ").map(str::to_owned))
            .expect("chromium says where it listens");
        // The browser must not wait for a reader of its messages.
        std::thread::spawn(move || lines.for_each(drop));
        let (socket, _) = tungstenite::connect(address).expect("chromium answers");
        let mut browser = Self { child, socket, number: 0 };
        let downloads = json!({ "behavior": "allow", "downloadPath": files });
        browser.call(&Value::Null, "Browser.setDownloadBehavior", downloads);
        browser
    }

    /// Calls a method and returns its result. Events are ignored.
    fn call(&mut self, session: &Value, method: &str, parameters: Value) -> Value {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": parameters });
        if !session.is_null() {
            message["sessionId"] = session.clone();
        }
        self.socket.send(Message::text(message.to_string())).expect(method);
        loop {
            let Message::Text(text) = self.socket.read().expect(method) else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.number {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    pub fn open(&mut self, address: &str) -> Page<'_> {
        let target = self.call(&Value::Null, "Target.createTarget", json!({ "url": address }));
        let target = target["targetId"].clone();
        let attach = json!({ "targetId": target, "flatten": true });
        let session = self.call(&Value::Null, "Target.attachToTarget", attach)["sessionId"].clone();
        let mut page = Page { browser: self, target, session };
        page.call("Page.bringToFront", json!({}));
        // The empty page before the requested one is complete, too.
        let loaded = "location.href != 'about:blank' && document.readyState == 'complete'";
        page.until(loaded, Duration::from_secs(20));
        page
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Page<'_> {
    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.browser.call(&self.session, method, parameters)
    }

    /// Evaluates an expression of JavaScript.
    pub fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true });
        let result = self.call("Runtime.evaluate", parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    pub fn number(&mut self, expression: &str) -> f64 {
        self.value(expression).as_f64().expect(expression)
    }

    /// Waits until an expression is true.
    pub fn until(&mut self, expression: &str, patience: Duration) {
        let began = Instant::now();
        loop {
            let parameters = json!({ "expression": expression, "returnByValue": true });
            let result = self.call("Runtime.evaluate", parameters);
            if result["result"]["value"] == true {
                return;
            }
            if began.elapsed() > patience {
                let shown = self.value("document.body?.innerText.slice(-3000)");
                let log =
                    self.value("document.getElementById('log')?.textContent.slice(-3000) ?? ''");
                panic!("not in time: {expression}: {result}\n{shown}\nlog: {log}");
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Presses a key.
    pub fn key(&mut self, name: &str, code: u32) {
        for kind in ["rawKeyDown", "keyUp"] {
            let key =
                json!({ "type": kind, "key": name, "code": name, "windowsVirtualKeyCode": code });
            self.call("Input.dispatchKeyEvent", key);
        }
    }

    /// Sets the size in pixels, and a dark or light scheme.
    pub fn shape(&mut self, width: u32, height: u32, dark: bool) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 700 });
        self.call("Emulation.setDeviceMetricsOverride", size);
        let scheme = if dark { "dark" } else { "light" };
        let feature = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("Emulation.setEmulatedMedia", feature);
    }

    /// Writes a picture of the visible part.
    pub fn picture(&mut self, file: &Path) {
        self.write("Page.captureScreenshot", file);
    }

    /// Writes the page as it is printed.
    pub fn print(&mut self, file: &Path) {
        self.write("Page.printToPDF", file);
    }

    fn write(&mut self, method: &str, file: &Path) {
        let data = self.call(method, json!({}))["data"].clone();
        let bytes = data_encoding::BASE64.decode(data.as_str().unwrap().as_bytes()).unwrap();
        std::fs::write(file, bytes).expect("the file is written");
    }

    pub fn close(self) {
        self.browser.call(&Value::Null, "Target.closeTarget", json!({ "targetId": self.target }));
    }
}
