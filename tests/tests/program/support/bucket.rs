//! A bucket of an S3 server in the test process, whose objects are files of a folder, and a network in front of it, which
//! may lose requests and answers.

use crate::support::{files, small_run, syntable};
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto;
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;
use syntable_model::random::Stream;
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};

/// Name of the bucket.
pub const BUCKET: &str = "lab";

/// Credentials that the server knows.
pub struct Key {
    pub id: &'static str,
    pub secret: &'static str,
    pub token: &'static str,
}

/// The credentials that [`Bucket::expire_after`] ends.
pub const OLD: Key = Key { id: "AKIAOLD", secret: "secret/of+the/old", token: "token-of-the-old-session" };
/// Credentials that stay valid.
pub const NEW: Key = Key { id: "AKIANEW", secret: "secret/of+the/new", token: "token-of-the-new-session" };

impl Key {
    /// Gives a command these credentials, and no others.
    pub fn give(&self, command: &mut Command) {
        let names = ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN"];
        command.envs(names.into_iter().zip([self.id, self.secret, self.token])).env("AWS_REGION", "us-east-1");
        command.env_remove("AWS_PROFILE").env_remove("AWS_ENDPOINT_URL_S3");
    }
}

/// A server with an empty bucket, until it is dropped.
pub struct Bucket {
    folder: TempDir,
    network: Arc<Network>,
    address: SocketAddr,
    server: Option<Runtime>,
}

impl Bucket {
    pub fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        ["stored/lab", "tmp"].iter().for_each(|name| fs::create_dir_all(folder.path().join(name)).expect("writable"));
        let root = folder.path().join("stored");
        let server = Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("starts");
        let behind = server.block_on(serve(&root));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        let address = listener.local_addr().expect("it listens");
        let network = Arc::new(Network {
            root,
            behind,
            ends: AtomicBool::new(false),
            state: Mutex::default(),
            turn: Mutex::default(),
        });
        let at = Arc::clone(&network);
        thread::spawn(move || at.listen(&listener));
        Self { folder, network, address, server: Some(server) }
    }

    /// A folder of this machine.
    pub fn local(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `syntable` with this server as its S3 and credentials of a key.
    pub fn reach(&self, mut command: Command, key: &Key) -> Command {
        key.give(&mut command);
        command.env("AWS_ENDPOINT_URL", format!("http://{}", self.address)).env("NO_PROXY", "127.0.0.1");
        command.env("TMPDIR", self.local("tmp"));
        command
    }

    pub fn syntable(&self, arguments: &[&str]) -> Command {
        let mut command = syntable();
        command.args(arguments);
        self.reach(command, &NEW)
    }

    /// A small run into a folder of the bucket.
    pub fn run(&self, folder: &str, more: &[&str]) -> Command {
        self.reach(small_run(Path::new(&url(folder)), more), &NEW)
    }

    /// The file of an object on the server, for a test to look at and to damage.
    pub fn stored(&self, path: &str) -> PathBuf {
        self.network.root.join(BUCKET).join(path)
    }

    /// Files of a folder, without the lock and the times of runs.
    pub fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        without_lock(files(&self.stored(folder)))
    }

    /// Checks that a folder has the files of a dataset on this machine, byte for byte.
    #[track_caller]
    pub fn assert_holds(&self, folder: &str, whole: &Path) {
        assert_same_files(&self.files(folder), &without_lock(files(whole)), folder);
    }

    /// Everything that the server keeps, with what it knows about objects.
    pub fn everything(&self) -> BTreeMap<String, Vec<u8>> {
        files(self.folder.path())
    }

    /// Begins to disturb requests: at most `faults` of them.
    pub fn disturb(&self, seed: u64, faults: u32) {
        let mut state = self.network.state.lock().expect("no panic");
        (state.random, state.left) = (Some(Stream::root(seed)), faults);
    }

    /// Carries a number of requests, and none after them; all of them without a number.
    pub fn carry(&self, requests: Option<u32>) {
        self.network.state.lock().expect("no panic").carries = requests;
    }

    /// Ends the key [`OLD`] after a number of requests from now. Later ones are answered with a status.
    pub fn expire_after(&self, requests: u32, status: &'static str) {
        let mut state = self.network.state.lock().expect("no panic");
        state.expires = Some((requests, status));
    }

    /// Method and path of the requests since the last call.
    pub fn requests(&self) -> Vec<String> {
        std::mem::take(&mut self.network.state.lock().expect("no panic").requests)
    }

    /// Number of faults by kind.
    pub fn faults(&self) -> BTreeMap<&'static str, u32> {
        self.network.state.lock().expect("no panic").faults.clone()
    }
}

impl Drop for Bucket {
    fn drop(&mut self) {
        self.network.ends.store(true, Ordering::SeqCst);
        // The listener notices it with the next connection.
        let _ = TcpStream::connect(self.address);
        if let Some(server) = self.server.take() {
            server.shutdown_background();
        }
    }
}

/// URL of a folder in the bucket.
pub fn url(folder: &str) -> String {
    format!("s3://{BUCKET}/{folder}")
}

/// Checks that two datasets are the same.
#[track_caller]
pub fn assert_same_files(left: &BTreeMap<String, Vec<u8>>, right: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert_eq!(left.keys().collect::<Vec<_>>(), right.keys().collect::<Vec<_>>(), "{what}");
    for (name, bytes) in left {
        assert!(*bytes == right[name], "{what}: {name} differs");
    }
}

fn without_lock(mut files: BTreeMap<String, Vec<u8>>) -> BTreeMap<String, Vec<u8>> {
    files.remove(".syntable/lock");
    files
}

/// Starts the server for a folder. Returns its address.
async fn serve(root: &Path) -> SocketAddr {
    let mut keys = SimpleAuth::from_single(OLD.id, OLD.secret);
    keys.register(NEW.id.into(), NEW.secret.into());
    let mut service = S3ServiceBuilder::new(FileSystem::new(root).expect("a folder"));
    service.set_auth(keys);
    let service = service.build();
    let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.expect("a free port");
    let address = listener.local_addr().expect("it listens");
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let service = service.clone();
            tokio::spawn(async move {
                let mut http = auto::Builder::new(TokioExecutor::new());
                http.http1().keep_alive(false);
                let _ = http.serve_connection(TokioIo::new(stream), service).await;
            });
        }
    });
    address
}

/// The fate of a request.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Delay(Duration),
    /// An answer that asks to send the request again. It reaches no server.
    Busy,
    /// The request reaches no server.
    LoseRequest,
    /// Of the answer of the server, this part arrives.
    LoseAnswer(f64),
}

impl Fault {
    fn name(self) -> &'static str {
        match self {
            Self::Delay(_) => "delay",
            Self::Busy => "busy",
            Self::LoseRequest => "lost request",
            Self::LoseAnswer(0.0) => "lost answer",
            Self::LoseAnswer(_) => "cut answer",
        }
    }
}

/// The network between a client and the server. Each connection has one request.
struct Network {
    /// Folder of the server.
    root: PathBuf,
    behind: SocketAddr,
    ends: AtomicBool,
    state: Mutex<State>,
    /// Held by the request that the server answers: its conditions hold for one request at a time.
    turn: Mutex<()>,
}

#[derive(Default)]
struct State {
    random: Option<Stream>,
    /// Faults to come.
    left: u32,
    /// Requests until [`OLD`] expires, and the status of answers from then on.
    expires: Option<(u32, &'static str)>,
    /// Requests until the network fails for good.
    carries: Option<u32>,
    requests: Vec<String>,
    faults: BTreeMap<&'static str, u32>,
}

impl State {
    fn draw(&mut self) -> Option<Fault> {
        if self.carries == Some(0) {
            return Some(Fault::LoseRequest);
        }
        self.carries = self.carries.map(|left| left - 1);
        let random = self.random.as_mut().filter(|_| self.left > 0)?;
        let fault = match random.below(14) {
            0 => Fault::Delay(Duration::from_millis(20 + random.below(300))),
            1 => Fault::Busy,
            2 => Fault::LoseRequest,
            3 => Fault::LoseAnswer(0.0),
            4 => Fault::LoseAnswer(random.unit()),
            _ => return None,
        };
        self.left -= 1;
        *self.faults.entry(fault.name()).or_default() += 1;
        Some(fault)
    }
}

impl Network {
    fn listen(self: Arc<Self>, listener: &TcpListener) {
        while let Ok((client, _)) = listener.accept() {
            if self.ends.load(Ordering::SeqCst) {
                return;
            }
            let network = Arc::clone(&self);
            // A client that was killed has closed its connection.
            thread::spawn(move || drop(network.carry(&client)));
        }
    }

    fn carry(&self, mut client: &TcpStream) -> io::Result<()> {
        client.set_read_timeout(Some(Duration::from_secs(30)))?;
        let Some(request) = Request::read(client)? else { return Ok(()) };
        let (fault, expired) = {
            let mut state = self.state.lock().expect("no panic");
            state.requests.push(format!("{} {}", request.method(), request.path()));
            let expired = state.expires.filter(|(left, _)| *left == 0 && request.head.contains(OLD.id));
            state.expires = state.expires.map(|(left, status)| (left.saturating_sub(1), status));
            (state.draw(), expired)
        };
        match fault {
            Some(Fault::Delay(time)) => thread::sleep(time),
            Some(Fault::Busy) => {
                return client.write_all(&request.refusal(
                    "503 Slow Down",
                    "SlowDown",
                    "Please reduce your request rate.",
                ));
            }
            Some(Fault::LoseRequest) => return client.shutdown(Shutdown::Both),
            Some(Fault::LoseAnswer(_)) | None => {}
        }
        let answer = match expired {
            Some((_, status)) => request.refusal(status, "ExpiredToken", "The provided token has expired."),
            None => self.answer(&request)?,
        };
        let arrives = match fault {
            Some(Fault::LoseAnswer(part)) => (answer.len() as f64 * part) as usize,
            _ => answer.len(),
        };
        client.write_all(&answer[..arrives])
    }

    /// The answer of the server, which takes folders of its files for objects, and buckets that are missing for empty ones.
    fn answer(&self, request: &Request) -> io::Result<Vec<u8>> {
        let _turn = self.turn.lock().expect("no panic");
        let path = request.path().trim_matches('/');
        let bucket = path.split('/').next().unwrap_or_default();
        let stored = self.root.join(path);
        if !self.root.join(bucket).is_dir() {
            return Ok(request.refusal("404 Not Found", "NoSuchBucket", "The specified bucket does not exist"));
        }
        if path != bucket && stored.is_dir() {
            return Ok(request.refusal("404 Not Found", "NoSuchKey", "The specified key does not exist."));
        }
        if let Some(key) = request.deletes().filter(|key| self.root.join(bucket).join(key).is_dir()) {
            let done = format!("<DeleteResult><Deleted><Key>{key}</Key></Deleted></DeleteResult>");
            return Ok(request.answer("200 OK", &done));
        }
        let mut server = TcpStream::connect(self.behind)?;
        server.write_all(request.head.as_bytes())?;
        server.write_all(&request.body)?;
        let mut answer = Vec::new();
        server.read_to_end(&mut answer)?;
        if request.method() == "POST" {
            let _ = remove_empty(&self.root.join(bucket));
        }
        Ok(answer)
    }
}

/// Removes the empty folders in a folder.
fn remove_empty(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            remove_empty(&path)?;
            // A folder with files stays.
            let _ = fs::remove_dir(&path);
        }
    }
    Ok(())
}

/// A whole request.
struct Request {
    head: String,
    body: Vec<u8>,
}

impl Request {
    /// Reads a request; none if the client sent only a part.
    fn read(mut client: &TcpStream) -> io::Result<Option<Self>> {
        let mut bytes = Vec::new();
        let mut part = [0; 1 << 16];
        loop {
            let count = client.read(&mut part)?;
            if count == 0 {
                return Ok(None);
            }
            bytes.extend_from_slice(&part[..count]);
            let Some(end) = bytes.windows(4).position(|bytes| bytes == b"\r\n\r\n") else { continue };
            let head = String::from_utf8_lossy(&bytes[..end + 4]).into_owned();
            let length = head
                .lines()
                .find_map(|line| line.to_ascii_lowercase().strip_prefix("content-length:")?.trim().parse().ok());
            let mut body = bytes.split_off(end + 4);
            let missing = length.unwrap_or(0_u64).saturating_sub(body.len() as u64);
            let read = client.take(missing).read_to_end(&mut body)? as u64;
            return Ok((read == missing).then_some(Self { head, body }));
        }
    }

    fn method(&self) -> &str {
        self.head.split(' ').next().unwrap_or_default()
    }

    /// The path without its query. Names in tests are not escaped.
    fn path(&self) -> &str {
        self.head.split([' ', '?']).nth(1).unwrap_or_default()
    }

    /// The key that a request deletes, if it is one.
    fn deletes(&self) -> Option<&str> {
        let body = std::str::from_utf8(&self.body).ok().filter(|_| self.method() == "POST")?;
        let (key, rest) = body.split_once("<Key>")?.1.split_once("</Key>")?;
        (!rest.contains("<Key>")).then_some(key)
    }

    /// An error as S3 sends it.
    fn refusal(&self, status: &str, code: &str, message: &str) -> Vec<u8> {
        self.answer(status, &format!("<Error><Code>{code}</Code><Message>{message}</Message></Error>"))
    }

    fn answer(&self, status: &str, xml: &str) -> Vec<u8> {
        let xml = if self.method() == "HEAD" {
            String::new()
        } else {
            format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{xml}")
        };
        let length = xml.len();
        let head = "Content-Type: application/xml\r\nConnection: close\r\nContent-Length";
        format!("HTTP/1.1 {status}\r\n{head}: {length}\r\n\r\n{xml}").into_bytes()
    }
}
