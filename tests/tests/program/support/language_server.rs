//! The language servers that editors run for TOML, as child processes.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Maximum time for an answer.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running server.
pub struct Server {
    pub name: &'static str,
    child: Child,
    input: ChildStdin,
    messages: Receiver<Value>,
    requests: u64,
    /// Diagnostics by the URI of the document, as last published.
    published: BTreeMap<String, Vec<Value>>,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Server {
    /// Starts a server with limited address space; none if it is missing or does not speak the protocol.
    pub fn start(name: &'static str, command: &[&str], mebibytes: u64, folder: &Path) -> Option<Self> {
        let mut child = Command::new("sh")
            .args(["-c", &format!("ulimit -v {} && exec \"$@\"", mebibytes << 10), "sh"])
            .args(command)
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (input, output) = (child.stdin.take()?, child.stdout.take()?);
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            while let Some(message) = read(&mut output) {
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        let mut server = Self { name, child, input, messages, requests: 0, published: BTreeMap::new() };
        let root = format!("file://{}", folder.display());
        server.ask(
            "initialize",
            json!({
                "processId": std::process::id(), "rootUri": root,
                "workspaceFolders": [{ "uri": root, "name": "recipes" }],
                "capabilities": {
                    "workspace": { "configuration": true, "workspaceFolders": true },
                    "textDocument": {
                        "completion": { "completionItem": { "snippetSupport": true, "documentationFormat": ["markdown"] } },
                        "hover": { "contentFormat": ["markdown"] },
                        "publishDiagnostics": {}
                    }
                }
            }),
        )?;
        server.tell("initialized", json!({}));
        Some(server)
    }

    fn send(&mut self, message: &Value) -> Option<()> {
        let text = message.to_string();
        write!(self.input, "Content-Length: {}\r\n\r\n{text}", text.len()).ok()?;
        self.input.flush().ok()
    }

    /// Sends a notification.
    fn tell(&mut self, method: &str, params: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    /// Receives the next message, and answers requests of the server. Fails if no message arrives in time.
    fn next(&mut self, patience: Duration) -> Result<Value, RecvTimeoutError> {
        let message = self.messages.recv_timeout(patience)?;
        if let (Some(id), Some(method)) = (message.get("id"), message["method"].as_str()) {
            let result = match method {
                // Disables catalogs of schemas, so that nothing is fetched.
                "workspace/configuration" => {
                    let items = message["params"]["items"].as_array().map_or(0, Vec::len);
                    vec![json!({ "schema": { "enabled": true, "catalogs": [] } }); items].into()
                }
                _ => Value::Null,
            };
            self.send(&json!({ "jsonrpc": "2.0", "id": id, "result": result }));
        } else if message["method"] == "textDocument/publishDiagnostics" {
            let uri = message["params"]["uri"].as_str().unwrap_or_default().to_owned();
            let diagnostics = message["params"]["diagnostics"].as_array().cloned().unwrap_or_default();
            self.published.insert(uri, diagnostics);
        }
        Ok(message)
    }

    /// Sends a request; none if the server ends or does not answer in time.
    fn ask(&mut self, method: &str, params: Value) -> Option<Value> {
        self.requests += 1;
        let id = self.requests;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }))?;
        let end = Instant::now() + PATIENCE;
        loop {
            let message = self.next(end.saturating_duration_since(Instant::now())).ok()?;
            if message["id"] == id && message.get("method").is_none() {
                return Some(message["result"].clone());
            }
        }
    }

    /// Opens a document and waits until the server has published its diagnostics.
    fn open(&mut self, uri: &str, text: &str) {
        self.published.remove(uri);
        let document = json!({ "uri": uri, "languageId": "toml", "version": 1, "text": text });
        self.tell("textDocument/didOpen", json!({ "textDocument": document }));
        let end = Instant::now() + PATIENCE;
        while !self.published.contains_key(uri) {
            let left = end.saturating_duration_since(Instant::now());
            assert!(self.next(left).is_ok(), "{} publishes no diagnostics of:\n{text}", self.name);
        }
    }

    /// The answer of a server for the `|` of a document. It may still be loading the schema, so the request is repeated
    /// until `enough`.
    fn at_cursor<T: Default>(
        &mut self,
        method: &str,
        uri: &str,
        text: &str,
        read: impl Fn(&Value) -> T,
        enough: impl Fn(&T) -> bool,
    ) -> T {
        let (before, after) = text.split_once('|').expect("a cursor");
        let document = format!("{before}{after}");
        self.open(uri, &document);
        let (line, character) = (before.matches('\n').count(), before.rsplit('\n').next().unwrap_or_default().len());
        let place = json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": character } });
        let end = Instant::now() + Duration::from_secs(3);
        let found = loop {
            let Some(answer) = self.ask(method, place.clone()) else {
                panic!("{} ends or hangs on {method} at the `|` of:\n{text}", self.name)
            };
            let found = read(&answer);
            if enough(&found) || Instant::now() > end {
                break found;
            }
            std::thread::sleep(Duration::from_millis(100));
        };
        self.tell("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
        found
    }

    /// Completions at the `|` of a document, with their documentation; waits for the `wanted` ones.
    pub fn completions(&mut self, uri: &str, text: &str, wanted: &[String]) -> Vec<(String, String)> {
        let read = |answer: &Value| {
            let items = answer.as_array().or(answer["items"].as_array()).cloned().unwrap_or_default();
            let label = |item: &Value| {
                let label = item["label"].as_str().unwrap_or_default();
                // tombi completes a constant with its value: `kind = "png"`.
                label.split(" = ").next().unwrap_or_default().to_owned()
            };
            items.iter().map(|item| (label(item), words(&item["documentation"]))).collect::<Vec<_>>()
        };
        let offered =
            |found: &Vec<(String, String)>| wanted.iter().all(|wanted| found.iter().any(|(label, _)| label == wanted));
        self.at_cursor("textDocument/completion", uri, text, read, offered)
    }

    /// Processor time of the server since its start, in seconds; none on systems without `/proc`.
    pub fn cpu_seconds(&self) -> Option<f64> {
        // Fields of `proc_pid_stat(5)` after the program's name: `utime` and `stime` are the 12th and 13th, in ticks of 10 ms.
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).ok()?;
        let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks: u64 = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
        Some(ticks as f64 / 100.0)
    }

    /// Hover text at the `|` of a document; waits for a text that contains `wanted`.
    pub fn hover(&mut self, uri: &str, text: &str, wanted: &str) -> String {
        let read = |answer: &Value| words(&answer["contents"]);
        self.at_cursor("textDocument/hover", uri, text, read, |shown: &String| shown.contains(wanted))
    }

    /// Lines, from 1, of all diagnostics of a document, with their messages. Waits for diagnostics if they are
    /// expected.
    pub fn diagnostics(&mut self, uri: &str, text: &str, expected: bool) -> Vec<(u64, String)> {
        self.open(uri, text);
        // Syntax errors come first; errors against the schema follow a moment later.
        let end = Instant::now() + Duration::from_secs(10);
        let missing = |server: &Self| expected && server.published[uri].is_empty() && Instant::now() < end;
        while self.next(Duration::from_millis(400)).is_ok() || missing(self) {}
        let found = self.published.get(uri).cloned().unwrap_or_default();
        self.tell("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
        let mut lines: Vec<(u64, String)> = found
            .iter()
            .filter_map(|diagnostic| {
                let line = diagnostic["range"]["start"]["line"].as_u64()? + 1;
                Some((line, diagnostic["message"].as_str()?.to_owned()))
            })
            .collect();
        lines.sort();
        lines
    }
}

/// One message of the protocol.
fn read(output: &mut impl BufRead) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if output.read_line(&mut line).ok()? == 0 {
            return None;
        }
        match line.trim().split_once(':') {
            None if line.trim().is_empty() => break,
            Some((name, value)) if name.eq_ignore_ascii_case("content-length") => length = value.trim().parse().ok()?,
            _ => {}
        }
    }
    let mut body = vec![0; length];
    output.read_exact(&mut body).ok()?;
    serde_json::from_slice(&body).ok()
}

/// Plain or marked-up text.
fn words(value: &Value) -> String {
    value["value"].as_str().or(value.as_str()).unwrap_or_default().to_owned()
}
