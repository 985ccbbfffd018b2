#[test]
fn the_crate_keeps_the_rules_of_plugins() {
    let registry = syntable::Registry::linked().expect("no clash");
    assert_eq!(syntable::recipe::lints(&registry), Vec::<String>::new());
}
