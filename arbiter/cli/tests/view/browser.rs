//! A headless Chromium, controlled over its DevTools protocol.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};

use crate::program::TIMEOUT;

/// Programs that are tried.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page; it ends when it is dropped.
pub struct Browser {
    process: Child,
    profile: PathBuf,
    page: WebSocket<MaybeTlsStream<TcpStream>>,
    calls: u64,
}

impl Browser {
    /// Starts a browser; `None`, with a printed line, if there is none on this machine.
    pub fn start(test: &str) -> Option<Browser> {
        let has = |program: &&&str| Command::new(program).arg("--version").output().is_ok();
        let Some(program) = PROGRAMS.iter().find(has) else {
            println!("skipped {test}: Chromium is missing");
            return None;
        };
        let profile = std::env::temp_dir().join(format!("yamabico-browser-{test}-{}", std::process::id()));
        let mut process = Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
        let Some(address) = lines.find_map(|line| Some(line.split_once("ws://")?.1.to_owned())) else {
            let _ = process.kill();
            let _ = process.wait();
            println!("skipped {test}: Chromium does not start here");
            return None;
        };
        // The rest of what it prints is read, so that it does not block.
        std::thread::spawn(move || lines.for_each(drop));
        let host = address.split('/').next().unwrap();
        let (mut page, _) = connect(page_address(host)).unwrap();
        if let MaybeTlsStream::Plain(stream) = page.get_mut() {
            stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        }
        let mut browser = Browser { process, profile, page, calls: 0 };
        for domain in ["Page", "Runtime"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        Some(browser)
    }

    /// Sets the size of the page.
    pub fn resize(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Opens an address.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
    }

    /// Value of a JavaScript expression; a promise is awaited.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let call = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", call);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true; returns the time that it took.
    pub fn await_true(&mut self, expression: &str) -> Duration {
        let begun = Instant::now();
        let guarded = format!("(() => {{ try {{ return !!({expression}); }} catch {{ return false; }} }})()");
        while self.evaluate(&guarded) != true {
            if begun.elapsed() > TIMEOUT {
                let state = self.evaluate("JSON.stringify(window.yamabico?.memory.state ?? null)");
                panic!("not true: {expression}; state: {state}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        begun.elapsed()
    }

    /// Clicks at a point of the page.
    pub fn click_at(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Clicks at the middle of the element `selector`.
    pub fn click(&mut self, selector: &str) {
        let [x, y] = self.middle(selector);
        self.click_at(x, y);
    }

    /// Replaces the text of the field `selector`, by a triple click and the keys of `text` and Enter.
    pub fn enter(&mut self, selector: &str, text: &str) {
        let [x, y] = self.middle(selector);
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 3 });
            self.call("Input.dispatchMouseEvent", event);
        }
        self.call("Input.insertText", json!({ "text": text }));
        for kind in ["keyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": "Enter", "code": "Enter", "text": "\r", "windowsVirtualKeyCode": 13 });
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Middle of an element, which is brought into view.
    fn middle(&mut self, selector: &str) -> [f64; 2] {
        let middle = self.evaluate(&format!(
            "(() => {{ const e = document.querySelector('{selector}'); e.scrollIntoView({{ block: 'center' }}); \
             const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        ));
        [0, 1].map(|axis| middle[axis].as_f64().unwrap())
    }

    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.calls += 1;
        let call = json!({ "id": self.calls, "method": method, "params": parameters }).to_string();
        self.page.send(Message::text(call)).unwrap();
        loop {
            let Message::Text(text) = self.page.read().unwrap() else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = std::fs::remove_dir_all(&self.profile);
    }
}

/// Address of the first page.
fn page_address(host: &str) -> String {
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    write!(stream, "GET /json/list HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let mut stream = BufReader::new(stream);
    let mut length = 0;
    loop {
        let mut line = String::new();
        stream.read_line(&mut line).unwrap();
        match line.trim_end().to_lowercase().split_once(':') {
            Some(("content-length", value)) => length = value.trim().parse().unwrap(),
            None if line.trim_end().is_empty() => break,
            _ => {}
        }
    }
    let mut json = vec![0; length];
    stream.read_exact(&mut json).unwrap();
    let pages: Vec<Value> = serde_json::from_slice(&json).unwrap();
    let page = pages.iter().find(|page| page["type"] == "page").unwrap();
    page["webSocketDebuggerUrl"].as_str().unwrap().to_owned()
}
