//! Shared by the tests: the folders of assets, and loading through the registry.

use std::path::{Path, PathBuf};
use syntable_model::context::Collected;
use syntable_model::error::{Error, Result};
use syntable_model::inspect::{Inspection, inspect};
use syntable_model::registry::{ConstructError, Registry, Slot, Stage};
use syntable_model::stage::AssetSource;

/// The small assets of the checkout.
pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/fixtures/assets")
}

/// Folders with an `INDEX.md` to test with: the folder of the checkout, and a larger one if it exists, named by
/// `SYNTABLE_ASSETS` or in `shared/assets` beside the checkout.
pub fn roots() -> Vec<PathBuf> {
    let larger = match std::env::var_os("SYNTABLE_ASSETS") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/assets"),
    };
    let mut roots = vec![fixtures()];
    roots.extend(Some(larger).filter(|folder| folder.join("INDEX.md").is_file()));
    roots
}

/// Inspects a path; also returns the warnings.
pub fn look(path: &Path) -> (Result<Inspection>, Vec<String>) {
    let log = Collected::default();
    let found = inspect(path, &log).map(|(_, inspection)| inspection);
    (found, log.warnings().iter().map(ToString::to_string).collect())
}

/// The value of a fact.
pub fn fact<'a>(inspection: &'a Inspection, name: &str) -> &'a str {
    let value = inspection.facts.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str());
    value.unwrap_or_else(|| panic!("no fact {name} among {:?}", inspection.facts))
}

/// A source, built from the body of a recipe table.
pub fn source(kind: &str, table: &str) -> Result<Box<dyn AssetSource>> {
    let registry = Registry::linked().map_err(Error::new)?;
    let entry = registry.find(Slot::Assets, kind).ok_or_else(|| Error::new(format!("no kind {kind}")))?;
    match entry.construct_str(table) {
        Ok(constructed) => match constructed.stage {
            Stage::Assets(source) => Ok(source),
            _ => Err(Error::new("another stage")),
        },
        Err(ConstructError::Form(error)) => Err(Error::new(error.to_string())),
        Err(ConstructError::Invalid(invalid)) => Err(Error::new(invalid.message)),
    }
}

/// A source of a folder.
pub fn source_of(kind: &str, root: &Path, more: &str) -> Box<dyn AssetSource> {
    source(kind, &format!("root = {:?}\n{more}", root.display().to_string())).expect("builds")
}

/// Counts the memory that the current thread allocates, so that a test can check whether a small file needs much
/// memory.
struct CountingAllocator;

#[derive(Clone, Copy)]
struct Counts {
    live: isize,
    peak: isize,
}

thread_local! {
    static COUNTS: std::cell::Cell<Counts> = const { std::cell::Cell::new(Counts { live: 0, peak: 0 }) };
}

fn count(bytes: isize) {
    // While a thread ends, its counts are gone and nothing is measured.
    let _ = COUNTS.try_with(|counts| {
        let Counts { live, peak } = counts.get();
        counts.set(Counts { live: live + bytes, peak: peak.max(live + bytes) });
    });
}

// SAFETY: all calls go to the system's allocator unchanged.
unsafe impl std::alloc::GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: std::alloc::Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { std::alloc::System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: std::alloc::Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as the caller promises.
        unsafe { std::alloc::System.dealloc(pointer, layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: std::alloc::Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { std::alloc::System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: std::alloc::Layout, size: usize) -> *mut u8 {
        // Both blocks may exist for a moment.
        count(size as isize);
        count(-(layout.size() as isize));
        // SAFETY: as the caller promises.
        unsafe { std::alloc::System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Runs a closure; also returns its peak memory, in bytes.
pub fn peak<T>(run: impl FnOnce() -> T) -> (T, usize) {
    let before = COUNTS.with(|counts| {
        let live = counts.get().live;
        counts.set(Counts { live, peak: live });
        live
    });
    let result = run();
    let peak = COUNTS.with(|counts| counts.get().peak - before);
    (result, peak.max(0) as usize)
}
