//! Recognizes datasets that no format reads, by the words in their annotation files or by their folders.

use std::collections::VecDeque;
use std::io::Read;
use std::path::{Path, PathBuf};
use syntable_formats::read::is_json;
use syntable_formats::structure::AnnotationStart;
use syntable_model::mirror::DatasetFile;
use syntable_model::prelude::*;

syntable_model::register_unread!(recognize);

/// A kind of dataset.
struct Kind {
    /// Its name in the list of the book, `book/src/interchange.md`.
    #[cfg_attr(not(test), expect(dead_code, reason = "only the test of the book's list reads it"))]
    name: &'static str,
    /// The content of the user's files, for messages.
    what: &'static str,
    help: Help,
    /// Signs of the kind. One is enough.
    clues: &'static [Clue],
}

/// A remedy: how to get a dataset that is read.
enum Help {
    /// Datumaro reads the dataset under this name, and writes COCO.
    Datumaro(&'static str),
    /// A way in words, or else Datumaro.
    OrDatumaro(&'static str, &'static str),
    /// In words.
    Words(&'static str),
}

impl Help {
    fn text(&self) -> String {
        let datum = |name: &str| {
            format!(
                "convert the dataset to COCO: `datum convert -i FOLDER -if {name} -f coco -o OUT -- --save-media` (`pip \
                 install datumaro`)"
            )
        };
        match self {
            Self::Datumaro(name) => datum(name),
            Self::OrDatumaro(words, name) => format!("{words}, or {}", datum(name)),
            Self::Words(text) => (*text).to_owned(),
        }
    }
}

/// A sign of a kind.
enum Clue {
    /// Words at the start of a file with one of these extensions. All words of any list must be there.
    Words(&'static [&'static str], &'static [&'static [&'static str]]),
    /// Files or folders below one folder. All paths of any list must exist.
    Paths(&'static [&'static [&'static str]]),
    /// The end of the name of a file.
    NameEnd(&'static str),
    /// A part of the name of a file, before the number of its shard.
    NamePart(&'static str),
    /// A text file with lines of YOLO.
    YoloLines,
}

use Clue::{NameEnd, NamePart, Paths, Words, YoloLines};
use Help::Datumaro;

/// Help for datasets whose images of classes have no objects.
const NO_OBJECTS: Help = Help::Words("nothing in it tells one object from another: use a dataset with instance labels");
/// Help for datasets that BOP publishes, too.
const OF_BOP: Help =
    Help::Words("download the dataset in BOP's form from https://bop.felk.cvut.cz/datasets, which is read");

/// The kinds. The first match counts.
const KINDS: &[Kind] = &[
    Kind {
        name: "COCO results",
        what: "COCO results (predictions, not a dataset)",
        help: Help::Words("score them with `syntable eval --gt DATASET --pred` and this file"),
        clues: &[Words(&["json"], &[&["[", "\"image_id\"", "\"score\"", "\"category_id\""]])],
    },
    Kind {
        name: "YouTube-VIS",
        what: "YouTube-VIS annotations of objects in videos",
        help: Help::Words(
            "write one COCO annotation for each frame: `segmentations` has a mask for each of a video's `file_names`",
        ),
        clues: &[Words(&["json"], &[&["\"videos\"", "\"file_names\""], &["\"videos\"", "\"segmentations\""]])],
    },
    Kind {
        name: "COCO captions",
        what: "COCO captions (without objects)",
        help: Help::Words("name a file of instances, such as `annotations/instances_val2017.json`"),
        clues: &[Words(&["json"], &[&["\"annotations\"", "\"caption\""]])],
    },
    Kind {
        name: "SA-1B",
        what: "annotations of SA-1B's form",
        help: Help::Words(
            "join the files to one COCO file: their `image` records become `images`, with `image_id` as `id`; their \
             `annotations` get this `image_id`, and a `category_id`",
        ),
        clues: &[Words(
            &["json"],
            &[&["\"annotations\"", "\"predicted_iou\""], &["\"annotations\"", "\"stability_score\""]],
        )],
    },
    Kind {
        name: "OCHuman",
        what: "annotations of OCHuman's form",
        help: Help::Words(
            "write one COCO file: each entry of an image's `annotations` becomes an annotation with this `image_id`, and \
             its `bbox` and `segms` become `bbox` and `segmentation`",
        ),
        clues: &[Words(&["json"], &[&["\"images\"", "\"max_iou\""]])],
    },
    Kind {
        name: "LabelMe",
        what: "LabelMe annotations",
        help: Help::Words(
            "convert them to COCO with LabelMe's script `examples/instance_segmentation/labelme2coco.py`",
        ),
        clues: &[Words(&["json"], &[&["\"shapes\"", "\"shape_type\""], &["\"shapes\"", "\"imagePath\""]])],
    },
    Kind {
        name: "VIA",
        what: "a project or annotations of the VGG Image Annotator (VIA)",
        help: Help::Words("open them in VIA, and choose `Annotation`, `Export Annotations (COCO format)`"),
        clues: &[Words(&["json"], &[&["\"_via_img_metadata\""], &["\"shape_attributes\""]])],
    },
    Kind {
        name: "Label Studio",
        what: "tasks of Label Studio",
        help: Help::Words("export them from Label Studio as COCO or YOLO"),
        clues: &[Words(
            &["json"],
            &[&["\"from_name\"", "\"to_name\""], &["\"polygonlabels\""], &["\"rectanglelabels\""]],
        )],
    },
    Kind {
        name: "Labelbox",
        what: "annotations of Labelbox",
        help: Help::Words("convert them to COCO with `labelbox.data.serialization.COCOConverter`"),
        clues: &[Words(
            &["json", "ndjson"],
            &[&["\"Labeled Data\"", "\"DataRow ID\""], &["\"data_row\"", "\"media_attributes\""]],
        )],
    },
    Kind {
        name: "Supervisely",
        what: "annotations of Supervisely",
        help: Help::Words("export them with Supervisely's app `Export to COCO`"),
        clues: &[Words(&["json"], &[&["\"classTitle\"", "\"objects\""], &["\"classId\"", "\"geometryType\""]])],
    },
    Kind {
        name: "VoTT",
        what: "annotations of VoTT",
        help: Datumaro("vott_json"),
        clues: &[Words(&["json"], &[&["\"videoSettings\"", "\"tags\""], &["\"asset\"", "\"regions\""]])],
    },
    Kind {
        name: "CreateML",
        what: "annotations of CreateML's form",
        help: Help::Words("export them from Roboflow as `COCO` or `YOLOv8`"),
        clues: &[Words(&["json"], &[&["[", "\"image\"", "\"annotations\"", "\"coordinates\""]])],
    },
    Kind {
        name: "BDD100K",
        what: "annotations of BDD100K's form",
        help: Help::Words("convert them to COCO with BDD100K's `python3 -m bdd100k.label.to_coco`"),
        clues: &[Words(&["json"], &[&["\"labels\"", "\"box2d\""], &["\"labels\"", "\"poly2d\""]])],
    },
    Kind {
        name: "CrowdHuman",
        what: "annotations of CrowdHuman's form",
        help: Help::Words(
            "write one COCO file: each line is an image; of `gtboxes`, `vbox` becomes `bbox`, and `fbox` the amodal box \
             `amodal_bbox`",
        ),
        clues: &[Words(&["odgt"], &[&["\"gtboxes\""]])],
    },
    Kind {
        name: "ADE20K",
        what: "annotations of ADE20K",
        help: Datumaro("ade20k2020"),
        clues: &[Words(&["json"], &[&["\"annotation\"", "\"imsize\""]])],
    },
    Kind {
        name: "ADE20K",
        what: "annotations of ADE20K in the form of 2017",
        help: Datumaro("ade20k2017"),
        clues: &[NameEnd("_atr.txt")],
    },
    Kind {
        name: "Cityscapes",
        what: "Cityscapes",
        help: Datumaro("cityscapes"),
        clues: &[
            Words(&["json"], &[&["\"imgHeight\"", "\"imgWidth\"", "\"polygon\""]]),
            Paths(&[&["gtFine", "leftImg8bit"]]),
        ],
    },
    Kind {
        name: "Mapillary Vistas",
        what: "Mapillary Vistas",
        help: Datumaro("mapillary_vistas_instances"),
        clues: &[Paths(&[&["config_v1.2.json"], &["config_v2.0.json"], &["v2.0/polygons"], &["v1.2/instances"]])],
    },
    Kind {
        name: "TensorFlow Datasets",
        what: "a dataset of TensorFlow Datasets",
        help: Help::Words(
            "read it with `tfds.load`, and write its frames as one COCO file; MOVi's `segmentations` has each pixel's \
             instance from 1 on",
        ),
        clues: &[Words(
            &["json"],
            &[&["\"fileFormat\"", "\"tfrecord"], &["\"pythonClassName\"", "tensorflow_datasets"]],
        )],
    },
    Kind {
        name: "Kubric",
        what: "scenes of Kubric, such as MOVi's",
        help: Help::Words(
            "write each frame as an image of one COCO file: pixels of `segmentation_*.png` have the number of the instance, \
             which counts `instances` of `metadata.json` from 1 on",
        ),
        clues: &[
            Words(&["json"], &[&["\"instances\"", "\"camera\"", "\"num_instances\""]]),
            Paths(&[&["data_ranges.json"]]),
        ],
    },
    Kind {
        name: "HOPE",
        what: "HOPE's annotations of poses",
        help: OF_BOP,
        clues: &[Words(&["json"], &[&["\"intrinsics\"", "\"objects\"", "\"class\"", "\"pose\""]])],
    },
    Kind {
        name: "DOPE",
        what: "annotations of NVIDIA's form for DOPE (NDDS, NViSII)",
        help: Help::Words(
            "write the scenes in BOP's layout: `location` is the position in cm, and `quaternion_xyzw` the rotation, both in \
             the camera's frame",
        ),
        clues: &[Words(&["json"], &[&["\"camera_data\"", "\"objects\""]])],
    },
    Kind {
        name: "YCB-Video",
        what: "YCB-Video in its authors' form",
        help: OF_BOP,
        clues: &[NameEnd("-meta.mat"), Paths(&[&["data_syn", "keyframe.txt"], &["image_sets", "data_syn"]])],
    },
    Kind {
        name: "SIXD",
        what: "a dataset in the SIXD challenge's form, such as the authors' T-LESS",
        help: OF_BOP,
        clues: &[Paths(&[&["gt.yml", "info.yml"]])],
    },
    Kind {
        name: "LINEMOD",
        what: "LINEMOD in its authors' form",
        help: OF_BOP,
        clues: &[NameEnd(".rot"), Paths(&[&["RGB-D", "poses"]])],
    },
    Kind {
        name: "Datumaro",
        what: "annotations of Datumaro",
        help: Datumaro("datumaro"),
        clues: &[Words(&["json"], &[&["\"dm_format_version\""], &["\"items\"", "\"label_id\""]])],
    },
    Kind {
        name: "LabelMe's web tool",
        what: "annotations of LabelMe's web tool",
        help: Datumaro("label_me"),
        clues: &[Words(&["xml"], &[&["<annotation", "<object", "<polygon"]])],
    },
    Kind {
        name: "Pascal VOC",
        what: "Pascal VOC annotations",
        help: Datumaro("voc"),
        clues: &[
            Words(&["xml"], &[&["<annotation", "<object", "<bndbox"], &["<annotation", "<filename", "<size"]]),
            Paths(&[&["JPEGImages", "SegmentationObject"]]),
        ],
    },
    Kind {
        name: "CVAT's own XML",
        what: "annotations of CVAT's own form",
        help: Help::OrDatumaro("export them from CVAT as `COCO 1.0`", "cvat"),
        clues: &[Words(
            &["xml"],
            &[&["<annotations", "<image "], &["<annotations", "<track "], &["<annotations", "<task"]],
        )],
    },
    Kind {
        name: "KITTI",
        what: "KITTI's recordings with tracklets",
        help: Datumaro("kitti_raw"),
        clues: &[Words(&["xml"], &[&["<boost_serialization", "<tracklets"]])],
    },
    Kind {
        name: "Open Images",
        what: "tables of Open Images",
        help: Datumaro("open_images"),
        clues: &[Words(&["csv"], &[&["ImageID,", "LabelName"], &["ImageID,", "Rotation"]])],
    },
    Kind {
        name: "tables of boxes",
        what: "tables of boxes, a line per object",
        help: Help::Words(
            "export COCO or YOLO from the program that made them, or write each line as an annotation of a COCO file, with \
             `bbox` as [x, y, width, height]",
        ),
        clues: &[Words(&["csv"], &[&["xmin", "ymin", "xmax", "ymax"], &["x_min", "y_min", "x_max", "y_max"]])],
    },
    Kind {
        name: "Roboflow's exports for classification",
        what: "a Roboflow export for classification or semantic segmentation",
        help: Help::Words("export it from Roboflow as `COCO Segmentation` or `YOLOv8`"),
        clues: &[Paths(&[&["_classes.csv"]])],
    },
    Kind {
        name: "TFRecord",
        what: "files of TensorFlow (TFRecord)",
        help: Datumaro("tf_detection_api"),
        clues: &[Words(&["tfrecord", "record"], &[&[]]), NamePart(".tfrecord-")],
    },
    Kind {
        name: "KITTI-MOTS",
        what: "MOTS or KITTI-MOTS masks of objects in videos",
        help: Datumaro("mots_png"),
        clues: &[Paths(&[&["instances", "instances_txt"], &["images", "instances/labels.txt"]])],
    },
    Kind {
        name: "MOT",
        what: "MOT challenge boxes of objects in videos",
        help: Datumaro("mot_seq"),
        clues: &[Paths(&[&["gt/gt.txt"]])],
    },
    Kind {
        name: "KITTI",
        what: "KITTI's labels of objects",
        help: Datumaro("kitti_detection"),
        clues: &[Paths(&[&["label_2"], &["label_02"]])],
    },
    Kind {
        name: "KITTI",
        what: "KITTI instance segmentation",
        help: Datumaro("kitti_segmentation"),
        clues: &[Paths(&[&["image_2", "instance"]])],
    },
    Kind {
        name: "DOTA",
        what: "DOTA's rotated boxes, or Roboflow's `YOLOv5 Oriented Bounding Boxes`",
        help: Help::Words(
            "convert them to YOLO with `convert_dota_to_yolo_obb` of `ultralytics.data.converter`, or export `YOLOv8 Oriented \
             Bounding Boxes`, which is read",
        ),
        clues: &[Paths(&[&["labelTxt"]])],
    },
    Kind {
        name: "nuScenes",
        what: "nuScenes, or a dataset of its form",
        help: Help::Words(
            "convert it to COCO with nuScenes' `nuscenes.scripts.export_2d_annotations_as_json`, or mmdetection3d",
        ),
        clues: &[Paths(&[&["calibrated_sensor.json"]])],
    },
    Kind {
        name: "WIDER FACE",
        what: "WIDER FACE",
        help: Datumaro("wider_face"),
        clues: &[Paths(&[&["wider_face_split"]])],
    },
    Kind {
        name: "WISDOM",
        what: "WISDOM, or a dataset of SD Mask R-CNN",
        help: Help::Words("write the masks of `modal_segmasks` as a COCO file: each gray value above 0 is an object"),
        clues: &[Paths(&[&["depth_ims", "modal_segmasks"]])],
    },
    Kind {
        name: "GraspNet",
        what: "GraspNet-1Billion",
        help: Help::Words(
            "write the scenes in BOP's layout: `annotations/*.xml` has the poses, and `label/*.png` the objects' numbers",
        ),
        clues: &[Paths(&[&["realsense", "kinect"]])],
    },
    Kind {
        name: "MVTec AD",
        what: "images of defects in MVTec AD's form",
        help: NO_OBJECTS,
        clues: &[Paths(&[&["ground_truth", "test"]])],
    },
    Kind {
        name: "semantic segmentation",
        what: "semantic segmentation (classes without objects)",
        help: NO_OBJECTS,
        clues: &[Paths(&[&["train", "trainannot"], &["RGB", "SemSeg"], &["RGBLeft", "GTLeft"]])],
    },
    Kind {
        name: "folders of masks",
        what: "images beside a folder of masks",
        help: Help::Words(
            "if the masks tell one object from another, write them as one COCO file; masks of classes alone label no objects",
        ),
        clues: &[Paths(&[&["images", "masks"]])],
    },
    Kind {
        name: "YOLO label files in a layout other than Ultralytics'",
        what: "YOLO label files in a layout other than Ultralytics'",
        help: Help::Words(
            "put the images into `images/train`, and their text files into `labels/train` beside `images`; `data.yaml` names \
             the classes",
        ),
        clues: &[YoloLines],
    },
];

/// Bytes at the start of a file that are searched for words.
const START: u64 = 1 << 16;
/// Depth of folders in which files are searched.
const DEPTH: usize = 3;
/// Most entries of a folder, and most files of all folders, that are looked at.
const ENTRIES: usize = 256;
const FILES: usize = 64;
/// Most text files of a folder that are looked at.
const TEXTS: usize = 4;

fn recognize(path: &Path) -> Option<Error> {
    let seen = Seen::below(path);
    if let Some(Kind { what, help, .. }) = KINDS.iter().find(|kind| kind.clues.iter().any(|clue| seen.shows(clue))) {
        return Some(Error::new(format!("this looks like {what}, which syntable cannot read")).help(help.text()));
    }
    let of_images = |file: &&PathBuf| match AnnotationStart::of(file) {
        AnnotationStart::Records(keys) => is_json(file) && keys.have_any(&["category_id"]),
        _ => false,
    };
    if let Some(file) = seen.files.iter().find(of_images) {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let what = format!("annotations of {name} have neither `bbox` nor `segmentation`: they label whole images");
        return Some(Error::new(what).help("name a file of instances, such as `annotations/instances_val2017.json`"));
    }
    let has_images_alone = |file: &&PathBuf| is_json(file) && AnnotationStart::of(file) == AnnotationStart::Images;
    let file = seen.files.iter().find(has_images_alone)?;
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let what = format!("{name} lists images and has no `annotations`, and so has no labels to read");
    Some(Error::new(what).help(
        "name a file with annotations, such as `instances_val2017.json`; the labels of COCO's test images are not published",
    ))
}

/// The files and folders below a path, within bounds.
#[derive(Default)]
struct Seen {
    /// Folders, outer ones first.
    folders: Vec<PathBuf>,
    /// Files in which words are searched, outer ones first.
    files: Vec<PathBuf>,
    /// Extension and start of each of these files.
    starts: Vec<(String, String)>,
    /// Names of files.
    names: Vec<String>,
    /// The first text files of each folder.
    texts: Vec<PathBuf>,
}

impl Seen {
    fn below(path: &Path) -> Self {
        let mut seen = Self::default();
        if path.is_file() {
            seen.add(path.to_owned());
            seen.texts.extend(path.extension().filter(|end| *end == "txt").map(|_| path.to_owned()));
        } else {
            seen.walk(path);
        }
        seen.starts = seen.files.iter().filter_map(|file| start(file)).collect();
        seen
    }

    fn walk(&mut self, folder: &Path) {
        let mut folders = VecDeque::from([(folder.to_owned(), 0)]);
        while let Some((folder, depth)) = folders.pop_front() {
            let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
            let mut entries: Vec<PathBuf> = entries.take(ENTRIES).map(|entry| entry.path()).collect();
            entries.sort();
            let is_text = |path: &&PathBuf| path.extension().is_some_and(|end| end == "txt") && path.is_file();
            self.texts.extend(entries.iter().filter(is_text).take(TEXTS).cloned());
            for path in entries {
                if path.is_file() {
                    self.add(path);
                } else if depth < DEPTH && path.is_dir() && !path.is_symlink() && folders.len() < FILES {
                    folders.push_back((path, depth + 1));
                }
            }
            self.folders.push(folder);
        }
    }

    fn add(&mut self, file: PathBuf) {
        self.names.extend(file.file_name().map(|name| name.to_string_lossy().into_owned()));
        let end = file.extension().and_then(|end| end.to_str()).unwrap_or_default().to_ascii_lowercase();
        let has_words = |clue: &Clue| matches!(clue, Words(ends, _) if ends.contains(&end.as_str()));
        if self.files.len() < FILES && KINDS.iter().flat_map(|kind| kind.clues).any(has_words) {
            self.files.push(file);
        }
    }

    fn shows(&self, clue: &Clue) -> bool {
        match clue {
            Words(ends, lists) => self.starts.iter().any(|(end, text)| {
                let is_list = text.trim_start().starts_with('[');
                let has = |words: &&&[&str]| words.iter().all(|word| text.contains(word));
                let fits = |words: &&&[&str]| has(words) && (words.first() != Some(&"[") || is_list);
                ends.contains(&end.as_str()) && lists.iter().any(|words| fits(&words))
            }),
            Paths(lists) => self
                .folders
                .iter()
                .any(|folder| lists.iter().any(|paths| paths.iter().all(|path| folder.join(path).exists()))),
            NameEnd(end) => self.names.iter().any(|name| name.ends_with(end)),
            NamePart(part) => self.names.iter().any(|name| name.contains(part)),
            YoloLines => self.texts.iter().filter_map(|file| start(file)).any(|(_, text)| is_yolo(&text)),
        }
    }
}

/// Whether the first line of a text has a class, and then a box or a polygon in fractions of the image. A box of a prediction has a
/// confidence, too.
fn is_yolo(text: &str) -> bool {
    let mut numbers = text.lines().next().unwrap_or_default().split_whitespace();
    let has_class = numbers.next().is_some_and(|class| class.parse::<u32>().is_ok());
    let fractions: Vec<Option<f64>> = numbers.map(|number| number.parse().ok()).collect();
    let are_fractions = fractions.iter().all(|of| of.is_some_and(|of| (0.0..=1.0).contains(&of)));
    has_class
        && are_fractions
        && (matches!(fractions.len(), 4 | 5) || (fractions.len() > 5 && fractions.len().is_multiple_of(2)))
}

/// Extension of a file, and the text at its start.
fn start(file: &Path) -> Option<(String, String)> {
    let end = file.extension()?.to_str()?.to_ascii_lowercase();
    let mut bytes = Vec::new();
    DatasetFile::open(file).ok()?.take(START).read_to_end(&mut bytes).ok()?;
    Some((end, String::from_utf8_lossy(&bytes).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_book_lists_all_kinds() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../book/src/interchange.md");
        let page = std::fs::read_to_string(page).expect("the page");
        let section =
            page.split("\n### ").find(|section| section.starts_with("Which files are read")).expect("the section");
        let list: Vec<&str> = section.split_whitespace().skip_while(|word| *word != "-").collect();
        let list = list.join(" ");
        for kind in KINDS {
            assert!(list.contains(kind.name), "book/src/interchange.md does not list {}", kind.name);
        }
    }
}
