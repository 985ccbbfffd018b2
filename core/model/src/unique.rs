//! Numbers for names that no other process gives.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

/// A number that no other process draws, on this machine or another. It is for names of temporary files and owners, and never for
/// content.
pub fn unique() -> u64 {
    let mut hasher = RandomState::new().build_hasher();
    // A process that is forked inherits the state.
    hasher.write_u32(std::process::id());
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_comes_twice() {
        let drawn = || (0..1000).map(|_| unique()).collect::<Vec<_>>();
        let other = std::thread::spawn(drawn).join().expect("no panic");
        let all: std::collections::BTreeSet<u64> = drawn().into_iter().chain(other).collect();
        assert_eq!(all.len(), 2000);
    }
}
