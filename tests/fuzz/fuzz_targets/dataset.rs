//! Annotation files of other programs: COCO's and SynTable's, from text to masks.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syntable_formats::dataset::Layout;
use syntable_formats::{coco, syntable};

fuzz_target!(|text: &[u8]| {
    if let Ok(dataset) = coco::Dataset::from_reader(text) {
        for annotation in &dataset.annotations {
            // Images of any size are legal, but decoding large ones takes time that finds nothing.
            let image = dataset.images.iter().find(|image| image.id == annotation.image_id);
            let Some(image) = image.filter(|image| image.width <= 512 && image.height <= 512) else { continue };
            let Some(segmentation) = &annotation.segmentation else { continue };
            let Ok(mask) = segmentation.decode(image.width, image.height) else { continue };
            assert_eq!((mask.width(), mask.height()), (image.width, image.height));
        }
        let mut written = Vec::new();
        dataset.write(&mut written, "fuzz.json", Layout::Lines).expect("memory takes all");
        assert_eq!(coco::Dataset::from_reader(&written[..]).expect("what was written is read"), dataset);
    }
    if let Ok(dataset) = syntable::Dataset::from_reader(text) {
        for image in &dataset.images {
            let _ = image.camera();
        }
        for annotation in &dataset.annotations {
            let _ = annotation.object();
        }
    }
});
