// The metric counts, and the program finds it by name.

use count_error as _;
use syntable::evaluation::Convention;
use syntable::evaluation::image::ImagePair;
use syntable::evaluation::masked_object::MaskedObject;
use syntable::evaluation::measure::{Measures, Tally};
use syntable::model::product::Mask;

#[test]
fn differences_are_averaged_over_images() {
    let objects = |count: u32| -> Vec<MaskedObject> {
        let mask = |k| Mask::from_fn(8, 1, move |x, _| x == k);
        (0..count).map(|k| MaskedObject::labeled(mask(k), mask(k))).collect()
    };
    let measures = Measures::named(&["count_error".into()], &[], Convention::Release).expect("registered");
    let tally = |labels, predictions| measures.tally(&ImagePair::new(objects(labels), objects(predictions)).expect("sound"));
    let tallies: Vec<Tally> = vec![tally(3, 3), tally(4, 1), tally(2, 5)];
    assert_eq!(measures.values(&tallies.iter().collect::<Vec<_>>()), [Some(2.0)]);
    assert_eq!(measures.values(&[]), [None]);
}
