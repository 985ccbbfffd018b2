// The check finds a mask that is too large, and accepts a small one.

use sane_sizes::faults;
use syntable::Registry;
use syntable::model::check::LabelFault;
use syntable::model::product::standard::VISIBLE_MASK;
use syntable::model::product::{Mask, Products};
use syntable::model::scene::InstanceId;

#[test]
fn a_mask_of_the_whole_image_is_a_fault() {
    let of = |columns: u32| {
        let mut products = Products::new();
        let mask = Mask::from_fn(10, 4, |x, _| x < columns);
        products.put(VISIBLE_MASK, [(InstanceId(3), mask)].into_iter().collect()).expect("new");
        faults(&products).expect("readable")
    };
    assert_eq!(of(9), []);
    assert_eq!(of(10), [LabelFault::of(InstanceId(3), "it covers 100 % of the image")]);
}

#[test]
fn the_program_has_the_check() {
    let registry = Registry::linked().expect("no clash");
    assert!(registry.checks().iter().any(|check| check.name() == "sane_sizes"));
}
