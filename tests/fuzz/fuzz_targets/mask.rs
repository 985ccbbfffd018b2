//! The run-length codec of masks.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syntable_model::product::Mask;

fuzz_target!(|input: (u16, u16, &str)| {
    let (width, height, text) = (u32::from(input.0), u32::from(input.1), input.2);
    let Ok(mask) = Mask::from_coco(width, height, text) else { return };
    let again = Mask::from_coco(width, height, &mask.to_coco()).expect("what was written is read");
    assert_eq!(mask, again);
    // The runs say the same as the counts and the box.
    let area: u32 = mask.runs().map(|run| run.end - run.start).sum();
    assert_eq!(area, mask.area());
    assert_eq!(mask.and(&again).area(), area);
    assert!(mask.minus(&again).is_empty());
    if u64::from(width) * u64::from(height) <= 1 << 16 {
        let plane = mask.to_plane();
        assert_eq!(Mask::from_fn(width, height, |x, y| *plane.at(x, y)), mask);
    }
});
