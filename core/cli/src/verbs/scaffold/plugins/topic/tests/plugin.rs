// The table has the stock crates with their kinds.

use linked_crates::rows;

#[test]
fn stock_crates_are_listed_with_their_kinds() {
    let rows = rows().expect("no clash");
    assert_eq!(rows[0], ["crate", "version", "kinds"]);
    let physics = rows.iter().find(|row| row[0] == "syntable-physics").expect("linked");
    assert!(physics[2].split(", ").any(|kind| kind == "rapier"), "{physics:?}");
}
