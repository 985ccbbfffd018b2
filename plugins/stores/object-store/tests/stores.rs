//! Object stores in memory: the behavior of all stores, leases, and answers that are lost.

use futures_util::stream::BoxStream;
use object_store::memory::InMemory;
use object_store::path::Path as Key;
use object_store::{
    CopyOptions, Error as Failure, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    ObjectStoreExt, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result as Answer, UpdateVersion,
};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, StoreFolder};
use syntable_object_store::{LeaseTimes, Objects};
use syntable_testing::store::check_store;

const TIMES: LeaseTimes = LeaseTimes { renewal: Duration::from_millis(40), lasts: Duration::from_millis(400) };

fn folder(store: Arc<dyn ObjectStore>) -> StoreFolder {
    Arc::new(Objects::new(store, "test://bucket", TIMES)).into()
}

fn path(path: &str) -> DatasetPath {
    DatasetPath::new(path).expect("a path")
}

#[test]
fn a_bucket_is_a_store() {
    check_store(|| folder(Arc::new(InMemory::new())));
    check_store(|| folder(Arc::new(InMemory::new())).inner(&path("a/b")));
}

#[test]
fn large_files_are_uploaded_in_parts_and_read_by_ranges() {
    use std::io::{Read, Seek, SeekFrom};
    let bytes: Vec<u8> = (0..40 << 20_u32).map(|number: u32| (number % 251) as u8).collect();
    let files = folder(Arc::new(InMemory::new()));
    let at = path("a/large.bin");
    files.put(&at, &mut |file| file.write_all(&bytes).map_err(|error| unreachable!("{error}"))).expect("uploaded");
    let mut opened = files.open(&at).expect("readable").expect("there");
    assert_eq!(opened.size, bytes.len() as u64);
    for start in [0, 17, (16 << 20) - 3, (40 << 20) - 5] {
        opened.seek(SeekFrom::Start(start as u64)).expect("within");
        let mut part = [0; 5];
        opened.read_exact(&mut part).expect("readable");
        assert_eq!(part, bytes[start..start + 5], "at {start}");
    }
    assert!(files.read(&at).expect("readable").expect("there") == bytes);
}

#[test]
fn a_lease_is_held_as_long_as_it_is_renewed() {
    let store: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
    // Each is a program of its own.
    let [first, second] = [(); 2].map(|()| folder(Arc::clone(&store)));
    let at = path(".syntable/lock");
    let held = first.lock(&at, Access::Write).expect("free").expect("free");
    thread::sleep(TIMES.lasts * 2);
    assert!(second.lock(&at, Access::Write).expect("readable").is_none(), "it is renewed");
    assert!(second.lock(&at, Access::Read).expect("readable").is_none(), "it is renewed");
    first.write(&path("a"), b"a").expect("held");
    drop(held);
    assert!(!second.has(&at).expect("readable"), "it was given back");
    assert!(second.lock(&at, Access::Write).expect("free").is_some());
}

#[test]
fn a_lease_that_nobody_renews_is_taken_over() {
    let store: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
    let left = "{\"owner\":\"0123456789abcdef\",\"renewal\":7}\n";
    requests().block_on(store.put(&Key::from(".syntable/lock"), left.into())).expect("written");
    let start = Instant::now();
    let at = path(".syntable/lock");
    let taken: usize = thread::scope(|threads| {
        let takers: Vec<_> = (0..6)
            .map(|_| {
                let files = folder(Arc::clone(&store));
                let at = &at;
                threads.spawn(move || files.lock(at, Access::Write).expect("readable"))
            })
            .collect();
        let held: Vec<_> = takers.into_iter().map(|taker| taker.join().expect("no panic")).collect();
        held.iter().flatten().count()
    });
    assert_eq!(taken, 1, "one of many takes it over");
    assert!(start.elapsed() >= TIMES.lasts, "after its time");
}

/// A suspended run continues when others share its dataset.
#[test]
fn who_shares_an_ended_lease_takes_it_from_its_owner() {
    let store: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
    let key = Key::from(".syntable/lock");
    let text = |renewal: u32| format!("{{\"owner\":\"0123456789abcdef\",\"renewal\":{renewal}}}\n");
    let left = requests().block_on(store.put(&key, text(7).into())).expect("written");
    let shared = thread::scope(|threads| {
        let sharers = [(); 3].map(|()| {
            let files = folder(Arc::clone(&store));
            threads.spawn(move || {
                let tries = (0..3).map(|_| files.lock(&path(".syntable/lock"), Access::Share).expect("readable"));
                tries.into_iter().flatten().next()
            })
        });
        sharers.map(|sharer| sharer.join().expect("no panic"))
    });
    assert!(shared.iter().all(Option::is_some), "each of them shares it");
    let mode = PutMode::Update(UpdateVersion { e_tag: left.e_tag, version: left.version });
    let options = PutOptions { mode, ..PutOptions::default() };
    let renewed = requests().block_on(store.put_opts(&key, text(8).into(), options));
    assert!(renewed.is_err(), "{renewed:?}");
    let third = folder(Arc::clone(&store));
    assert!(third.lock(&path(".syntable/lock"), Access::Write).expect("readable").is_none(), "it is shared");
}

#[test]
fn a_run_that_lost_its_lease_writes_nothing() {
    let store: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
    let files = folder(Arc::clone(&store));
    let held = files.lock(&path(".syntable/lock"), Access::Write).expect("free").expect("free");
    let other = "{\"owner\":\"fedcba9876543210\",\"renewal\":0}\n";
    requests().block_on(store.put(&Key::from(".syntable/lock"), other.into())).expect("taken over");
    thread::sleep(TIMES.renewal * 4);
    for done in [
        files.write(&path("a"), b"a"),
        files.write_new(&path("a"), b"a").map(drop),
        files.append(&path("a"), b"a"),
        files.remove_all(&path("b")),
    ] {
        let error = done.expect_err("lost").to_string();
        assert!(error.contains("another program may have taken over the dataset"), "{error}");
    }
    drop(held);
    assert_eq!(
        files.read(&path(".syntable/lock")).expect("readable"),
        Some(other.into()),
        "the lease of the other run stays"
    );
    files.write(&path("a"), b"a").expect("no lease is held any more");
}

#[test]
fn a_lost_lease_stops_the_writes_of_its_dataset_only() {
    let store: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
    let files = folder(Arc::clone(&store));
    let lock = "sets/mine/.syntable/lock";
    let _held = files.lock(&path(lock), Access::Write).expect("free").expect("free");
    let other = "{\"owner\":\"fedcba9876543210\",\"renewal\":0}\n";
    requests().block_on(store.put(&Key::from(lock), other.into())).expect("taken over");
    thread::sleep(TIMES.renewal * 4);
    for written in ["sets/mine2/a", "sets/a", "mine/a"] {
        files.write(&path(written), b"a").expect(written);
    }
    for refused in ["sets/mine/a", "sets/mine/.syntable/journal/000000.json"] {
        let error = files.write(&path(refused), b"a").expect_err(refused).to_string();
        assert!(error.contains(lock), "{error}");
    }
    assert!(files.rename(&path("mine/a"), &path("sets/mine/a")).is_err());
    assert!(files.remove_all(&path("sets/mine")).is_err());
}

/// Requests on a condition are not sent again by the client: the first one may have succeeded, and its answer was lost.
#[test]
fn a_lost_answer_changes_no_outcome() {
    for lost in [Lost::Request, Lost::Answer] {
        let flaky = || Arc::new(Flaky { inner: InMemory::new(), lost, puts: Mutex::default() });
        check_store(|| folder(flaky()));
        let store = flaky();
        let files = folder(Arc::clone(&store) as _);
        for (bytes, is_new) in [("first", true), ("second", false), ("first", true)] {
            assert_eq!(files.write_new(&path("a"), bytes.as_bytes()), Ok(is_new), "{bytes}");
        }
        for number in 0..20 {
            files.append(&path("log"), format!("{number}\n").as_bytes()).expect("appended");
        }
        let want: String = (0..20).map(|number| format!("{number}\n")).collect();
        assert_eq!(files.read(&path("log")).expect("readable"), Some(want.into_bytes()));
        let held = files.lock(&path("lock"), Access::Write).expect("free").expect("free");
        thread::sleep(TIMES.lasts);
        files.write(&path("b"), b"b").expect("it is still held");
        assert!(store.puts.lock().values().sum::<u32>() > 20);
        drop(held);
    }
}

#[test]
fn a_renewal_that_hangs_loses_no_lease() {
    let store = Flaky { inner: InMemory::new(), lost: Lost::Time, puts: Mutex::default() };
    let files = folder(Arc::new(store));
    let held = files.lock(&path("lock"), Access::Write).expect("free").expect("free");
    for _ in 0..20 {
        thread::sleep(TIMES.lasts / 5);
        let start = Instant::now();
        files.write(&path("a"), b"a").expect("it is held");
        assert!(start.elapsed() < TIMES.lasts, "{:?}", start.elapsed());
    }
    drop(held);
    assert!(!files.has(&path("lock")).expect("readable"));
}

#[test]
fn a_run_whose_credentials_have_expired_waits_for_no_renewal() {
    let store = Flaky { inner: InMemory::new(), lost: Lost::Rights, puts: Mutex::default() };
    let files = folder(Arc::new(store));
    let _held = files.lock(&path("lock"), Access::Write).expect("free").expect("free");
    files.write(&path("a"), b"a").expect("it is held");
    thread::sleep(TIMES.lasts * 2);
    let start = Instant::now();
    let error = files.write(&path("a"), b"a").expect_err("not renewed").to_string();
    assert!(error.contains("test://bucket/lock") && error.contains("get new ones"), "{error}");
    assert!(start.elapsed() < TIMES.lasts, "{:?}", start.elapsed());
}

fn requests() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().build().expect("starts")
}

/// The loss of uploads on a condition.
#[derive(Debug, Clone, Copy)]
enum Lost {
    /// Every other one, before it reaches the store.
    Request,
    /// Every other one, after it reached the store.
    Answer,
    /// All but the first one: the store denies them.
    Rights,
    /// Every third one takes far too long, and has an effect.
    Time,
}

/// A store in which uploads on a condition fail.
#[derive(Debug)]
struct Flaky {
    inner: InMemory,
    lost: Lost,
    /// Uploads on a condition so far, by key: a request that is sent again must not fail by the turn of another key.
    puts: Mutex<BTreeMap<Key, u32>>,
}

impl fmt::Display for Flaky {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "flaky")
    }
}

#[async_trait::async_trait]
impl ObjectStore for Flaky {
    async fn put_opts(&self, key: &Key, payload: PutPayload, options: PutOptions) -> Answer<PutResult> {
        let is_plain = matches!(options.mode, PutMode::Overwrite);
        let number = {
            let mut puts = self.puts.lock();
            let count = puts.entry(key.clone()).or_default();
            *count += u32::from(!is_plain);
            count.saturating_sub(1)
        };
        let fails = match self.lost {
            Lost::Request | Lost::Answer => number % 2 == 0,
            Lost::Rights => number > 0,
            Lost::Time => number % 3 == 2,
        };
        if is_plain || !fails {
            return self.inner.put_opts(key, payload, options).await;
        }
        match self.lost {
            Lost::Request => {}
            Lost::Answer => drop(self.inner.put_opts(key, payload, options).await?),
            Lost::Time => {
                drop(self.inner.put_opts(key, payload, options).await?);
                tokio::time::sleep(TIMES.lasts * 20).await;
            }
            Lost::Rights => return Err(Failure::PermissionDenied { path: key.to_string(), source: "403".into() }),
        }
        Err(Failure::Generic { store: "flaky", source: "the connection was closed".into() })
    }

    async fn put_multipart_opts(&self, key: &Key, options: PutMultipartOptions) -> Answer<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(key, options).await
    }

    async fn get_opts(&self, key: &Key, options: GetOptions) -> Answer<GetResult> {
        self.inner.get_opts(key, options).await
    }

    fn delete_stream(&self, keys: BoxStream<'static, Answer<Key>>) -> BoxStream<'static, Answer<Key>> {
        self.inner.delete_stream(keys)
    }

    fn list(&self, prefix: Option<&Key>) -> BoxStream<'static, Answer<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Key>) -> Answer<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Key, to: &Key, options: CopyOptions) -> Answer<()> {
        self.inner.copy_opts(from, to, options).await
    }
}
