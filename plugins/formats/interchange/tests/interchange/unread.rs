//! Datasets of other programs that no format reads are named, with a way out.

use std::fs;
use std::path::Path;
use syntable_interchange as _;
use syntable_model::error::Error;
use syntable_testing::takes::open_dataset;

fn refused(path: &Path) -> Error {
    open_dataset(path, None).err().unwrap_or_else(|| panic!("{}: it is read", path.display()))
}

/// A file as its program writes it, shortened; a part of the error, and of the remedy.
type OfProgram = (&'static str, &'static str, &'static str, &'static str);

const FILES: &[OfProgram] = &[
    (
        "annotations/image_info_test2017.json",
        r#"{"info": {"year": 2017}, "images": [{"license": 2, "file_name": "000000000001.jpg", "coco_url": "",
            "height": 480, "width": 640, "id": 1}], "licenses": [], "categories": [{"id": 1, "name": "person"}]}"#,
        "image_info_test2017.json lists images and has no `annotations`, and so has no labels to read",
        "name a file with annotations",
    ),
    (
        "annotations/captions_val2017.json",
        r#"{"images": [{"id": 1}], "annotations": [{"image_id": 1, "id": 38, "caption": "A bicycle replica"}]}"#,
        "COCO captions",
        "instances_val2017.json",
    ),
    (
        "annotations/labels_val.json",
        r#"{"images": [{"id": 1, "file_name": "a.jpg"}], "annotations": [{"image_id": 1, "id": 3, "category_id": 2}]}"#,
        "they label whole images",
        "instances_val2017.json",
    ),
    (
        "results.json",
        r#"[{"image_id": 42, "category_id": 18, "bbox": [258.15, 41.29, 348.26, 243.78], "score": 0.236}]"#,
        "COCO results (predictions, not a dataset)",
        "syntable eval",
    ),
    (
        "train/Annotations/2007_000027.xml",
        "<annotation><folder>VOC2012</folder><filename>2007_000027.jpg</filename><object><name>person</name>\
         <bndbox><xmax>349</xmax></bndbox></object></annotation>",
        "Pascal VOC",
        "-if voc -f coco",
    ),
    (
        "annotations.xml",
        "<?xml version=\"1.0\"?><annotations><version>1.1</version><meta><task></task></meta>\
         <image id=\"0\" name=\"a.jpg\" width=\"4\" height=\"4\"></image></annotations>",
        "CVAT's own form",
        "as `COCO 1.0`, or convert the dataset to COCO: `datum convert -i FOLDER -if cvat",
    ),
    (
        "a.json",
        r#"{"version": "5.0.1", "flags": {}, "shapes": [{"label": "mug", "points": [[1, 2], [3, 4], [5, 1]], "group_id": null,
            "shape_type": "polygon"}], "imagePath": "a.jpg", "imageData": null, "imageHeight": 9, "imageWidth": 9}"#,
        "LabelMe",
        "labelme2coco.py",
    ),
    (
        "via_project.json",
        r#"{"_via_settings": {}, "_via_img_metadata": {"a.jpg1": {"filename": "a.jpg", "regions": []}}}"#,
        "VIA",
        "COCO format",
    ),
    (
        "via_region_data.json",
        r#"{"a.jpg1": {"filename": "a.jpg", "size": 1, "regions": [{"shape_attributes": {"name": "polygon"}}]}}"#,
        "VIA",
        "COCO format",
    ),
    (
        "project-1.json",
        r#"[{"id": 1, "annotations": [{"result": [{"from_name": "label", "to_name": "image", "type": "polygonlabels",
            "value": {"polygonlabels": ["mug"]}}]}], "data": {"image": "a.jpg"}}]"#,
        "Label Studio",
        "as COCO",
    ),
    (
        "ds/ann/a.jpg.json",
        r#"{"description": "", "tags": [], "size": {"height": 8, "width": 8}, "objects": [{"classTitle": "mug",
            "geometryType": "polygon", "points": {"exterior": []}}]}"#,
        "Supervisely",
        "Export to COCO",
    ),
    (
        "gtFine/val/frankfurt/frankfurt_000000_000294_gtFine_polygons.json",
        r#"{"imgHeight": 1024, "imgWidth": 2048, "objects": [{"label": "road", "polygon": [[0, 769]]}]}"#,
        "Cityscapes",
        "-if cityscapes",
    ),
    (
        "annotations/default.json",
        r#"{"dm_format_version": "1.0", "info": {}, "categories": {}, "items": [{"id": "a", "annotations": []}]}"#,
        "Datumaro",
        "-if datumaro",
    ),
    (
        "sa_1.json",
        r#"{"image": {"image_id": 1, "width": 9, "height": 9, "file_name": "sa_1.jpg"}, "annotations": [{"id": 7,
            "segmentation": {"size": [9, 9], "counts": "9"}, "predicted_iou": 0.9, "stability_score": 0.9}]}"#,
        "SA-1B",
        "one COCO file",
    ),
    (
        "train.json",
        r#"{"videos": [{"id": 1, "file_names": ["a/0.jpg"]}], "annotations": [{"id": 1, "video_id": 1,
            "segmentations": [null], "bboxes": [null]}], "categories": []}"#,
        "YouTube-VIS",
        "for each frame",
    ),
    (
        "validation-annotations-bbox.csv",
        "ImageID,Source,LabelName,Confidence,XMin,XMax,YMin,YMax\n0001,xclick,/m/0,1,0,1,0,1\n",
        "Open Images",
        "-if open_images",
    ),
    ("train.tfrecord", "\u{1}", "TFRecord", "-if tf_detection_api"),
    ("1.0.0/movi_a-train.tfrecord-00000-of-00064", "\u{1}", "TFRecord", "-if tf_detection_api"),
    (
        "annotations/ochuman.json",
        r#"{"images": [{"annotations": [{"max_iou": 0.64, "bbox": [1, 2, 3, 4], "segms": {}}], "file_name": "a.jpg"}]}"#,
        "OCHuman",
        "`segms` become",
    ),
    (
        "export.json",
        r#"[{"ID": "c", "DataRow ID": "d", "Labeled Data": "https://example.org/a.jpg", "Label": {"objects": []}}]"#,
        "Labelbox",
        "COCOConverter",
    ),
    (
        "_annotations.createml.json",
        r#"[{"image": "a.jpg", "annotations": [{"label": "mug", "coordinates": {"x": 2.0, "y": 1.0, "width": 3.0}}]}]"#,
        "CreateML",
        "`YOLOv8`",
    ),
    (
        "000000.json",
        r#"{"camera_data": {}, "objects": [{"class": "cracker", "visibility": 1.0, "location": [-5.4, 10.2, 55.3]}]}"#,
        "DOPE",
        "BOP's layout",
    ),
    (
        "scene_0000/0000.json",
        r#"{"camera": {"extrinsics": [], "intrinsics": []}, "objects": [{"class": "Milk", "pose": [[1, 0, 0, 0]]}]}"#,
        "HOPE",
        "bop.felk.cvut.cz",
    ),
    (
        "train-export.csv",
        "\"image\",\"xmin\",\"ymin\",\"xmax\",\"ymax\",\"label\"\n\"a.jpg\",10,5,20,7,\"mug\"\n",
        "tables of boxes",
        "`bbox`",
    ),
    (
        "annotation_train.odgt",
        r#"{"ID": "a", "gtboxes": [{"fbox": [1, 2, 3, 4], "vbox": [1, 2, 3, 3]}]}"#,
        "CrowdHuman",
        "`fbox`",
    ),
    ("labels/a.txt", "0 0.5 0.5 0.25 0.125\n", "YOLO label files", "`labels/train`"),
    ("benchvise/rot0.rot", "3 3\n", "LINEMOD", "bop.felk.cvut.cz"),
    ("images/000001-meta.mat", "MATLAB 5.0 MAT-file", "YCB-Video", "bop.felk.cvut.cz"),
];

#[test]
fn datasets_of_other_programs_are_named() {
    for (file, text, what, help) in FILES {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, text).expect("written");
        for named in [folder.path(), &*path] {
            let error = refused(named);
            assert!(error.to_string().contains(what), "{file}: {error}");
            assert!(error.help_text().is_some_and(|text| text.contains(help)), "{file}: {:?}", error.help_text());
        }
    }
}

#[test]
fn folders_of_other_datasets_are_named() {
    for (folders, what) in [
        (&["depth_ims", "modal_segmasks", "color_ims"][..], "WISDOM"),
        (&["instances", "instances_txt", "training"], "MOTS"),
        (&["train/images", "train/instances/labels.txt"], "MOTS"),
        (&["train/MOT17-02/gt/gt.txt"], "MOT challenge"),
        (&["scenes/scene_0000/realsense", "scenes/scene_0000/kinect"], "GraspNet"),
        (&["gtFine", "leftImg8bit"], "Cityscapes"),
        (&["training/image_2", "training/label_2"], "KITTI's labels"),
        (&["train/images", "train/labelTxt"], "DOTA"),
        (&["training/v2.0/polygons"], "Mapillary"),
        (&["01/gt.yml", "01/info.yml"], "T-LESS"),
        (&["RGB", "SemSeg"], "semantic segmentation"),
        (&["images", "masks"], "images beside a folder of masks"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        folders.iter().for_each(|name| fs::create_dir_all(folder.path().join(name)).expect("a folder"));
        let error = refused(folder.path()).to_string();
        assert!(error.contains(what), "{what}: {error}");
    }
}

#[test]
fn other_files_are_not_taken_for_datasets() {
    for (file, text) in [
        ("annotations/a.json", r#"{"objects": []}"#),
        ("package.json", r#"{"name": "x", "score": 1, "shapes": 2}"#),
        ("a.xml", "<svg></svg>"),
        ("a.csv", "a,b\n1,2\n"),
        ("a.txt", "1 2 3 4 5\n"),
        // Parts of these names are the ends of LINEMOD's and of YCB-Video's.
        ("a.rot90.png", ""),
        ("a-meta.mat.txt", ""),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, text).expect("written");
        for named in [folder.path(), &*path] {
            let error = refused(named).to_string();
            assert!(error.contains("unrecognized dataset format"), "{file}: {error}");
        }
    }
}
