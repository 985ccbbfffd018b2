//! Files of COCO's family from other programs: crowds, boxes without masks, unfamiliar ids, KITTI's folders.

use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;
use syntable_formats::encode::png;
use syntable_interchange as _;
use syntable_model::prelude::*;
use syntable_model::product::BBox;
use syntable_model::product::standard::{
    AMODAL_MASK, CATEGORY_ID, OCCLUSION_MASK, OCCLUSION_ORDER, RGB, RGB_FILE, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::reader::{FaultSubject, OpenDataset};
use syntable_testing::takes::open_dataset;

/// A square of 4 × 4 px as a polygon.
fn square(x: u32, y: u32) -> Json {
    json!([[x, y, x + 4, y, x + 4, y + 4, x, y + 4]])
}

/// Run lengths, in column order, of a rectangle `[x, y, width, height]` in an image of 20 × 10 px.
fn rectangle([x, y, w, h]: [u32; 4]) -> Json {
    let mask = Mask::from_fn(20, 10, |u, v| (x..x + w).contains(&u) && (y..y + h).contains(&v));
    json!({ "size": [10, 20], "counts": mask.to_coco() })
}

fn annotation(id: u64, segmentation: Option<Json>, more: Json) -> Json {
    let mut annotation = json!({
        "id": id, "image_id": 1, "category_id": 7, "iscrowd": 0, "area": 16.0, "bbox": [1.5, 2.0, 3.0, 4.0],
    });
    let fields = annotation.as_object_mut().expect("an object");
    fields.extend(segmentation.map(|it| ("segmentation".to_owned(), it)));
    fields.extend(more.as_object().expect("an object").clone());
    annotation
}

fn open(root: &Path, annotations: &[Json]) -> OpenDataset {
    open_of(root, annotations, json!([{ "id": 7, "name": "mug" }]))
}

fn open_of(root: &Path, annotations: &[Json], categories: Json) -> OpenDataset {
    let file = json!({
        "images": [{ "id": 1, "file_name": "a.png", "width": 20, "height": 10 }],
        "annotations": annotations,
        "categories": categories,
    });
    fs::create_dir_all(root.join("annotations")).expect("a folder");
    fs::write(root.join("annotations/instances_val.json"), file.to_string()).expect("written");
    open_dataset(root, None).unwrap_or_else(|error| panic!("{error}")).1
}

fn read(reader: &OpenDataset) -> Products {
    let wants: Vec<KeyId> =
        reader.offers.iter().copied().filter(|key| ![RGB.id(), RGB_FILE.id()].contains(key)).collect();
    reader.read(0, &wants).unwrap_or_else(|error| panic!("{error}")).products
}

/// Names and contents as other programs write them: the format follows from the keys of annotations.
#[test]
fn files_of_other_programs_are_recognized() {
    let amodal = rectangle([2, 2, 6, 4]);
    let seen = rectangle([2, 2, 4, 4]);
    let plain = |more: Json| annotation(1, Some(square(2, 2)), more);
    let images = json!([{ "id": 1, "file_name": "a.png", "width": 20, "height": 10 }]);
    let lvis = json!([{ "id": 1, "coco_url": "http://images.cocodataset.org/val2017/a.png", "width": 20.0, "height": 10.0,
                        "neg_category_ids": [3] }]);
    let cvat = json!([{ "id": 1, "file_name": "a.png", "width": 20, "height": 10, "license": 0, "date_captured": 0,
                        "flickr_url": "", "coco_url": null }]);
    let info =
        json!({ "info": { "year": "2026", "version": 2, "contributor": null, "description": ["x"] }, "licenses": [] });
    let mut lacks_numbers = plain(json!({}));
    for key in ["area", "bbox"] {
        lacks_numbers.as_object_mut().expect("an object").remove(key);
    }
    for (case, file, image, images, annotation, format, areas) in [
        ("Roboflow", "_annotations.coco.json", "a.png", &images, plain(json!({})), "coco", [16, 0]),
        ("any name beside the images", "labels.json", "a.png", &images, plain(json!({})), "coco", [16, 0]),
        (
            "CVAT",
            "annotations/instances_default.json",
            "images/default/a.png",
            &cvat,
            plain(json!({})),
            "coco",
            [16, 0],
        ),
        ("LVIS", "annotations/lvis_v1_val.json", "val2017/a.png", &lvis, plain(json!({})), "coco", [16, 0]),
        ("instances of KINS' name", "instances_val.json", "a.png", &images, plain(json!({})), "coco", [16, 0]),
        ("no numbers", "annotations/x.json", "photos/first/a.png", &images, lacks_numbers, "coco", [16, 0]),
        (
            "COCOA-cls",
            "annotations/COCO_amodal_val2014_with_classes.json",
            "val2014/a.png",
            &images,
            annotation(1, Some(amodal.clone()), json!({ "visible_mask": seen, "occlude_rate": 0.33 })),
            "coco",
            [16, 24],
        ),
        (
            "KINS in COCO's folder",
            "annotations/instances_val.json",
            "images/a.png",
            &images,
            annotation(1, Some(amodal.clone()), json!({ "inmodal_seg": seen, "inmodal_bbox": [2, 2, 4, 4] })),
            "kins",
            [16, 24],
        ),
        (
            "D2SA of another name",
            "annotations/val.json",
            "images/a.png",
            &images,
            annotation(1, Some(amodal), json!({ "visible_mask": seen, "occl_depth": 1, "iscrowd": false })),
            "d2sa",
            [16, 24],
        ),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, image] = [file, image].map(|name| folder.path().join(name));
        for path in [&file, &image] {
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        }
        fs::write(&image, png::PngImage::rgb(&Plane::from_fn(20, 10, |_, _| [9_u8; 3])).encode().expect("an image"))
            .expect("written");
        let mut json = info.clone();
        json["images"] = images.clone();
        json["annotations"] = json!([annotation]);
        json["categories"] = json!([{ "id": 7, "name": "mug", "supercategory": null }]);
        fs::write(&file, json.to_string()).expect("written");
        for named in [folder.path(), &*file] {
            let (found, opened) = open_dataset(named, None).unwrap_or_else(|error| panic!("{case}: {error}"));
            assert_eq!((found.name(), opened.images.len(), opened.info.categories().count()), (format, 1, 1), "{case}");
            let products = opened.read(0, &opened.offers).unwrap_or_else(|error| panic!("{case}: {error}")).products;
            let area = |key: Key<PerInstance<Mask>>| -> u32 {
                let masks = products.optional(key).expect("masks");
                masks.map_or(0, |masks| masks.iter().map(|(_, mask)| mask.area()).sum())
            };
            assert_eq!([VISIBLE_MASK, AMODAL_MASK].map(area), areas, "{case}");
            assert_eq!(products.get(RGB).expect("there").width(), 20, "{case}");
        }
    }
}

/// Masks and depth often have the names of the images: no folder of several is guessed.
#[test]
fn images_are_not_guessed_among_several_folders() {
    let folder = tempfile::tempdir().expect("a folder");
    let image = png::PngImage::rgb(&Plane::from_fn(20, 10, |_, _| [9_u8; 3])).encode().expect("an image");
    for name in ["depth", "photos"] {
        fs::create_dir(folder.path().join(name)).expect("a folder");
        fs::write(folder.path().join(name).join("a.png"), &image).expect("written");
    }
    let found = open(folder.path(), &[annotation(1, Some(square(2, 2)), json!({}))]);
    assert!(found.read(0, &[RGB.id()]).is_err());
    fs::remove_dir_all(folder.path().join("depth")).expect("removable");
    let found = open(folder.path(), &[annotation(1, Some(square(2, 2)), json!({}))]);
    assert!(found.read(0, &[RGB.id()]).is_ok());
}

#[test]
fn crowds_are_no_objects() {
    let folder = tempfile::tempdir().expect("a folder");
    let crowd = annotation(2, Some(rectangle([0, 0, 20, 10])), json!({ "iscrowd": 1 }));
    let found = open(folder.path(), &[annotation(1, Some(square(2, 2)), json!({})), crowd]);
    let products = read(&found);
    let masks: Vec<u32> = products.get(VISIBLE_MASK).expect("there").iter().map(|(_, mask)| mask.area()).collect();
    assert_eq!(masks, [16]);
    assert!(
        found.caveats(&[]).iter().any(|it| it.contains("crowds") && it.contains("1 were")),
        "{:?}",
        found.caveats(&[])
    );
}

#[test]
fn files_of_boxes_have_boxes_and_categories() {
    for segmentation in [None, Some(json!([]))] {
        let folder = tempfile::tempdir().expect("a folder");
        let found = open(folder.path(), &[annotation(1, segmentation, json!({}))]);
        assert!(!found.offers.contains(&VISIBLE_MASK.id()));
        let products = read(&found);
        // All pixels that [1.5, 4.5) × [2, 6) touches.
        let boxes: Vec<BBox> = products.get(VISIBLE_BOX).expect("there").iter().map(|(_, it)| *it).collect();
        assert_eq!(boxes, [BBox::from([1, 2, 4, 4])]);
        assert_eq!(products.get(CATEGORY_ID).expect("there").iter().map(|(_, it)| *it).collect::<Vec<_>>(), [7]);
        assert!(found.caveats(&[]).iter().any(|it| it.contains("boxes")), "{:?}", found.caveats(&[]));
    }
}

#[test]
fn ids_in_any_order_tell_objects_apart() {
    let amodal = |id: u64, own: Json, shape: [u32; 4], visible: [u32; 4]| {
        let more = json!({ "instance_id": own, "visible_mask": rectangle(visible) });
        annotation(id, Some(rectangle(shape)), more)
    };
    // The second annotation hides a part of the first.
    let pair = |first: Json, second: Json| {
        [amodal(1, first, [2, 2, 6, 4], [2, 2, 3, 4]), amodal(2, second, [5, 2, 6, 4], [5, 2, 6, 4])]
    };
    for (ids, expected, is_fault) in [
        ([json!(2), json!(1)], [2, 1], false),
        ([json!(40), json!(9)], [40, 9], false),
        ([json!(3), json!(3)], [1, 2], true),
        ([json!(0), json!(1)], [1, 2], true),
        ([json!(70_000), json!(1)], [1, 2], true),
        ([json!("a"), json!(1)], [1, 2], true),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let [first, second] = ids.clone();
        let found = open(folder.path(), &pair(first, second));
        let products = read(&found);
        let [hidden, front] = expected.map(InstanceId);
        let masks = products.get(VISIBLE_MASK).expect("there");
        assert_eq!([hidden, front].map(|id| masks.get(id).expect("there").area()), [12, 24], "{ids:?}");
        let order = products.get(OCCLUSION_ORDER).expect("there");
        let [hidden, front] = [hidden, front].map(|id| order.ids().binary_search(&id).expect("there"));
        assert!(order.occludes(front, hidden) && !order.occludes(hidden, front), "{ids:?}");
        assert_eq!(found.image_faults(0).iter().any(|it| it.rule == "unique_ids"), is_fault, "{ids:?}");
    }
}

#[test]
fn a_category_may_have_the_id_0() {
    for (name, classes, want) in [("cat", &["cat", "dog"][..], "cat"), ("Background", &["dog"], "object")] {
        let folder = tempfile::tempdir().expect("a folder");
        let of =
            |id: u64, category: u64| annotation(id, Some(square(2 * id as u32, 2)), json!({ "category_id": category }));
        let categories = json!([{ "id": 0, "name": name }, { "id": 1, "name": "dog" }]);
        let found = open_of(folder.path(), &[of(1, 0), of(5, 1)], categories);
        assert_eq!(found.info.classes, classes);
        let ids: Vec<u32> = read(&found).get(CATEGORY_ID).expect("there").iter().map(|(_, it)| *it).collect();
        let named = |id: &u32| found.info.categories().find(|(other, _)| other == id).expect("known").1.to_owned();
        assert_eq!(ids.iter().map(named).collect::<Vec<_>>(), [want, "dog"]);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let twice = json!([{ "id": 7, "name": "cat" }, { "id": 7, "name": "dog" }]);
    let found = open_of(folder.path(), &[annotation(1, Some(square(2, 2)), json!({}))], twice);
    assert!(
        found.all_faults().iter().any(|it| it.rule == "unique_ids" && it.subject == Some(FaultSubject::Category(7))),
        "{:?}",
        found.all_faults()
    );
}

#[test]
fn harmless_habits_of_other_tools_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let more = json!({ "id": 1.0, "image_id": 1.0, "category_id": 7.0, "iscrowd": null, "visible_mask": null });
    open(folder.path(), &[annotation(1, Some(square(2, 2)), more)]);
    let path = folder.path().join("annotations/instances_val.json");
    let mut data: Json = serde_json::from_slice(&fs::read(&path).expect("there")).expect("JSON");
    data["info"] = json!(null);
    data["licenses"] = json!(null);
    data["categories"][0]["supercategory"] = json!(null);
    data["images"][0]["license"] = json!(null);
    data["images"][0]["id"] = json!(1.0);
    let marked = |data: &Json| fs::write(&path, format!("\u{feff}{data}")).expect("written");
    marked(&data);
    let found = open_dataset(folder.path(), None).unwrap_or_else(|error| panic!("{error}")).1;
    assert_eq!(found.all_faults(), []);
    assert_eq!(read(&found).get(VISIBLE_MASK).expect("there").iter().next().expect("an object").1.area(), 16);
    for id in [json!(1.5), json!(-1), json!("1"), json!(null), json!(1e300)] {
        data["images"][0]["id"] = id;
        marked(&data);
        let error = open_dataset(folder.path(), None).err().expect("no id");
        assert!(error.is_permanent() && error.to_string().contains("`images[0]"), "{error}");
    }
}

#[test]
fn holes_of_kins_are_told_by_areas() {
    let ring = |[x, y, w, h]: [u32; 4]| json!([[x, y, x + w, y, x + w, y + h, x, y + h]]);
    let outline = |id: u64, shape: [u32; 4], amodal: u32, visible: u32| {
        annotation(
            id,
            None,
            json!({ "bbox": null, "area": null, "a_segm": ring(shape), "a_area": amodal, "i_segm": ring(shape), "i_area": visible }),
        )
    };
    let first = |annotations: &[Json]| {
        let folder = tempfile::tempdir().expect("a folder");
        let data = json!({
            "images": [{ "id": 1, "file_name": "a.png", "width": 20, "height": 10 }],
            "annotations": annotations,
            "categories": [{ "id": 7, "name": "mug" }],
        });
        let path = folder.path().join("update_train_2020.json");
        fs::write(&path, data.to_string()).expect("written");
        let found = open_dataset(&path, None).unwrap_or_else(|error| panic!("{error}")).1;
        assert_eq!(found.image_faults(0).iter().filter(|it| it.rule == "areas_match_masks").count(), 0);
        let products = read(&found);
        let area =
            |key: Key<PerInstance<Mask>>| products.get(key).expect("there").iter().next().map(|(_, mask)| mask.area());
        (area(VISIBLE_MASK), area(OCCLUSION_MASK))
    };
    let inner = outline(2, [6, 3, 4, 4], 16, 16);
    // 10 × 8 px with another object inside: visible through a hole of 16 px, or in front of it.
    assert_eq!(first(&[outline(1, [2, 1, 10, 8], 64, 64), inner.clone()]), (Some(64), Some(0)));
    assert_eq!(first(&[outline(1, [2, 1, 10, 8], 80, 64), inner.clone()]), (Some(64), Some(16)));
    // The form of 2019 has exact visible masks, but does not state their areas.
    let seen = |hole: [u32; 4]| {
        let is_in = |[x, y, w, h]: [u32; 4], u: u32, v: u32| (x..x + w).contains(&u) && (y..y + h).contains(&v);
        let mask = Mask::from_fn(20, 10, |u, v| is_in([2, 1, 10, 8], u, v) && !is_in(hole, u, v));
        json!({ "size": [10, 20], "counts": mask.to_coco() })
    };
    let old = |area: u32| {
        let more = json!({ "area": area, "bbox": [2, 1, 10, 8], "inmodal_seg": seen([6, 3, 4, 4]), "inmodal_bbox": [2, 1, 10, 8] });
        annotation(1, Some(ring([2, 1, 10, 8])), more)
    };
    assert_eq!(first(&[old(64)]), (Some(64), Some(0)));
    assert_eq!(first(&[old(80)]), (Some(64), Some(16)));
}

#[test]
fn images_of_kins_match_the_split() {
    for (file, expected) in
        [("update_train_2020.json", 10), ("update_test_2020.json", 200), ("instances_val.json", 200)]
    {
        let folder = tempfile::tempdir().expect("a folder");
        for (images, shade) in [("training/image_2", 10), ("testing/image_2", 200)] {
            let path = folder.path().join(images);
            fs::create_dir_all(&path).expect("a folder");
            let image = png::PngImage::rgb(&Plane::from_fn(20, 10, |_, _| [shade; 3])).encode().expect("encoded");
            fs::write(path.join("000003.png"), image).expect("written");
        }
        let annotation = json!({
            "id": 1, "image_id": 1, "category_id": 7, "iscrowd": 0, "area": 16.0, "bbox": [2, 2, 4, 4],
            "segmentation": square(2, 2), "inmodal_seg": square(2, 2), "inmodal_bbox": [2, 2, 4, 4],
        });
        let data = json!({
            "images": [{ "id": 1, "file_name": "000003.png", "width": 20, "height": 10 }],
            "annotations": [annotation],
            "categories": [{ "id": 7, "name": "car" }],
        });
        fs::write(folder.path().join(file), data.to_string()).expect("written");
        let found = open_dataset(folder.path(), Some("kins")).unwrap_or_else(|error| panic!("{error}")).1;
        let products = found.read(0, &[RGB.id()]).unwrap_or_else(|error| panic!("{error}")).products;
        assert_eq!(products.get(RGB).expect("there").at(0, 0)[0], expected, "{file}");
    }
}

/// `segmentation` is the visible mask if the amodal masks differ from it.
#[test]
fn masks_beside_amodal_ones_are_visible() {
    let amodal = |at: u32| json!({ "amodal_mask": rectangle([at, 2, 4, 6]) });
    let of = |annotations: &[Json]| {
        let folder = tempfile::tempdir().expect("a folder");
        let found = open(folder.path(), annotations);
        let products = read(&found);
        let areas = |key: Key<PerInstance<Mask>>| -> Vec<u32> {
            let masks = products.optional(key).expect("of its type");
            masks.into_iter().flat_map(|masks| masks.iter()).map(|(_, mask)| mask.area()).collect()
        };
        let faults: Vec<_> = found.image_faults(0).into_iter().map(|it| it.rule).collect();
        ([VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK].map(areas), faults)
    };
    let box_of = |x: u32, y: u32| json!([x, y, 4, 4]);
    let seen = |id: u64, x: u32| {
        let mut record = annotation(id, Some(rectangle([x, 2, 4, 4])), amodal(x));
        record["bbox"] = box_of(x, 2);
        record
    };
    assert_eq!(of(&[seen(1, 1), seen(2, 8)]), ([vec![16, 16], vec![24, 24], vec![8, 8]], vec![]));
    // If both masks are the same, `segmentation` is amodal.
    let mut whole = annotation(1, Some(rectangle([1, 2, 4, 6])), amodal(1));
    (whole["bbox"], whole["area"]) = (json!([1, 2, 4, 6]), json!(24.0));
    assert_eq!(of(&[whole.clone()]), ([vec![], vec![24], vec![]], vec![]));
    // Another encoding does not make the masks different.
    let outlined = |id: u64| {
        let mut record = annotation(id, Some(json!([[1, 2, 5, 2, 5, 8, 1, 8]])), amodal(1));
        (record["bbox"], record["area"]) = (json!([1, 2, 4, 6]), json!(24.0));
        record
    };
    assert_eq!(of(&[outlined(1)]), ([vec![], vec![24], vec![]], vec![]));
    // A single different mask among many is a fault, and does not change the meaning of the others.
    let many: Vec<Json> = (1..40).map(outlined).chain([seen(40, 8)]).collect();
    let ([visible, amodal, _], faults) = of(&many);
    assert_eq!((visible.len(), amodal.len()), (0, 40));
    assert_eq!(faults, ["segmentation_is_a_mask_of_the_object"]);
}

#[test]
fn a_folder_of_instances_and_segments_is_both() {
    let folder = tempfile::tempdir().expect("a folder");
    open(folder.path(), &[annotation(1, Some(square(2, 2)), json!({}))]);
    let empty = json!({ "images": [], "annotations": [], "categories": [] }).to_string();
    fs::write(folder.path().join("annotations/panoptic_val.json"), empty).expect("written");
    let error = open_dataset(folder.path(), None).err().expect("two formats").to_string();
    assert!(error.contains("like coco and like coco_panoptic"), "{error}");
    let found = open_dataset(folder.path(), Some("coco")).unwrap_or_else(|error| panic!("{error}")).1;
    assert_eq!(read(&found).get(VISIBLE_MASK).expect("there").iter().count(), 1);
}

#[test]
fn supercategories_match_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = open_of(folder.path(), &[], json!([{ "id": 7, "name": "mug", "supercategory": "shape" }]));
    assert_eq!(found.info.supercategory(7), Some("shape"));
}

#[test]
fn objects_without_a_mask_have_no_pixels() {
    for empty in [Some(json!([])), Some(json!(null)), None] {
        let folder = tempfile::tempdir().expect("a folder");
        let found =
            open(folder.path(), &[annotation(1, Some(square(2, 2)), json!({})), annotation(2, empty, json!({}))]);
        let products = read(&found);
        let masks: Vec<u32> = products.get(VISIBLE_MASK).expect("there").iter().map(|(_, mask)| mask.area()).collect();
        assert_eq!(masks, [16, 0]);
        let caveats = found.caveats(&found.offers).join("; ");
        assert!(caveats.contains("have boxes alone: 1"), "{caveats}");
        let faults: Vec<_> = found.image_faults(0).into_iter().filter(|it| it.rule == "objects_have_masks").collect();
        assert!(
            matches!(&faults[..], [fault] if fault.to_string().starts_with("annotation 2: `segmentation`")),
            "{faults:?}"
        );
    }
}

#[test]
fn images_without_any_annotation_have_no_objects() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = open(folder.path(), &[]);
    let products = read(&found);
    for key in [VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK] {
        assert!(products.get(key).expect("offered").0.is_empty());
    }
    let caveats = found.caveats(&found.offers).join("; ");
    assert!(caveats.contains("no annotations of objects"), "{caveats}");
    assert!(found.image_faults(0).is_empty());
}

/// A polygon cannot have holes. The mask of a partly hidden ring has a hole.
#[test]
fn polygons_of_cocoa_fill_holes() {
    let of = |right: u32| {
        let folder = tempfile::tempdir().expect("a folder");
        let inside = |x: u32, y: u32| {
            (2..right).contains(&x) && (1..9).contains(&y) && !((5..11).contains(&x) && (3..7).contains(&y))
        };
        let rle = |of: &dyn Fn(u32) -> bool| json!({ "size": [10, 20], "counts": Mask::from_fn(20, 10, |x, y| inside(x, y) && of(x)).to_coco() });
        let region = json!({
            "segmentation": [2, 1, 14, 1, 14, 9, 2, 9], "name": "ring", "isStuff": 0, "order": 1,
            "visible_mask": rle(&|x| x >= 4), "invisible_mask": rle(&|x| x < 4),
        });
        let file = json!({
            "images": [{ "id": 1, "file_name": "a.png", "width": 20, "height": 10 }],
            "annotations": [{ "id": 1, "image_id": 1, "size": 1, "depth_constraint": "", "regions": [region] }],
        });
        fs::create_dir_all(folder.path().join("annotations")).expect("a folder");
        fs::write(folder.path().join("annotations/COCO_amodal_val2014.json"), file.to_string()).expect("written");
        let found = open_dataset(folder.path(), None).unwrap_or_else(|error| panic!("{error}")).1;
        found.image_faults(0).into_iter().map(|it| it.rule).collect::<Vec<_>>()
    };
    assert_eq!(of(14), Vec::<&str>::new());
    // The missing part at the right end is not a hole.
    assert!(of(9).contains(&"polygon_matches_mask"));
}
