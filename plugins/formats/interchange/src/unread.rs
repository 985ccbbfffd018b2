//! Recognizes datasets that no format reads, by the words in their annotation files or by their folders.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use syntable_formats::read::is_json;
use syntable_formats::structure::AnnotationStart;
use syntable_model::prelude::*;

syntable_model::register_unread!(recognize);

/// A kind of dataset.
struct Kind {
    what: &'static str,
    /// How to get a dataset that is read.
    help: &'static str,
    clue: Clue,
}

/// A sign of a kind.
enum Clue {
    /// Words at the start of a file with one of these extensions. All words of any list must be there.
    Words(&'static [&'static str], &'static [&'static [&'static str]]),
    /// Folders at the top.
    Folders(&'static [&'static str]),
}

use Clue::{Folders, Words};

/// The kinds. The first match counts.
const KINDS: &[Kind] = &[
    Kind {
        what: "results of COCO's form, which are predictions and not a dataset",
        help: "score them with `syntable eval --gt DATASET --pred` and this file",
        clue: Words(&["json"], &[&["[", "\"image_id\"", "\"score\"", "\"category_id\""]]),
    },
    Kind {
        what: "annotations of YouTube-VIS' form, which follow objects through videos",
        help: "write one COCO annotation for each frame: `segmentations` has a mask for each of a video's `file_names`",
        clue: Words(&["json"], &[&["\"videos\"", "\"file_names\""], &["\"videos\"", "\"segmentations\""]]),
    },
    Kind {
        what: "COCO captions, which label no objects",
        help: "name a file of instances, such as `annotations/instances_val2017.json`",
        clue: Words(&["json"], &[&["\"annotations\"", "\"caption\""]]),
    },
    Kind {
        what: "annotations of SA-1B's form, one file per image",
        help: "join the files to one COCO file: their `image` records become `images`, with `image_id` as `id`; their \
               `annotations` get this `image_id`, and a `category_id`",
        clue: Words(
            &["json"],
            &[&["\"annotations\"", "\"predicted_iou\""], &["\"annotations\"", "\"stability_score\""]],
        ),
    },
    Kind {
        what: "LabelMe annotations",
        help: "convert them to COCO with LabelMe's script `examples/instance_segmentation/labelme2coco.py`",
        clue: Words(&["json"], &[&["\"shapes\"", "\"shape_type\""], &["\"shapes\"", "\"imagePath\""]]),
    },
    Kind {
        what: "a project or annotations of the VGG Image Annotator (VIA)",
        help: "open them in VIA, and choose `Annotation`, `Export Annotations (COCO format)`",
        clue: Words(&["json"], &[&["\"_via_img_metadata\""], &["\"shape_attributes\""]]),
    },
    Kind {
        what: "tasks of Label Studio",
        help: "export them from Label Studio as COCO or YOLO",
        clue: Words(&["json"], &[&["\"from_name\"", "\"to_name\""], &["\"polygonlabels\""], &["\"rectanglelabels\""]]),
    },
    Kind {
        what: "annotations of Supervisely",
        help: "export them with Supervisely's app `Export to COCO`",
        clue: Words(&["json"], &[&["\"classTitle\"", "\"objects\""], &["\"classId\"", "\"geometryType\""]]),
    },
    Kind {
        what: "Cityscapes' polygons",
        help: "convert the dataset to COCO: `datum convert -i FOLDER -if cityscapes -f coco -o OUT -- --save-media` \
               (`pip install datumaro`)",
        clue: Words(&["json"], &[&["\"imgHeight\"", "\"imgWidth\"", "\"polygon\""]]),
    },
    Kind {
        what: "annotations of Datumaro",
        help: "convert them to COCO: `datum convert -i FOLDER -if datumaro -f coco -o OUT -- --save-media`",
        clue: Words(&["json"], &[&["\"dm_format_version\""], &["\"items\"", "\"label_id\""]]),
    },
    Kind {
        what: "Pascal VOC annotations",
        help: "convert the dataset to COCO: `datum convert -i FOLDER -if voc -f coco -o OUT -- --save-media` (`pip install datumaro`)",
        clue: Words(&["xml"], &[&["<annotation", "<object", "<bndbox"], &["<annotation", "<filename", "<size"]]),
    },
    Kind {
        what: "annotations of CVAT's own form",
        help: "export them from CVAT as `COCO 1.0`, or convert them: `datum convert -i FOLDER -if cvat -f coco -o OUT -- --save-media`",
        clue: Words(
            &["xml"],
            &[&["<annotations", "<image "], &["<annotations", "<track "], &["<annotations", "<task"]],
        ),
    },
    Kind {
        what: "tables of Open Images",
        help: "convert the dataset to COCO: `datum convert -i FOLDER -if open_images -f coco -o OUT -- --save-media` \
               (`pip install datumaro`)",
        clue: Words(&["csv"], &[&["ImageID,", "LabelName"]]),
    },
    Kind {
        what: "files of TensorFlow (TFRecord)",
        help: "convert the dataset to COCO: `datum convert -i FOLDER -if tf_detection_api -f coco -o OUT -- --save-media` \
               (`pip install datumaro`)",
        clue: Words(&["tfrecord", "record"], &[&[]]),
    },
    Kind {
        what: "masks of MOTS, which follow objects through videos",
        help: "convert the dataset to COCO: `datum convert -i FOLDER -if mots_png -f coco -o OUT -- --save-media` \
               (`pip install datumaro`)",
        clue: Folders(&["instances", "instances_txt"]),
    },
    Kind {
        what: "WISDOM, or a dataset of SD Mask R-CNN",
        help: "write the masks of `modal_segmasks` as a COCO file: each gray value above 0 is an object",
        clue: Folders(&["depth_ims", "modal_segmasks"]),
    },
    Kind {
        what: "GraspNet-1Billion",
        help: "write the scenes in BOP's layout: `annotations/*.xml` has the poses, and `label/*.png` the objects' numbers",
        clue: Folders(&["realsense", "kinect"]),
    },
];

/// Bytes at the start of a file that are searched for words.
const START: u64 = 1 << 16;
/// Depth of folders in which files are searched.
const DEPTH: usize = 3;
/// Most entries of a folder, and most files of all folders, that are looked at.
const ENTRIES: usize = 256;
const FILES: usize = 64;

fn recognize(path: &Path) -> Option<Error> {
    let files = if path.is_file() { vec![path.to_owned()] } else { files(path) };
    let starts: Vec<(String, String)> = files.iter().filter_map(|file| start(file)).collect();
    let kind = KINDS.iter().find(|kind| match &kind.clue {
        Words(ends, lists) => {
            let has = |text: &str, words: &&[&str]| words.iter().all(|word| text.contains(word));
            starts.iter().any(|(end, text)| {
                let is_list = text.trim_start().starts_with('[');
                let fits = |words: &&&[&str]| has(text, words) && (words.first() != Some(&"[") || is_list);
                ends.contains(&end.as_str()) && lists.iter().any(|words| fits(&words))
            })
        }
        Folders(names) => names.iter().all(|name| path.join(name).is_dir()),
    });
    if let Some(Kind { what, help, .. }) = kind {
        return Some(Error::new(format!("it looks like {what}, which no format reads")).help(*help));
    }
    let has_images_alone = |file: &PathBuf| is_json(file) && AnnotationStart::of(file) == AnnotationStart::Images;
    let file = files.iter().find(|file| has_images_alone(file))?;
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let what = format!("{name} lists images and has no `annotations`, and so has no labels to read");
    Some(Error::new(what).help(
        "name a file with annotations, such as `instances_val2017.json`; the labels of COCO's test images are not published",
    ))
}

/// Extension of a file, and the text at its start.
fn start(file: &Path) -> Option<(String, String)> {
    let end = file.extension()?.to_str()?.to_ascii_lowercase();
    let mut bytes = Vec::new();
    File::open(file).ok()?.take(START).read_to_end(&mut bytes).ok()?;
    Some((end, String::from_utf8_lossy(&bytes).into_owned()))
}

/// The first files below a folder with an extension of some kind, outer ones first.
fn files(folder: &Path) -> Vec<PathBuf> {
    let is_of_kind = |path: &Path| {
        let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_ascii_lowercase();
        KINDS.iter().any(|kind| matches!(&kind.clue, Words(ends, _) if ends.contains(&end.as_str())))
    };
    let (mut found, mut folders) = (Vec::new(), VecDeque::from([(folder.to_owned(), 0)]));
    while let Some((folder, depth)) = folders.pop_front() {
        let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let mut entries: Vec<PathBuf> = entries.take(ENTRIES).map(|entry| entry.path()).collect();
        entries.sort();
        for path in entries {
            if path.is_file() && is_of_kind(&path) {
                found.push(path);
            } else if depth < DEPTH && path.is_dir() && !path.is_symlink() && folders.len() < FILES {
                folders.push_back((path, depth + 1));
            }
            if found.len() >= FILES {
                return found;
            }
        }
    }
    found
}
