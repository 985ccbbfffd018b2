//! Tests that need a tool from outside: a Python module, a graphics adapter, a language server.

use std::io::Write;

/// Says that a test is skipped since something is missing, past the capture of the test harness. Where
/// `SYNTABLE_REQUIRE_TOOLS` is 1, as in CI, the test fails instead.
pub fn skip(what: &str) {
    let is_required = std::env::var("SYNTABLE_REQUIRE_TOOLS").as_deref() == Ok("1");
    assert!(!is_required, "{what} is missing, and SYNTABLE_REQUIRE_TOOLS is set");
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    let _ = writeln!(std::io::stderr(), "skipped: {name}: {what} is missing");
}

/// Whether something is there; if not, [`skip`]s.
pub fn is_there(there: bool, what: &str) -> bool {
    if !there {
        skip(what);
    }
    there
}
