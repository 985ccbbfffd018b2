//! pycocotools reads files that these types wrote.

use std::path::Path;
use std::process::Command;
use syntable_formats::coco::{Category, CocoAnnotation, CocoImage};
use syntable_formats::dataset::CocoDataset;
use syntable_formats::dataset::JsonLayout;
use syntable_formats::segmentation::{Rle, Segmentation, UncompressedRle};
use syntable_model::product::Mask;
use syntable_model::random::Stream;
use syntable_testing::tools::is_there;

const WIDTH: u32 = 60;
const HEIGHT: u32 = 45;

/// Masks in all encodings. Polygons have random corners, some with whole coordinates, some outside the image; they
/// cross themselves.
fn segmentations() -> Vec<Segmentation> {
    let mut stream = Stream::root(8);
    let mut all = Vec::new();
    for i in 0..200 {
        let corners = stream.integer(3, 9) as usize;
        let outline = |stream: &mut Stream| -> Vec<f64> {
            let number = |stream: &mut Stream, size: u32| {
                let value = stream.uniform(-5.0, f64::from(size) + 5.0);
                if i % 3 == 0 { value.round() } else { value }
            };
            (0..corners).flat_map(|_| [number(stream, WIDTH), number(stream, HEIGHT)]).collect()
        };
        let outlines = (0..1 + i % 2).map(|_| outline(&mut stream)).collect();
        all.push(Segmentation::Polygons(outlines));
    }
    for i in 0..20 {
        let center = [stream.uniform(0.0, 60.0), stream.uniform(0.0, 45.0)];
        let mask = Mask::from_fn(WIDTH, HEIGHT, |x, y| {
            (f64::from(x) - center[0]).hypot(f64::from(y) - center[1]) < 3.0 * f64::from(i)
        });
        all.push(Segmentation::Rle(Rle::encode(&mask)));
        all.push(Segmentation::Uncompressed(UncompressedRle::encode(&mask)));
    }
    all
}

#[test]
fn pycocotools_reads_the_same_masks() {
    let image = CocoImage { id: 1, file_name: "a.png".into(), width: WIDTH, height: HEIGHT, ..Default::default() };
    let category = Category { id: 1, name: "object".into(), ..Default::default() };
    let annotations = (1..).zip(segmentations()).map(|(id, segmentation)| {
        let mask = segmentation.decode(WIDTH, HEIGHT).expect("sound");
        let mut extra = syntable_formats::Extra::new();
        extra.insert("expected".into(), mask.to_coco().into());
        let bbox = Some(<[i32; 4]>::from(mask.bbox()).map(f64::from));
        let area = Some(mask.area().into());
        CocoAnnotation {
            id,
            image_id: 1,
            category_id: 1,
            segmentation: Some(segmentation),
            area,
            bbox,
            iscrowd: 0,
            extra,
        }
    });
    let file = CocoDataset {
        info: Default::default(),
        licenses: Vec::new(),
        categories: vec![category],
        images: vec![image],
        annotations: annotations.collect(),
        extra: Default::default(),
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let mut out = std::fs::File::create(&path).expect("writable");
    file.write(&mut out, "a.json", JsonLayout::Lines).expect("writable");
    assert_eq!(CocoDataset::read(&path).expect("reads"), file);

    let here = Command::new("python3").args(["-c", "import pycocotools.coco"]).output();
    if !is_there(here.is_ok_and(|output| output.status.success()), "python3 with pycocotools") {
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_coco.py");
    let output = Command::new("python3").arg(script).arg(&path).output().expect("python3 starts");
    let printed = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success() && printed[0].contains("240 masks"), "{}{}", printed[0], printed[1]);
}
