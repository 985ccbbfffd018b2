//! Datasets in a bucket, over HTTP: the bytes of a dataset in a folder, whatever a network, a kill or credentials do.

use crate::support::bucket::{BUCKET, Bucket, Key, NEW, OLD, assert_same_files, url};
use crate::support::{assert_same, fails, ok, small_run, syntable, text};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use std::{fs, thread};
use syntable_testing::folder::files;
use syntable_testing::tools::skip_slow_tool;
use tempfile::TempDir;

const THREE: [&str; 2] = ["--set", "dataset.scenes=3"];

/// The dataset of an undisturbed run into a folder.
fn whole(more: &[&str]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    ok(&mut small_run(&whole, more));
    (folder, whole)
}

#[test]
fn a_bucket_gets_the_files_of_a_folder() {
    let bucket = Bucket::start();
    let (_folder, whole) = whole(&[]);
    ok(&mut bucket.run("a/mine", &[]));
    bucket.assert_holds("a/mine", &whole);
    assert!(!bucket.stored("a/mine/.syntable/lock").exists(), "it is given back");
    let said = ok(&mut bucket.syntable(&["status", &url("a/mine")]));
    assert!(said.contains(&url("a/mine")) && said.contains("2 of 2"), "{said}");
    let verify = || bucket.syntable(&["verify", &url("a/mine")]);
    let said = ok(&mut verify());
    assert!(said.contains("0 missing, 0 damaged, 0 foreign"), "{said}");
    bucket.requests();
    ok(&mut bucket.run("a/mine", &[]));
    let requests = bucket.requests();
    let images = requests.iter().filter(|request| request.starts_with("PUT") && request.ends_with(".png"));
    assert_eq!(images.count(), 0, "{requests:?}");
    bucket.assert_holds("a/mine", &whole);
    ok(&mut bucket.run("a/mine", &THREE));
    ok(&mut small_run(&whole, &THREE));
    bucket.assert_holds("a/mine", &whole);
    // Damage is found, and made good.
    let images: Vec<_> = bucket.files("a/mine").into_keys().filter(|name| name.ends_with(".png")).collect();
    let [damaged, removed] = [&images[0], &images[1]];
    let at = |name: &str| bucket.stored("a/mine").join(name);
    let mut bytes = fs::read(at(damaged)).expect("readable");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(at(damaged), bytes).expect("writable");
    fs::remove_file(at(removed)).expect("there");
    fs::write(at("notes.txt"), "mine").expect("writable");
    let said = text(&verify().output().expect("starts"));
    for line in [format!("damaged  {damaged}"), format!("missing  {removed}"), "foreign  notes.txt".into()] {
        assert!(said.contains(&line), "{line} is not in\n{said}");
    }
    assert!(said.contains("1 missing, 1 damaged, 1 foreign") && said.contains("--repair"), "{said}");
    ok(&mut bucket.run("a/mine", &[&THREE[..], &["--repair"]].concat()));
    fs::remove_file(at("notes.txt")).expect("it stays");
    bucket.assert_holds("a/mine", &whole);
}

/// Repeats a command until it succeeds. Each failure must tell that the same command goes on.
fn insist(mut command: impl FnMut() -> Command) {
    let mut said = String::new();
    for _ in 0..20 {
        let output = command().output().expect("starts");
        if output.status.success() {
            return;
        }
        said = text(&output);
        assert!(output.status.code() == Some(1) && said.contains("run the same command"), "{said}");
        assert!(said.contains(&format!("s3://{BUCKET}/")), "{said}");
    }
    panic!("it never succeeds: {said}");
}

#[test]
fn a_bad_network_changes_no_byte() {
    let (_folder, whole) = whole(&THREE);
    let mut faults = BTreeMap::new();
    for seed in 1..=2 {
        let bucket = Bucket::start();
        bucket.disturb(seed, 60);
        insist(|| bucket.run("mine", &THREE));
        ["status", "verify"].iter().for_each(|verb| insist(|| bucket.syntable(&[verb, &url("mine")])));
        bucket.assert_holds("mine", &whole);
        bucket.faults().into_iter().for_each(|(name, count)| *faults.entry(name).or_insert(0) += count);
    }
    assert!(faults.len() == 5 && faults.values().all(|count| *count > 3), "{faults:?}");
}

#[test]
fn a_run_goes_on_after_the_network_failed() {
    let bucket = Bucket::start();
    let (_folder, whole) = whole(&THREE);
    ok(&mut bucket.run("other", &THREE));
    bucket.carry(Some(bucket.requests().len() as u32 / 2));
    let start = Instant::now();
    let error = fails(&mut bucket.run("mine", &THREE), 1);
    assert!(error.contains(&url("mine")) && error.contains("then run the same command"), "{error}");
    assert!(start.elapsed() < Duration::from_secs(120), "{:?}", start.elapsed());
    bucket.carry(None);
    // As if the time of the lease had passed: without a network, it cannot be given back.
    let _ = fs::remove_file(bucket.stored("mine/.syntable/lock"));
    ok(&mut bucket.run("mine", &THREE));
    bucket.assert_holds("mine", &whole);
}

#[test]
fn workers_share_a_dataset_in_a_bucket() {
    let bucket = Bucket::start();
    let scenes = ["--set", "dataset.scenes=4"];
    let (_folder, whole) = whole(&scenes);
    let worker = || {
        let mut worker = bucket.run("mine", &[&scenes[..], &["--claim", "1", "--threads", "1"]].concat());
        worker.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts")
    };
    bucket.disturb(9, 60);
    let workers = [worker(), worker(), worker()];
    for worker in workers {
        let output = worker.wait_with_output().expect("waits");
        assert!(output.status.success(), "{}", text(&output));
    }
    bucket.assert_holds("mine", &whole);
}

/// Waits until a condition holds.
#[track_caller]
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited for a minute until {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// Starts a command without its output.
fn start(mut command: Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts")
}

#[test]
fn a_run_that_was_killed_goes_on() {
    let bucket = Bucket::start();
    let (_folder, whole) = whole(&THREE);
    let lock = bucket.stored("mine/.syntable/lock");
    let count = || bucket.requests().iter().filter(|request| request.starts_with("PUT")).count();
    ok(&mut bucket.run("other", &THREE));
    let all = count();
    let mut uploads = 0;
    for part in [1, 3, 5, 7] {
        let mut run = start(bucket.run("mine", &THREE));
        until("a part of the files is uploaded", || {
            uploads += count();
            uploads >= all * part / 8 || run.try_wait().expect("waits").is_some()
        });
        run.kill().expect("killable");
        assert!(!run.wait().expect("waits").success(), "it ended before it was killed");
        assert!(lock.exists(), "a killed run cannot give it back");
        // As if the time of its lease had passed, except after the last kill.
        if part < 7 {
            fs::remove_file(&lock).expect("there");
        }
    }
    let start = Instant::now();
    ok(&mut bucket.run("mine", &THREE));
    assert!(start.elapsed() > Duration::from_secs(15), "the lease of the killed run lasts: {:?}", start.elapsed());
    bucket.assert_holds("mine", &whole);
    assert!(!lock.exists());
}

#[test]
fn shards_in_a_bucket_are_merged() {
    let bucket = Bucket::start();
    let (folder, whole) = whole(&THREE);
    let shard = |number: &str| bucket.run("x", &[&THREE[..], &["--shard", number]].concat());
    let both = ["0/3", "1/3"].map(|number| start(shard(number)));
    for mut run in both {
        assert!(run.wait().expect("waits").success());
    }
    let status = || text(&bucket.syntable(&["status", &url("x.shards")]).output().expect("starts"));
    let said = status();
    assert!(said.contains("shard 2") && said.contains(&url("x.shards/0-of-3")), "{said}");
    let merge = |to: &str| bucket.syntable(&["merge", to, &url("x.shards")]);
    let error = fails(&mut merge(&url("x")), 2);
    assert!(error.contains("shard") && error.contains("--partial"), "{error}");
    ok(&mut shard("2/3"));
    let said = status();
    assert!(said.contains("3 of 3") && !said.contains("no folder"), "{said}");
    ok(&mut merge(&url("x")));
    bucket.assert_holds("x", &whole);
    let local = folder.path().join("merged");
    ok(&mut merge(&local.display().to_string()));
    assert_same_files(&files(&local), &files(&whole), "merged into a folder");
}

#[test]
fn two_runs_at_once_are_refused() {
    let bucket = Bucket::start();
    let mut first = start(bucket.run("mine", &["--set", "dataset.scenes=5000", "--threads", "1"]));
    until("the first run holds the lock", || bucket.stored("mine/.syntable/lock").exists());
    let error = fails(&mut bucket.run("mine", &[]), 1);
    assert!(error.contains("another run is writing this dataset") && error.contains(&url("mine")), "{error}");
    let said = text(&bucket.syntable(&["status", &url("mine")]).output().expect("starts"));
    assert!(said.contains("running"), "{said}");
    assert!(first.try_wait().expect("waits").is_none(), "it goes on");
    first.kill().expect("killable");
    first.wait().expect("waits");
}

/// Checks that no output and no file holds the secret, the token or a signature.
#[track_caller]
fn assert_no_secret(texts: &BTreeMap<String, Vec<u8>>) {
    let secrets = [OLD.secret, OLD.token, NEW.secret, NEW.token, "X-Amz-Signature", "Signature="];
    for (name, bytes) in texts {
        for secret in secrets {
            let is_there = bytes.windows(secret.len()).any(|part| part == secret.as_bytes());
            assert!(!is_there, "{secret} is in {name}: {}", String::from_utf8_lossy(bytes));
        }
    }
}

#[test]
fn a_run_goes_on_with_new_credentials() {
    let bucket = Bucket::start();
    let (_folder, whole) = whole(&THREE);
    ok(&mut bucket.run("other", &THREE));
    let all = bucket.requests().len() as u32;
    let run = |key: &Key| bucket.reach(small_run(Path::new(&url("mine")), &THREE), key);
    for status in ["403 Forbidden", "400 Bad Request", "403 Forbidden"] {
        bucket.expire_after(all / 4, status);
        let start = Instant::now();
        let output = run(&OLD).output().expect("starts");
        let said = text(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        for says in ["expired", "get new ones, then run the same command", &url("mine")] {
            assert!(said.contains(says), "{says} is not in\n{said}");
        }
        assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
        let mut all = bucket.everything();
        all.insert("the output".into(), said.into_bytes());
        assert_no_secret(&all);
        // As if the time of the lease had passed: with expired credentials, it cannot be given back.
        let _ = fs::remove_file(bucket.stored("mine/.syntable/lock"));
    }
    ok(&mut run(&NEW));
    bucket.assert_holds("mine", &whole);
    assert_no_secret(&bucket.everything());
}

#[test]
fn wrong_buckets_and_credentials_fail_soon_with_a_remedy() {
    let bucket = Bucket::start();
    let reach = |key: &Key| bucket.reach(small_run(Path::new(&url("mine")), &[]), key);
    let elsewhere = bucket.reach(small_run(Path::new("s3://lob/mine"), &[]), &NEW);
    let mut nowhere = reach(&NEW);
    let closed = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|it| it.local_addr()).expect("a free port");
    nowhere.env("AWS_ENDPOINT_URL", format!("http://{closed}"));
    let mut nobody = reach(&NEW);
    nobody.env_remove("AWS_ACCESS_KEY_ID").env_remove("AWS_SECRET_ACCESS_KEY").env_remove("AWS_SESSION_TOKEN");
    nobody.env("HOME", bucket.local("home"));
    for (mut command, code, says) in [
        (elsewhere, 2, ["s3://lob/mine", "bucket does not exist", "check the name of the bucket"]),
        (reach(&Key { id: "AKIANOBODY", ..NEW }), 1, ["s3://lab/mine", "credentials", "have expired"]),
        (reach(&Key { secret: "wrong", ..NEW }), 1, ["s3://lab/mine", "credentials", "have expired"]),
        (nowhere, 1, ["s3://lab/mine", "Connection refused", "check the network, the endpoint"]),
        (nobody, 2, ["no credentials for S3", "aws configure", "set AWS_ACCESS_KEY_ID"]),
    ] {
        let start = Instant::now();
        let error = fails(&mut command, code);
        assert!(says.iter().all(|part| error.contains(part)), "{says:?}:\n{error}");
        assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
        assert_no_secret(&BTreeMap::from([("the output".to_owned(), error.into_bytes())]));
    }
}

/// A server of another project.
struct Moto {
    server: Child,
    port: u16,
}

impl Moto {
    /// Starts the server with an empty bucket; none if it is not installed.
    fn start() -> Option<Self> {
        let port =
            TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|it| it.local_addr()).expect("a free port").port();
        let mut command = Command::new("moto_server");
        command.args(["--host", "127.0.0.1", "--port", &port.to_string()]).stdout(Stdio::null()).stderr(Stdio::null());
        let Ok(server) = command.spawn() else {
            skip_slow_tool("moto_server");
            return None;
        };
        let moto = Self { server, port };
        until("moto listens", || TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_ok());
        moto.ask("PUT", &format!("/{BUCKET}"));
        Some(moto)
    }

    /// The body of an answer.
    fn ask(&self, method: &str, path: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).expect("it listens");
        // It checks no signature.
        let signed =
            format!("Authorization: AWS4-HMAC-SHA256 Credential={}/20260101/us-east-1/s3/aws4_request", NEW.id);
        let head = format!("{method} {path} HTTP/1.0\r\nHost: 127.0.0.1\r\n{signed}\r\nContent-Length: 0\r\n\r\n");
        stream.write_all(head.as_bytes()).expect("sent");
        let mut all = Vec::new();
        stream.read_to_end(&mut all).expect("answered");
        let end = all.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("a head");
        assert!(
            all.starts_with(b"HTTP/1.1 20") || all.starts_with(b"HTTP/1.0 20"),
            "{}",
            String::from_utf8_lossy(&all)
        );
        all.split_off(end + 4)
    }

    /// Files of a folder.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let listed =
            String::from_utf8(self.ask("GET", &format!("/{BUCKET}?list-type=2&prefix={folder}/"))).expect("text");
        let keys = listed.split("<Key>").skip(1).filter_map(|rest| rest.split_once("</Key>"));
        let files =
            keys.map(|(key, _)| (key[folder.len() + 1..].to_owned(), self.ask("GET", &format!("/{BUCKET}/{key}"))));
        files.filter(|(name, _)| name != ".syntable/lock" && name != ".syntable/times.jsonl").collect()
    }

    fn syntable(&self, mut command: Command) -> Command {
        NEW.give(&mut command);
        command.env("AWS_ENDPOINT_URL", format!("http://127.0.0.1:{}", self.port)).env("NO_PROXY", "127.0.0.1");
        command
    }
}

impl Drop for Moto {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn another_server_gets_the_files_of_a_folder() {
    let Some(moto) = Moto::start() else { return };
    let (_folder, whole) = whole(&[]);
    let at = url("mine");
    let same = || {
        let mut files = files(&whole);
        files.remove(".syntable/lock");
        assert_same_files(&moto.files("mine"), &files, "mine");
    };
    let run = |more: &[&str]| moto.syntable(small_run(Path::new(&at), more));
    let verb = |verb: &str| {
        let mut command = syntable();
        command.args([verb, &at]);
        moto.syntable(command)
    };
    ok(&mut run(&[]));
    same();
    ["status", "verify"].iter().for_each(|name| drop(ok(&mut verb(name))));
    ok(&mut run(&THREE));
    ok(&mut small_run(&whole, &THREE));
    same();
    let image = moto.files("mine").into_keys().find(|name| name.ends_with(".png")).expect("an image");
    moto.ask("DELETE", &format!("/{BUCKET}/mine/{image}"));
    let said = text(&verb("verify").output().expect("starts"));
    assert!(said.contains(&format!("missing  {image}")) && said.contains("1 missing, 0 damaged, 0 foreign"), "{said}");
    ok(&mut run(&[&THREE[..], &["--repair"]].concat()));
    same();
}

/// The emulator of Azure's own project, which knows one account.
struct Azurite {
    server: Child,
    port: u16,
    _folder: TempDir,
}

/// Container of the emulator.
const CONTAINER: &str = "lab";

impl Azurite {
    /// Starts the server with an empty container; none if it is not installed.
    fn start() -> Option<Self> {
        let port =
            TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|it| it.local_addr()).expect("a free port").port();
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = Command::new("azurite-blob");
        command.args(["--inMemoryPersistence", "--silent", "--skipApiVersionCheck", "--blobPort", &port.to_string()]);
        command.current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
        let Ok(server) = command.spawn() else {
            skip_slow_tool("azurite-blob");
            return None;
        };
        let azurite = Self { server, port, _folder: folder };
        until("azurite listens", || TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_ok());
        let mut create = Command::new("python3");
        create.arg("-c").arg(include_str!("support/azure_container.py")).args([&port.to_string(), CONTAINER]);
        ok(&mut create);
        Some(azurite)
    }

    fn reach(&self, mut command: Command) -> Command {
        command.env("AZURE_STORAGE_USE_EMULATOR", "true").env("NO_PROXY", "127.0.0.1");
        command.env("AZURITE_BLOB_STORAGE_URL", format!("http://127.0.0.1:{}", self.port));
        command
    }

    fn syntable(&self, arguments: &[&str]) -> Command {
        let mut command = syntable();
        command.args(arguments);
        self.reach(command)
    }
}

impl Drop for Azurite {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn azure_gets_and_gives_a_dataset() {
    let Some(azurite) = Azurite::start() else { return };
    let (folder, whole) = whole(&THREE);
    let at = format!("az://{CONTAINER}/sets/mine");
    let run = |more: &[&str]| azurite.reach(small_run(Path::new(&at), more));
    ok(&mut run(&[]));
    // Two workers make the third scene.
    let mut workers: Vec<Child> =
        (0..2).map(|_| run(&[&THREE[..], &["--claim", "1"]].concat()).spawn().expect("starts")).collect();
    assert!(workers.iter_mut().all(|worker| worker.wait().expect("waits").success()));
    let said = ok(&mut azurite.syntable(&["verify", &at]));
    assert!(said.contains("0 missing, 0 damaged, 0 foreign"), "{said}");
    // The same files come back.
    let back = folder.path().join("back");
    ok(&mut azurite.syntable(&["merge", &back.to_string_lossy(), &at]));
    assert_same(&back, &whole);
    let stats = |of: &str| {
        let mut stats = azurite.syntable(&["stats", "--json", of]);
        ok(stats.env("SYNTABLE_CACHE", folder.path().join("cache"))).replace(of, "")
    };
    assert_eq!(stats(&at), stats(&whole.to_string_lossy()));
}
