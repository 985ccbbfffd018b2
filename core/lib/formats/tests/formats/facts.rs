//! Compares the types with files of SynTable's release, UOAIS-Sim and COCO.

use serde_json::{Value as Json, json};
use syntable_formats::dataset::JsonLayout;
use syntable_formats::segmentation::{Rle, Segmentation, UncompressedRle};
use syntable_formats::syntable::{self, syntable_1};
use syntable_model::product::Mask;

/// A file in the form that the released program writes with `json.dump(…, indent=4)`: keys, order, types, and the wrong
/// areas.
const RELEASED: &str = r#"{
    "info": {
        "description": "Train Dataset",
        "url": "nil",
        "version": "0.1.0",
        "year": 2022,
        "contributor": "someone",
        "date_created": "2023-03-11 14:58:53.946477"
    },
    "licenses": [
        {
            "id": 1,
            "name": "Attribution-NonCommercial-ShareAlike License",
            "url": "http://creativecommons.org/licenses/by-nc-sa/2.0/"
        }
    ],
    "categories": [
        {
            "id": 1,
            "name": "object",
            "supercategory": "shape"
        }
    ],
    "images": [
        {
            "id": 1,
            "file_name": "data/mono/rgb/0_0.png",
            "depth_file_name": "data/mono/depth/0_0.png",
            "occlusion_order_file_name": "data/mono/occlusion_order/0_0.npy",
            "width": 4,
            "height": 3,
            "date_captured": "2023-03-11 14:58:53.946477",
            "license": 1,
            "coco_url": "",
            "flickr_url": ""
        }
    ],
    "annotations": [
        {
            "id": 1,
            "image_id": 1,
            "category_id": 1,
            "bbox": [
                1,
                1,
                2,
                2
            ],
            "width": 4,
            "height": 3,
            "object_name": "tless_obj_000025",
            "iscrowd": 0,
            "segmentation": {
                "size": [
                    3,
                    4
                ],
                "counts": "42102",
                "area": 40
            },
            "area": 0,
            "visible_mask": {
                "size": [
                    3,
                    4
                ],
                "counts": "42102",
                "area": 4
            },
            "visible_bbox": [
                1,
                1,
                2,
                2
            ],
            "occluded_mask": {
                "size": [
                    3,
                    4
                ],
                "counts": "<",
                "area": 0
            },
            "occluded_rate": 0.0
        }
    ]
}
"#;

type Released = syntable_formats::dataset::AnnotationDataset<syntable::SynTableImage, syntable_1::SynTable1Annotation>;

fn written<I: serde::Serialize, A: serde::Serialize>(
    file: &syntable_formats::dataset::AnnotationDataset<I, A>,
    layout: JsonLayout,
) -> String {
    let mut out = Vec::new();
    file.write(&mut out, "a.json", layout).expect("memory");
    String::from_utf8(out).expect("UTF-8")
}

/// A test image of 4 × 3 pixels: the middle 2 × 2 pixels of the lower rows.
fn small() -> Mask {
    Mask::from_fn(4, 3, |x, y| (1..3).contains(&x) && y > 0)
}

#[test]
fn the_released_form_is_read_and_written_byte_for_byte() {
    let file = Released::from_reader(RELEASED.as_bytes()).expect("reads");
    assert!(file.extra.is_empty() && file.images[0].extra.is_empty() && file.annotations[0].extra.is_empty());
    assert_eq!(written(&file, JsonLayout::Indented), RELEASED);
    assert_eq!(file.annotations[0].segmentation.decode().expect("sound"), small());
    // The other type of annotation reads the same file, and leaves no field unknown.
    let file = syntable::SynTableDataset::from_reader(RELEASED.as_bytes()).expect("reads");
    let annotation = &file.annotations[0];
    assert!(
        annotation.extra.is_empty() && annotation.object.is_none() && file.images[0].camera().expect("none").is_none()
    );
    assert_eq!((annotation.area, annotation.segmentation.area), (0, Some(40)), "neither is the area of the mask");
    assert_eq!(annotation.visible_mask.area, Some(u64::from(annotation.visible_mask.decode().expect("sound").area())));
    assert!(annotation.occluded_mask.as_ref().expect("there").decode().expect("sound").is_empty());
}

#[test]
fn keys_that_uoais_net_does_not_need_may_be_missing() {
    // The fields that its loader reads: four keys and the depth path of images; eight keys of annotations and the area.
    let mask = json!({ "size": [3, 4], "counts": "42102" });
    let text = json!({
        "images": [{ "id": 7, "file_name": "tabletop/color/1.png", "depth_file_name": "tabletop/depth/1.png",
                     "height": 3, "width": 4 }],
        "categories": [{ "id": 1, "name": "object" }],
        "annotations": [{ "id": 3, "image_id": 7, "bbox": [1, 1, 2, 2], "category_id": 1, "segmentation": mask,
                          "visible_mask": mask, "occluded_mask": { "size": [3, 4], "counts": "<" },
                          "occluded_rate": 0.0, "occluder_mask": null }],
    });
    let file = syntable::SynTableDataset::from_reader(text.to_string().as_bytes()).expect("reads");
    assert_eq!(file.annotations[0].extra.keys().collect::<Vec<_>>(), ["occluder_mask"], "unknown fields are kept");
    let again: Json = serde_json::from_str(&written(&file, JsonLayout::Lines)).expect("JSON");
    assert_eq!(again["annotations"][0]["occluder_mask"], Json::Null);
    assert_eq!(again["images"][0], text["images"][0]);
}

#[test]
fn our_own_fields_survive_reading_and_writing() {
    let pose =
        json!([[1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.30000000000000004], [0.0, 0.0, 0.0, 1.0]]);
    let rle = Rle::encode(&small());
    let image = syntable::SynTableImage {
        id: 5,
        file_name: syntable::rgb_path(1, 2, "png"),
        depth_file_name: Some(syntable::depth_path(1, 2)),
        occlusion_order_file_name: Some(syntable::occlusion_order_path(1, 2)),
        width: 4,
        height: 3,
        scene_id: Some(1),
        view_id: Some(2),
        instance_ids: Some(vec![3]),
        camera: Some(json!({
            "width": 4, "height": 3, "K": [[2.5, 0.0, 2.0], [0.0, 2.5, 1.5], [0.0, 0.0, 1.0]], "world_from_camera": pose,
            "length_unit": "m",
        })),
        exposure: Some(Json::Null),
        ..Default::default()
    };
    let annotation = syntable::SynTableAnnotation {
        id: 9,
        image_id: 5,
        category_id: syntable::OBJECT_CATEGORY,
        instance_id: Some(3),
        object_name: Some("mug".into()),
        bbox: [1, 1, 2, 2],
        visible_bbox: Some([1, 1, 2, 2]),
        amodal_bbox: Some([1, 1, 2, 2]),
        width: Some(4),
        height: Some(3),
        iscrowd: 0,
        area: 4,
        visible_area: Some(4),
        occluded_area: Some(0),
        occluded_rate: Some(1.0 / 3.0),
        occluded_rate_rounded: Some(0.33),
        segmentation: rle.clone(),
        visible_mask: rle.clone(),
        occluded_mask: Some(rle),
        object: Some(json!({ "name": "mug", "world_from_object": pose, "camera_from_object": pose, "mass_kg": 0.2 })),
        extra: Default::default(),
    };
    let file = syntable::SynTableDataset {
        info: Default::default(),
        licenses: Vec::new(),
        categories: Vec::new(),
        images: vec![image],
        annotations: vec![annotation],
        extra: serde_json::Map::from_iter([("relations".to_owned(), json!([1, 2]))]),
    };
    for layout in [JsonLayout::Lines, JsonLayout::Indented] {
        let text = written(&file, layout);
        let again = syntable::SynTableDataset::from_reader(text.as_bytes()).expect("reads");
        assert_eq!(again, file);
        assert_eq!(written(&again, layout), text);
    }
    let camera = file.images[0].camera().expect("a camera").expect("there");
    assert_eq!((camera.k[0][2], camera.world_from_camera[2][3]), (2.0, 0.300_000_000_000_000_04));
    assert_eq!(camera.extra["length_unit"], "m");
    assert_eq!(file.annotations[0].object().expect("an object").expect("there").name, "mug");
    let mut wrong = file.images[0].clone();
    wrong.camera = Some(json!({ "width": 4, "height": 3, "K": [1.0] }));
    let error = wrong.camera().expect_err("refused").to_string();
    assert!(error.starts_with("image 5: `camera`: `K[0]`: invalid type: floating point `1.0`"), "{error}");
}

#[test]
fn coco_masks_are_read_in_every_encoding() {
    let text = r#"{"images": [{"license": 3, "file_name": "a.jpg", "height": 3, "width": 4, "id": 1, "rights": "x"}],
        "categories": [{"supercategory": "kitchen", "id": 47, "name": "cup"}],
        "annotations": [
            {"segmentation": {"counts": "42102", "size": [3, 4]}, "area": 4, "iscrowd": 0, "image_id": 1,
             "bbox": [1, 1.0, 2, 2.5], "category_id": 47, "id": 1},
            {"segmentation": {"counts": [4, 2, 1, 2, 3], "size": [3, 4]}, "area": 4.0, "iscrowd": true, "image_id": 1,
             "bbox": [1, 1, 2, 2], "category_id": 47, "id": 2, "ignore": 0},
            {"segmentation": [[1, 1, 3, 1, 3, 3, 1, 3]], "area": 4, "iscrowd": false, "image_id": 1,
             "bbox": [1, 1, 2, 2], "category_id": 47, "id": 3},
            {"area": 4, "image_id": 1, "bbox": [1, 1, 2, 2], "category_id": 47, "id": 4}]}"#;
    let file = syntable_formats::dataset::CocoDataset::from_reader(text.as_bytes()).expect("reads");
    for annotation in &file.annotations[..3] {
        let mask = annotation.segmentation.as_ref().expect("there").decode(4, 3).expect("sound");
        assert_eq!(mask, small(), "{annotation:?}");
    }
    assert_eq!(file.annotations.iter().map(|annotation| annotation.iscrowd).collect::<Vec<_>>(), [0, 1, 0, 0]);
    assert!(file.annotations[3].segmentation.is_none());
    assert_eq!(file.images[0].extra["rights"], "x");
    assert_eq!(
        syntable_formats::dataset::CocoDataset::from_reader(written(&file, JsonLayout::Lines).as_bytes())
            .expect("reads"),
        file
    );
    assert_eq!(UncompressedRle::encode(&small()).counts, [4, 2, 1, 2, 3]);
}

#[test]
fn errors_name_file_line_and_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let read = |text: &str| {
        std::fs::write(&path, text).expect("writable");
        let error = syntable::SynTableDataset::read(&path).expect_err("refused");
        assert_eq!(error.file(), Some(path.as_path()));
        error.to_string().replace(&path.display().to_string(), "a.json")
    };
    for (from, to, want) in [
        (
            "\"occluded_rate\": 0.0",
            "\"occluded_rate\": \"0\"",
            "a.json:84: `annotations[0].occluded_rate`: invalid type: string \"0\"",
        ),
        (
            "\"counts\": \"42102\",\n                \"area\": 4\n",
            "\"area\": 4\n",
            "a.json:68: `annotations[0].visible_mask`: missing field `counts`",
        ),
        ("\"width\": 4", "\"width\": -4", "a.json:30: `images[0].width`: invalid value: integer `-4`"),
        ("\"file_name\": \"data", "\"file\": \"data", "a.json:36: `images[0]`: missing field `file_name`"),
        ("\"annotations\"", "\"annotation\"", "a.json:87: missing field `annotations`"),
        ("    ]\n}\n", "    ]\n}\n}", "a.json:88: trailing characters"),
        ("    ]\n}\n", "", "a.json:86: `annotations`: EOF while parsing a list"),
    ] {
        let text = RELEASED.replacen(from, to, 1);
        assert_ne!(text, RELEASED, "{from}");
        let error = read(&text);
        assert!(error.starts_with(want), "{error}\nnot {want}");
    }
    std::fs::remove_file(&path).expect("there");
    assert!(syntable::SynTableDataset::read(&path).expect_err("missing").is_io());
}

#[test]
fn damaged_masks_are_refused() {
    let rle = |size, counts: &str| Rle { size, counts: counts.into(), area: None }.decode();
    assert!(rle([3, 4], "4210").expect_err("short").to_string().contains("runs add up to 9, not to 4 × 3 pixels"));
    assert!(rle([3, 4], "!").is_err() && rle([0, 0], "").is_ok());
    let error = rle([1 << 20, 1 << 20], "0").expect_err("large").to_string();
    assert!(error.starts_with("1048576 × 1048576 pixels are more than the limit of "), "{error}");
    let segmentation = Segmentation::Rle(Rle::encode(&small()));
    let error = segmentation.decode(3, 4).expect_err("another size").to_string();
    assert_eq!(error, "the mask has the size [3, 4], its image [4, 3]");
    for (outline, want) in [
        (vec![0.0; 4], "a polygon of 4 numbers"),
        (vec![0.0; 7], "a polygon of 7 numbers"),
        (vec![0.0, 1.0, f64::NAN, 2.0, 3.0, 3.0], "a polygon has the coordinate NaN"),
        (vec![0.0, 1.0, 1e9, 2.0, 3.0, 3.0], "a polygon has the coordinate 1000000000"),
    ] {
        let error = Segmentation::Polygons(vec![outline]).decode(4, 3).expect_err("refused").to_string();
        assert!(error.starts_with(want), "{error}");
    }
    for text in ["{\"size\": [3, 4]}", "{\"size\": [3, 4], \"counts\": 3}", "7", "[[\"a\"]]", "[3]"] {
        assert!(serde_json::from_str::<Segmentation>(text).is_err(), "{text}");
    }
}
