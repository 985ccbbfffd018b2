//! A server of pages for the browser of one user. Other users cannot read them.
//!
//! The server listens only on the loopback address, answers GET and HEAD, and refuses requests with a foreign `Host`. A
//! foreign page whose name resolves to this machine (DNS rebinding) therefore reads nothing.
//!
//! All users and programs of the machine can connect, so the [address](Server::url) has a random token. Without it, the
//! server answers every request with a page of explanation. The first page stores the token as a cookie, which the
//! browser sends with further requests. Browsers send cookies to all ports of a machine, including servers of other
//! users. Therefore, each server has an unguessable path, and its cookie is limited to this path.
//!
//! Pages learn of changes through [`CHANGES`]: the server answers `GET /changes?after=3` with `{"version": 4}` once a
//! version after 3 exists, or after [`PATIENCE`] with the current version. Waiting requests hold no thread.

use parking_lot::{Condvar, Mutex};
use std::hint::black_box;
use std::io::{Cursor, ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};
use syntable_runtime::run::stop::Stop;

/// Path where pages wait for the next version. No handler sees it.
pub const CHANGES: &str = "/changes";
/// Maximum time that a request waits for a version. Browsers time out later.
const PATIENCE: Duration = Duration::from_secs(25);
/// Maximum number of waiting requests. Beyond it, the longest-waiting request is answered.
const MAX_WAITING: usize = 64;
/// Maximum number of simultaneous connections. Others wait.
const MAX_CONNECTIONS: usize = 64;
/// Maximum number of bytes of the head of a request.
const MAX_HEAD: usize = 16 << 10;
/// Time limit for a client to send its request, and to receive a part of the answer.
const CLIENT: Duration = Duration::from_secs(10);
/// Maximum time to read the remaining input of a refused client.
const LINGER: Duration = Duration::from_secs(1);
/// Interval at which the server checks for connections and for the signal to stop.
const LOOK: Duration = Duration::from_millis(10);
/// Names of this machine that a `Host` header may have.
const HOSTS: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];
/// Permitted resources of a page: files of this server, and images that its scripts create. Inline scripts are blocked.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Name of the token in the address and of the cookie.
const TOKEN: &str = "token";
/// The page without a token.
const REFUSAL: &str = include_str!("refusal.html");

/// A request of a browser.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// Path with a leading slash, percent-decoded; no segment of it is `.`, `..` or empty, except that the last one may
    /// be empty.
    pub path: String,
    /// Names and values after the question mark, percent-decoded, in order.
    pub query: Vec<(String, String)>,
}

impl Request {
    /// Parses the target of a request line. Returns `None` if it is not a properly encoded path.
    fn parse(target: &str) -> Option<Self> {
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let path = decoded(path, false)?;
        let segments: Vec<&str> = path.strip_prefix('/')?.split('/').collect();
        let (last, folders) = segments.split_last()?;
        let climbs = |segment: &str| segment == "." || segment == ".." || segment.contains(['\\', '\0']);
        if folders.iter().any(|it| it.is_empty()) || segments.iter().any(|it| climbs(it)) || last.starts_with("..") {
            return None;
        }
        let pairs = query.split('&').filter(|pair| !pair.is_empty()).map(|pair| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            Some((decoded(name, true)?, decoded(value, true)?))
        });
        Some(Self { query: pairs.collect::<Option<_>>()?, path })
    }

    /// The first value of a name after the question mark.
    pub fn query(&self, name: &str) -> Option<&str> {
        self.query.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }
}

/// Decodes percent-encoding, and in queries `+` as a space. Returns `None` if the encoding is invalid.
fn decoded(text: &str, is_query: bool) -> Option<String> {
    let mut bytes = text.bytes();
    let mut out = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        out.push(match byte {
            b'%' => {
                let [high, low] = [bytes.next()?, bytes.next()?].map(|digit| char::from(digit).to_digit(16));
                (high? * 16 + low?) as u8
            }
            b'+' if is_query => b' ',
            other => other,
        });
    }
    String::from_utf8(out).ok()
}

/// An answer of the server.
pub struct Response {
    status: u16,
    content_type: &'static str,
    length: u64,
    body: Box<dyn Read + Send>,
    /// Value of the header `Set-Cookie`.
    cookie: Option<String>,
}

impl Response {
    /// Its status code.
    pub fn status(&self) -> u16 {
        self.status
    }

    /// Bytes with a content type, such as `image/png`.
    pub fn bytes(content_type: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        let bytes = bytes.into();
        Self { status: 200, content_type, length: bytes.len() as u64, body: Box::new(Cursor::new(bytes)), cookie: None }
    }

    /// A page.
    pub fn html(text: impl Into<String>) -> Self {
        Self::bytes(content_type("html"), text.into())
    }

    /// JSON.
    pub fn json(value: &serde_json::Value) -> Self {
        Self::bytes(content_type("json"), value.to_string())
    }

    /// 404: the path does not exist.
    pub fn missing() -> Self {
        Self::failed(404, "nothing is at this path\n")
    }

    /// An error with a text.
    pub fn failed(status: u16, text: impl Into<String>) -> Self {
        Self { status, ..Self::bytes(content_type("txt"), text.into()) }
    }
}

/// Content type of an extension, without its dot.
pub fn content_type(extension: &str) -> &'static str {
    match extension.to_ascii_lowercase().as_str() {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "txt" | "toml" | "md" | "jsonl" => "text/plain; charset=utf-8",
        "csv" => "text/csv; charset=utf-8",
        "json" => "application/json",
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "webp" => "image/webp",
        "svg" => "image/svg+xml",
        "glb" => "model/gltf-binary",
        _ => "application/octet-stream",
    }
}

/// Version of the pages' content. Pages wait for the next version.
#[derive(Debug, Clone, Default)]
pub struct Changes(Arc<(Mutex<u64>, Condvar)>);

impl Changes {
    /// Announces new content, and returns its version: 1, 2, ….
    pub fn publish(&self) -> u64 {
        let mut version = self.0.0.lock();
        *version += 1;
        self.0.1.notify_all();
        *version
    }

    /// The current version; 0 before the first.
    pub fn version(&self) -> u64 {
        *self.0.0.lock()
    }

    /// Waits for a version other than `known`, for slightly more than the given time at most.
    fn wait(&self, known: u64, time: Duration) -> u64 {
        let mut version = self.0.0.lock();
        if *version == known {
            self.0.1.wait_for(&mut version, time);
        }
        *version
    }
}

/// A request that waits for a version newer than its own.
struct Waiting {
    from: Client,
    after: u64,
    until: Instant,
}

/// A connection that has sent a request.
struct Client {
    stream: TcpStream,
    wants_body: bool,
}

impl Client {
    /// Sends the answer and closes the connection, because an open connection would hold a thread. A disconnected
    /// client is ignored.
    fn send(self, response: Response) {
        let Self { mut stream, wants_body } = self;
        let Response { status, content_type, length, body, cookie } = response;
        let length_field = length.to_string();
        let fields = [
            ("Connection", "close"),
            ("Content-Type", content_type),
            ("Content-Length", &length_field),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("Content-Security-Policy", POLICY),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Cross-Origin-Opener-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
        ];
        let allow = (status == 405).then_some(("Allow", "GET, HEAD"));
        let cookie = cookie.as_deref().map(|cookie| ("Set-Cookie", cookie));
        let fields = fields.into_iter().chain(allow).chain(cookie).map(|(name, value)| format!("{name}: {value}\r\n"));
        let head = format!("HTTP/1.1 {status} {}\r\n{}\r\n", reason(status), fields.collect::<String>());
        let send = || -> std::io::Result<()> {
            stream.write_all(head.as_bytes())?;
            if wants_body {
                std::io::copy(&mut body.take(length), &mut stream)?;
            }
            stream.shutdown(Shutdown::Write)?;
            // Closing a connection with unread input, such as the body of a POST, resets it, and the client loses the
            // answer.
            let (mut rest, start) = ([0; 1 << 10], Instant::now());
            stream.set_read_timeout(Some(LINGER))?;
            while status >= 400 && start.elapsed() < LINGER && stream.read(&mut rest)? > 0 {}
            Ok(())
        };
        let _ = send();
    }
}

/// Reason phrase of a status code (RFC 9110, section 15).
fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        431 => "Request Header Fields Too Large",
        _ => "Internal Server Error",
    }
}

/// The head of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
struct RequestHead {
    method: String,
    target: String,
    hosts: Vec<String>,
    cookies: Vec<String>,
}

impl RequestHead {
    /// Reads it from a connection; the answer to an unreadable request, or nothing if the client is gone or slow.
    fn read(stream: &mut TcpStream) -> Option<std::result::Result<Self, Response>> {
        let (mut bytes, mut part) = (Vec::new(), [0; 1 << 10]);
        let start = Instant::now();
        while start.elapsed() < CLIENT {
            let count = stream.read(&mut part).ok().filter(|count| *count > 0)?;
            bytes.extend_from_slice(&part[..count]);
            if let Some(parsed) = Self::parse(&bytes) {
                return Some(parsed);
            }
            if bytes.len() > MAX_HEAD {
                return Some(Err(Response::failed(431, "the request is too long\n")));
            }
        }
        None
    }

    /// Parses the bytes received so far. Returns `None` if more are needed.
    fn parse(bytes: &[u8]) -> Option<std::result::Result<Self, Response>> {
        let mut fields = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut fields);
        match request.parse(bytes) {
            Ok(httparse::Status::Partial) => None,
            Err(error) => Some(Err(Response::failed(400, format!("the request cannot be read: {error}\n")))),
            Ok(httparse::Status::Complete(_)) => {
                let all = |name: &str| -> Vec<String> {
                    let named = request.headers.iter().filter(|field| field.name.eq_ignore_ascii_case(name));
                    named.map(|field| String::from_utf8_lossy(field.value).into_owned()).collect()
                };
                Some(Ok(Self {
                    method: request.method.unwrap_or_default().to_owned(),
                    target: request.path.unwrap_or_default().to_owned(),
                    hosts: all("Host"),
                    cookies: all("Cookie"),
                }))
            }
        }
    }
}

/// A server on a port of this machine.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    /// First part of all paths, with slashes around it.
    own: String,
    /// Secret that a request must carry.
    token: String,
}

/// Random bits from the operating system as hexadecimal digits.
fn random<const BYTES: usize>() -> Result<String> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|error| Error::new(format!("the system provides no random numbers for the address: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Compares two texts in a time that depends only on their lengths.
fn is_same(one: &str, other: &str) -> bool {
    let differ = one.bytes().zip(other.bytes()).fold(0, |differ, (a, b)| black_box(differ | (a ^ b)));
    one.len() == other.len() && differ == 0
}

impl Server {
    /// Listens on a port of the loopback address; 0 selects any free port.
    pub fn bind(port: u16) -> Result<Self> {
        let refused = |error: std::io::Error| {
            let error = Error::new(format!("port {port} of 127.0.0.1: {error}"));
            error.help("another program may use it; port 0 selects any free port").of_request()
        };
        let listener = TcpListener::bind(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port)).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        Ok(Self { listener, address, own: format!("/{}/", random::<8>()?), token: random::<16>()? })
    }

    /// Address of the first page, such as `http://127.0.0.1:8000/5d0c…/?token=91af…`. It gives access to all pages.
    pub fn url(&self) -> String {
        format!("http://{}{}?{TOKEN}={}", self.address, self.own, self.token)
    }

    /// Answers requests until the caller stops it. `handler` is called by several threads; a panic in it is answered
    /// with 500.
    pub fn run(&self, stop: &Stop, changes: &Changes, handler: &(dyn Fn(&Request) -> Response + Sync)) {
        let (waiting, open) = (Mutex::new(Vec::new()), AtomicUsize::new(0));
        thread::scope(|scope| {
            let (waiting, open) = (&waiting, &open);
            let mut version = changes.version();
            while !stop.is_requested() {
                // The system queues connections that arrive while too many are open.
                if open.load(Ordering::Acquire) < MAX_CONNECTIONS {
                    match self.listener.accept() {
                        Ok((stream, _)) => {
                            let held = OpenConnection::one(open);
                            let answer = move || {
                                let _held = held;
                                self.answer(stream, changes, handler, waiting);
                            };
                            // If no thread is available, the connection is closed, and the next one has to wait.
                            if thread::Builder::new().spawn_scoped(scope, answer).is_ok() {
                                continue;
                            }
                        }
                        Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                        // An aborted connection, or too many open files.
                        Err(_) => thread::sleep(LOOK),
                    }
                }
                version = changes.wait(version, LOOK);
                release(&mut waiting.lock(), version, Instant::now());
            }
            for Waiting { from, .. } in waiting.lock().drain(..) {
                from.send(told(changes.version()));
            }
        });
    }

    fn answer(
        &self,
        mut stream: TcpStream,
        changes: &Changes,
        handler: &(dyn Fn(&Request) -> Response + Sync),
        waiting: &Mutex<Vec<Waiting>>,
    ) {
        let limits = stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(CLIENT)));
        if limits.and_then(|()| stream.set_write_timeout(Some(CLIENT))).is_err() {
            return;
        }
        let Some(head) = RequestHead::read(&mut stream) else { return };
        let wants_body = !head.as_ref().is_ok_and(|head| head.method == "HEAD");
        let from = Client { stream, wants_body };
        let (asked, cookie) = match head.and_then(|head| self.accepted(&head)) {
            Ok(accepted) => accepted,
            Err(refused) => return from.send(refused),
        };
        if asked.path == CHANGES {
            // Without a number, the answer is the current version.
            let after = asked.query("after").and_then(|after| after.parse().ok());
            let mut waiting = waiting.lock();
            let version = changes.version();
            let at_once = match after.filter(|after| version <= *after) {
                Some(after) => {
                    let longest = (waiting.len() >= MAX_WAITING).then(|| waiting.remove(0).from);
                    waiting.push(Waiting { from, after, until: Instant::now() + PATIENCE });
                    longest
                }
                None => Some(from),
            };
            drop(waiting);
            if let Some(client) = at_once {
                client.send(told(version));
            }
            return;
        }
        let answer = catch_unwind(AssertUnwindSafe(|| handler(&asked)));
        let answer = answer.unwrap_or_else(|_| Response::failed(500, "the page could not be made\n"));
        from.send(Response { cookie, ..answer });
    }

    /// The path of a permitted request, and the cookie for the browser.
    fn accepted(&self, head: &RequestHead) -> std::result::Result<(Request, Option<String>), Response> {
        if !["GET", "HEAD"].contains(&head.method.as_str()) {
            return Err(Response::failed(405, "only GET and HEAD are supported\n"));
        }
        if !matches!(head.hosts.as_slice(), [host] if self.is_own(host)) {
            let text = format!("this server answers to http://{}/ only\n", self.address);
            return Err(Response::failed(403, text));
        }
        let refused = || Response { status: 403, ..Response::html(REFUSAL) };
        let asked = Request::parse(&head.target);
        let by_address = asked.as_ref().and_then(|asked| asked.query(TOKEN)).is_some_and(|it| is_same(it, &self.token));
        let cookies = head.cookies.iter().flat_map(|field| field.split(';'));
        let by_cookie = cookies
            .filter_map(|cookie| cookie.trim().split_once('='))
            .any(|(name, value)| name == TOKEN && is_same(value, &self.token));
        if !by_address && !by_cookie {
            return Err(refused());
        }
        let wrong = || Response::failed(400, "the path is not one of this server\n");
        let Request { path, query } = asked.ok_or_else(wrong)?;
        let inside = path.strip_prefix(&self.own).ok_or_else(wrong)?;
        let cookie = format!("{TOKEN}={}; Path={}; HttpOnly; SameSite=Strict", self.token, self.own);
        Ok((Request { path: format!("/{inside}"), query }, by_address.then_some(cookie)))
    }

    /// Whether a `Host` header names this server.
    fn is_own(&self, host: &str) -> bool {
        let port = format!(":{}", self.address.port());
        let name = host.strip_suffix(port.as_str()).unwrap_or(host).to_ascii_lowercase();
        HOSTS.contains(&name.as_str())
    }
}

/// An open connection. It counts until it is dropped.
struct OpenConnection<'a>(&'a AtomicUsize);

impl<'a> OpenConnection<'a> {
    fn one(open: &'a AtomicUsize) -> Self {
        open.fetch_add(1, Ordering::AcqRel);
        Self(open)
    }
}

impl Drop for OpenConnection<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Answers the requests that waited for this version, and the requests that waited long enough.
fn release(waiting: &mut Vec<Waiting>, version: u64, now: Instant) {
    for Waiting { from, .. } in waiting.extract_if(.., |it| version > it.after || now >= it.until) {
        from.send(told(version));
    }
}

/// An answer with the current version.
fn told(version: u64) -> Response {
    Response::json(&serde_json::json!({ "version": version }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a server whose pages echo the request, while `test` sends requests.
    fn serving(test: impl FnOnce(&Server, &Changes)) {
        let (server, stop, changes) = (Server::bind(0).expect("a port"), Stop::default(), Changes::default());
        thread::scope(|scope| {
            scope.spawn(|| {
                server.run(&stop, &changes, &|request| match request.path.as_str() {
                    "/panic" => panic!("on purpose"),
                    "/large" => Response::bytes("image/png", vec![7_u8; 3 << 20]),
                    path => Response::html(format!("{path} {:?}", request.query)),
                });
            });
            let done = catch_unwind(AssertUnwindSafe(|| test(&server, &changes)));
            stop.cancel();
            if let Err(panic) = done {
                std::panic::resume_unwind(panic);
            }
        });
    }

    /// The header with which a browser shows that it has opened the first page.
    fn cookie(server: &Server) -> String {
        format!("Cookie: theme=dark; {TOKEN}={}", server.token)
    }

    /// Sends the lines of a request with the token, and returns the answer: head and body. A path in the first line is
    /// below the server's path.
    fn raw(server: &Server, lines: &[&str]) -> (String, Vec<u8>) {
        let first = lines[0].replacen(" /", &format!(" {}", server.own), 1);
        let cookie = cookie(server);
        plain(server, &[&[first.as_str()], &lines[1..], &[cookie.as_str()]].concat())
    }

    /// Sends the lines of a request unchanged.
    fn plain(server: &Server, lines: &[&str]) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(server.address).expect("listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        stream.write_all(format!("{}\r\n\r\n", lines.join("\r\n")).as_bytes()).expect("sent");
        let mut all = Vec::new();
        stream.read_to_end(&mut all).expect("answered");
        let end = all.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("a head");
        (String::from_utf8(all[..end].to_vec()).expect("text"), all[end + 4..].to_vec())
    }

    /// The status of an answer, and its body.
    fn get(server: &Server, target: &str) -> (u16, String) {
        let (head, body) = raw(server, &[&format!("GET {target} HTTP/1.1"), "Host: localhost", "Connection: close"]);
        (status(&head), String::from_utf8_lossy(&body).into_owned())
    }

    fn status(head: &str) -> u16 {
        head.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status")
    }

    #[test]
    fn pages_come_with_their_type_and_length_and_are_not_stored() {
        serving(|server, _| {
            let (head, body) = raw(server, &["GET /a%20b?x=1+2&y HTTP/1.1", "Host: 127.0.0.1", "Connection: close"]);
            assert_eq!((status(&head), &*body), (200, &br#"/a b [("x", "1 2"), ("y", "")]"#[..]), "{head}");
            for line in ["Content-Type: text/html; charset=utf-8", "Cache-Control: no-store", "Content-Length: 30"] {
                assert!(head.lines().any(|it| it.eq_ignore_ascii_case(line)), "{line}\n{head}");
            }
            let (head, body) = raw(server, &["HEAD /large HTTP/1.1", "Host: localhost", "Connection: close"]);
            assert!(status(&head) == 200 && body.is_empty() && head.contains("Content-Length: 3145728"), "{head}");
            let (head, body) = raw(server, &["GET /large HTTP/1.1", "Host: localhost", "Connection: close"]);
            assert!(head.contains("image/png") && body == vec![7; 3 << 20], "{head}");
        });
    }

    #[test]
    fn other_methods_are_refused() {
        serving(|server, _| {
            for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"] {
                let line = format!("{method} / HTTP/1.1");
                let (head, _) = raw(server, &[&line, "Host: localhost", "Content-Length: 0", "Connection: close"]);
                assert!(status(&head) == 405 && head.contains("Allow: GET, HEAD"), "{method}: {head}");
            }
        });
    }

    #[test]
    fn a_name_that_is_made_to_mean_this_machine_reads_nothing() {
        serving(|server, _| {
            let port = server.address.port();
            let of =
                |lines: &[&str]| status(&raw(server, &[&["GET / HTTP/1.1", "Connection: close"], lines].concat()).0);
            for own in ["localhost", "LOCALHOST", "127.0.0.1", "[::1]"] {
                assert_eq!(of(&[&format!("Host: {own}:{port}")]), 200, "{own}");
            }
            for other in ["evil.example", "localhost.evil.example", "evil.example:80", "127.0.0.1.evil.example", ""] {
                assert_eq!(of(&[&format!("Host: {other}")]), 403, "{other:?}");
            }
            assert_eq!(of(&[&format!("Host: localhost:{}", port ^ 1)]), 403);
            assert_eq!(of(&[]), 403);
            assert_eq!(of(&["Host: localhost", "Host: evil.example"]), 403);
        });
    }

    #[test]
    fn who_does_not_know_the_token_reads_nothing() {
        serving(|server, _| {
            let of = |target: &str, more: &[&str]| {
                let line = format!("GET {target} HTTP/1.1");
                let (head, body) = plain(server, &[&[line.as_str(), "Host: localhost"], more].concat());
                (status(&head), head, String::from_utf8(body).expect("text"))
            };
            let (own, token) = (server.own.as_str(), server.token.as_str());
            assert!(own.len() == 18 && token.len() == 32, "{}", server.url());
            // The address opens the first page, which sets the cookie for all other pages.
            let address = server.url();
            let target = &address[address.find(own).expect("its path")..];
            let (code, head, _) = of(target, &[]);
            let set = head.lines().find_map(|line| line.strip_prefix("Set-Cookie: ")).expect("a cookie");
            assert!(code == 200 && set == format!("token={token}; Path={own}; HttpOnly; SameSite=Strict"), "{head}");
            let cookie = format!("Cookie: {}", set.split(';').next().expect("a value"));
            let inner = |path: &str| format!("{own}{path}");
            for path in ["", "a", "changes"] {
                assert_eq!(of(&inner(path), &[&cookie]).0, 200, "{path}");
                assert_eq!(of(&inner(path), &["Cookie: a=b", &cookie]).0, 200, "{path}");
            }
            assert!(!of(&inner("a"), &[&cookie]).1.contains("Set-Cookie"));
            // All other requests get the same page, whatever their target.
            let wrong = format!("Cookie: token={}", "0".repeat(token.len()));
            let short = format!("Cookie: token={}", &token[1..]);
            let other = cookie.replace("token=", "other=");
            let long = format!("{cookie}0");
            for more in [vec![], vec![wrong.as_str()], vec![&short], vec![&other], vec![&long], vec!["Cookie: token="]]
            {
                for path in [
                    "/",
                    "/a",
                    "/changes",
                    "/changes?after=0",
                    &inner(""),
                    &inner("a"),
                    &inner("changes?after=0"),
                    "/%",
                ] {
                    let (code, head, body) = of(path, &more);
                    assert_eq!((code, body.as_str()), (403, REFUSAL), "{path} {more:?}");
                    assert!(!head.contains(token) && !head.contains(own), "{head}");
                }
            }
            for query in ["?token=", "?token=0", &format!("?token={}", &token[..31]), &format!("?Token={token}")] {
                assert_eq!(of(&inner(query), &[]).0, 403, "{query}");
            }
            // Two servers share neither path nor token.
            let second = Server::bind(0).expect("a port");
            assert!(second.own != server.own && second.token != server.token);
            // A path outside the server's own path.
            assert_eq!(of("/", &[&cookie]).0, 400);
        });
        assert!(is_same("", "") && is_same("ab", "ab") && !is_same("ab", "aB") && !is_same("a", "ab"));
    }

    #[test]
    fn pages_may_run_nothing_but_files_of_the_server() {
        serving(|server, _| {
            let (head, _) = raw(server, &["GET / HTTP/1.1", "Host: localhost"]);
            for line in [
                "Referrer-Policy: no-referrer",
                "X-Content-Type-Options: nosniff",
                "Cross-Origin-Resource-Policy: same-origin",
            ] {
                assert!(head.lines().any(|it| it == line), "{line}\n{head}");
            }
            let policy =
                head.lines().find_map(|line| line.strip_prefix("Content-Security-Policy: ")).expect("a policy");
            assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"), "{policy}");
            assert!(!policy.contains("unsafe") && policy.contains("frame-ancestors 'none'"), "{policy}");
        });
    }

    #[test]
    fn paths_do_not_climb() {
        for target in
            ["/..", "/../a", "/a/../b", "/%2e%2e/a", "/a/%2E%2e", "/a/./b", "//a", "/a\\..\\b", "/a%5c..", "/%00"]
        {
            assert_eq!(Request::parse(target), None, "{target}");
        }
        for target in ["a", "http://localhost/", "*", "", "/%zz", "/%f", "/%ff", "/?%ff", "/...."] {
            assert_eq!(Request::parse(target), None, "{target}");
        }
        let path = |target: &str| Request::parse(target).map(|it| it.path);
        assert_eq!(path("/").as_deref(), Some("/"));
        assert_eq!(path("/a/b.c/?q=..").as_deref(), Some("/a/b.c/"));
        assert_eq!(path("/a+b/%C3%A4").as_deref(), Some("/a+b/ä"));
        serving(|server, _| assert_eq!(get(server, "/../etc/passwd").0, 400));
    }

    #[test]
    fn a_page_that_panics_is_an_error_and_the_next_is_served() {
        serving(|server, _| {
            for _ in 0..8 {
                assert_eq!(get(server, "/panic").0, 500);
            }
            assert_eq!(get(server, "/").0, 200);
        });
    }

    #[test]
    fn pages_wait_for_changes_without_holding_threads() {
        serving(|server, changes| {
            assert_eq!(get(server, "/changes").1, r#"{"version":0}"#);
            let waiting: Vec<_> = (0..12)
                .map(|_| {
                    let mut stream = TcpStream::connect(server.address).expect("listens");
                    let request = format!(
                        "GET {}changes?after=0 HTTP/1.1\r\nHost: localhost\r\n{}\r\n\r\n",
                        server.own,
                        cookie(server)
                    );
                    stream.write_all(request.as_bytes()).expect("sent");
                    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
                    stream
                })
                .collect();
            // All threads remain free for pages meanwhile.
            (0..12).for_each(|_| assert_eq!(get(server, "/").0, 200));
            assert_eq!(changes.publish(), 1);
            for mut stream in waiting {
                let mut text = String::new();
                stream.read_to_string(&mut text).expect("answered");
                assert!(text.ends_with(r#"{"version":1}"#), "{text}");
            }
            // A page gets a missed version at once.
            assert_eq!(get(server, "/changes?after=0").1, r#"{"version":1}"#);
        });
    }

    #[test]
    fn requests_that_wait_are_bounded_and_answered_at_the_end() {
        let mut left: Vec<TcpStream> = Vec::new();
        serving(|server, _| {
            for _ in 0..MAX_WAITING + 1 {
                let mut stream = TcpStream::connect(server.address).expect("listens");
                stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
                let request = format!(
                    "GET {}changes?after=0 HTTP/1.0\r\nHost: localhost\r\n{}\r\n\r\n",
                    server.own,
                    cookie(server)
                );
                stream.write_all(request.as_bytes()).expect("sent");
                left.push(stream);
            }
            // One of them had to be answered early.
            let answered = |stream: &TcpStream| {
                stream.set_nonblocking(true).expect("a socket");
                let some = stream.peek(&mut [0]).is_ok_and(|bytes| bytes > 0);
                stream.set_nonblocking(false).expect("a socket");
                some
            };
            let start = Instant::now();
            while !left.iter().any(answered) && start.elapsed() < Duration::from_secs(20) {
                thread::sleep(Duration::from_millis(10));
            }
            assert_eq!(left.iter().filter(|stream| answered(stream)).count(), 1);
        });
        for mut stream in left {
            let mut text = String::new();
            stream.read_to_string(&mut text).expect("answered");
            assert!(text.ends_with(r#"{"version":0}"#), "{text}");
        }
    }

    #[test]
    fn connections_that_come_together_and_stay_open_are_all_answered() {
        serving(|server, _| {
            for _ in 0..50 {
                // Like a browser: six simultaneous connections, to be reused.
                let streams: Vec<TcpStream> = (0..6)
                    .map(|_| {
                        let mut stream = TcpStream::connect(server.address).expect("listens");
                        stream.set_read_timeout(Some(Duration::from_secs(5))).expect("a timeout");
                        let request =
                            format!("GET {}a HTTP/1.1\r\nHost: localhost\r\n{}\r\n\r\n", server.own, cookie(server));
                        stream.write_all(request.as_bytes()).expect("sent");
                        stream
                    })
                    .collect();
                for mut stream in &streams {
                    let mut start = [0; 12];
                    stream.read_exact(&mut start).expect("answered");
                    assert_eq!(&start, b"HTTP/1.1 200");
                }
            }
        });
    }

    #[test]
    fn a_connection_above_the_maximum_waits_until_another_ends() {
        serving(|server, _| {
            let connect = || TcpStream::connect(server.address).expect("listens");
            let mut silent: Vec<TcpStream> = (0..MAX_CONNECTIONS).map(|_| connect()).collect();
            let mut next = connect();
            let request = format!("GET {}a HTTP/1.1\r\nHost: localhost\r\n{}\r\n\r\n", server.own, cookie(server));
            next.write_all(request.as_bytes()).expect("sent");
            let mut start = [0; 12];
            next.set_read_timeout(Some(Duration::from_millis(300))).expect("a timeout");
            assert!(next.read_exact(&mut start).is_err(), "{start:?}");
            drop(silent.pop());
            next.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
            next.read_exact(&mut start).expect("answered");
            assert_eq!(&start, b"HTTP/1.1 200");
        });
    }

    #[test]
    fn a_port_that_is_taken_is_an_error_with_a_remedy() {
        let first = Server::bind(0).expect("a port");
        let error = Server::bind(first.address.port()).err().expect("it is taken").to_string();
        assert!(error.contains(&format!("port {} of 127.0.0.1", first.address.port())) && error.contains("port 0"));
    }
}
