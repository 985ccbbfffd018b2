// The verb has a sound command line, and the help of the program lists it.

use slot_kinds::{command, kinds_of};
use syntable::Registry;

#[test]
fn the_verb_lists_kinds_of_a_slot() {
    command().debug_assert();
    let registry = Registry::linked().expect("no clash");
    assert!(kinds_of(&registry, "settle").contains(&"rapier"));
    assert_eq!(kinds_of(&registry, "nothing"), [] as [&str; 0]);
    assert!(syntable_cli::help_pages().iter().any(|(name, _)| name == "syntable slot_kinds"));
}
