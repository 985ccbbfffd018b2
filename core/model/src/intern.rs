//! Names that are made at run time, as the `'static` texts of kinds and products.

use parking_lot::Mutex;
use std::collections::BTreeSet;

/// All names so far.
static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());

/// The one `'static` text of a name.
///
/// Names of kinds and products that a crate registers are part of the program. A kind that a program adds at run time,
/// say for a function of another language, gets its name from here. This is state of the process: a name stays until
/// the process ends, and takes its bytes once, however often it is requested.
///
/// ```
/// # use syntable_model::intern::intern;
/// assert!(std::ptr::eq(intern("tilt"), intern(&String::from("tilt"))));
/// ```
pub fn intern(name: &str) -> &'static str {
    let mut names = NAMES.lock();
    match names.get(name) {
        Some(known) => known,
        None => {
            let name: &'static str = Box::leak(name.into());
            names.insert(name);
            name
        }
    }
}
