//! KINS.

mod read;

use crate::annotation_file::{self, Listed, SceneFiles, check_split, merge};
use crate::coco::Masks;
use crate::labels::{self, Label};
use crate::order::{self, Order};
use crate::outlines;
use syntable_formats::coco::categories;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_OUTLINE, RGB, VISIBLE_OUTLINE};

/// Writes the layout of KINS, the amodal annotations of KITTI, in its form of 2019 or of 2020.
///
/// # What it does
///
/// Both annotation files have COCO's structure and the categories of the dataset. Polygons are lists of lists `[x1, y1,
/// x2, y2, …]` whose holes are filled; the annotator `outlines` says how close they are. A visible mask has one polygon per
/// part. The parts of an amodal mask are linked at their nearest corners to one polygon, since the readers of deocclusion and
/// InstaOrder take one alone. Areas and boxes `[x, y, width, height]` are those of the masks. Objects of which an image shows nothing have no
/// annotation. Images without objects are listed.
///
/// - `2019`: `segmentation`, `bbox` and `area` are amodal; `inmodal_seg` is the visible mask as compressed run lengths,
///   `inmodal_bbox` its box.
/// - `2020`: `a_segm`, `a_bbox`, `a_area` are amodal, `i_segm`, `i_bbox`, `i_area` visible. `oco_id` is the number,
///   from 1, of the group of objects that overlap, directly or through others; `ico_id` is 1 for objects that nothing
///   in front of them occludes, and one more than the largest of an object's occluders else. Both are 0 for an object
///   that overlaps no other. Where objects occlude each other, directly or in a circle, the one whose nearest visible
///   pixel is nearest is in front. `a_hole_area` and `i_hole_area`, which are ours, are the pixels of the holes that the
///   polygons fill, so that readers can tell such an area from a wrong one.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/instances_{split}.json` (2019) or `{id}/update_{split}_2020.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Kins {
    /// Form of the annotation file.
    pub version: KinsVersion,
    /// Name of the split in the annotation file's name.
    pub split: String,
}

/// Form of KINS' annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum KinsVersion {
    /// The first release.
    #[serde(rename = "2019")]
    V2019,
    /// The update with the order of occlusions.
    #[serde(rename = "2020")]
    V2020,
}

impl Default for Kins {
    fn default() -> Self {
        Self { version: KinsVersion::V2020, split: "train".into() }
    }
}

impl Config for Kins {
    type Stage = dyn Writer;
    const KIND: &'static str = "kins";
    const EXAMPLE: &'static str = "version = \"2020\"\nsplit = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(Box::new(self))
    }
}

impl Kins {
    fn file(&self) -> String {
        match self.version {
            KinsVersion::V2019 => format!("instances_{}.json", self.split),
            KinsVersion::V2020 => format!("update_{}_2020.json", self.split),
        }
    }
}

impl Writer for Kins {
    fn reads(&self) -> Vec<Input> {
        let mut inputs = vec![Input::of(RGB), Input::of(AMODAL_OUTLINE)];
        if self.version == KinsVersion::V2020 {
            inputs.push(Input::of(VISIBLE_OUTLINE));
            inputs.extend(order::inputs());
        }
        inputs.extend(labels::inputs());
        inputs
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(KinsScene { version: self.version, files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(annotation_file::paths(of, &[self.file()]))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), Some(&categories(cx.dataset)), Listed::All)
    }
}

/// An object in the form of 2019.
#[derive(Serialize)]
struct Annotation2019 {
    id: u64,
    image_id: u64,
    category_id: u32,
    iscrowd: u8,
    area: u32,
    segmentation: Vec<Vec<f64>>,
    bbox: [i32; 4],
    inmodal_seg: Rle,
    inmodal_bbox: [i32; 4],
}

/// An object in the form of 2020.
#[derive(Serialize)]
struct Annotation2020 {
    id: u64,
    image_id: u64,
    category_id: u32,
    iscrowd: u8,
    a_segm: Vec<Vec<f64>>,
    a_bbox: [i32; 4],
    a_area: u32,
    i_segm: Vec<Vec<f64>>,
    i_bbox: [i32; 4],
    i_area: u32,
    a_hole_area: u32,
    i_hole_area: u32,
    oco_id: usize,
    ico_id: usize,
}

struct KinsScene {
    version: KinsVersion,
    files: SceneFiles,
}

impl SceneWriter for KinsScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let labels = Masks::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        let polygons: &[Masks] = match self.version {
            KinsVersion::V2019 => &[Masks::Amodal],
            KinsVersion::V2020 => &[Masks::Amodal, Masks::Visible],
        };
        for masks in polygons {
            outlines::report_holes(cx.log, products, *masks, labels.iter().map(|label| label.id))?;
        }
        self.files.image(cx, products, labels.len())?;
        match self.version {
            KinsVersion::V2019 => {
                labels.iter().try_for_each(|label| self.files.annotation(&annotation_2019(products, label)?))
            }
            KinsVersion::V2020 => {
                let places = places(&Order::of(products, &labels)?, &groups(&labels));
                labels
                    .iter()
                    .zip(places)
                    .try_for_each(|(label, place)| self.files.annotation(&annotation_2020(products, label, place)?))
            }
        }
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

fn annotation_2019(products: &Products, label: &Label) -> Result<Annotation2019> {
    Ok(Annotation2019 {
        id: 0,
        image_id: 0,
        category_id: label.category,
        iscrowd: 0,
        area: label.amodal.area(),
        segmentation: vec![outlines::ring(products, Masks::Amodal, label.id)?.into_flattened()],
        bbox: label.amodal_box.into(),
        inmodal_seg: Rle::encode(label.visible),
        inmodal_bbox: label.visible_box.into(),
    })
}

fn annotation_2020(products: &Products, label: &Label, place: Place) -> Result<Annotation2020> {
    Ok(Annotation2020 {
        id: 0,
        image_id: 0,
        category_id: label.category,
        iscrowd: 0,
        a_segm: vec![outlines::ring(products, Masks::Amodal, label.id)?.into_flattened()],
        a_bbox: label.amodal_box.into(),
        a_area: label.amodal.area(),
        i_segm: outlines::polygons(products, Masks::Visible, label.id)?,
        i_bbox: label.visible_box.into(),
        i_area: label.visible.area(),
        a_hole_area: outlines::hole_area(products, Masks::Amodal, label.id, label.amodal)?,
        i_hole_area: outlines::hole_area(products, Masks::Visible, label.id, label.visible)?,
        oco_id: place.group,
        ico_id: place.order,
    })
}

/// Group of overlapping objects, and place in it from the front; both 0 for an object by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    group: usize,
    order: usize,
}

/// The places of objects, given the first object of the group of each.
fn places(order: &Order, groups: &[usize]) -> Vec<Place> {
    let layers = order.layers(&order.front_to_back());
    let is_alone = |first: usize| groups.iter().filter(|&&group| group == first).count() == 1;
    let shared: Vec<usize> =
        groups.iter().enumerate().filter(|&(i, &first)| i == first && !is_alone(first)).map(|(i, _)| i).collect();
    let place = |(first, layer): (&usize, usize)| match shared.binary_search(first) {
        Ok(at) => Place { group: at + 1, order: layer + 1 },
        Err(_) => Place { group: 0, order: 0 },
    };
    groups.iter().zip(layers).map(place).collect()
}

/// The first object of the group of each: objects whose amodal masks overlap, directly or through others.
fn groups(labels: &[Label]) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..labels.len()).collect();
    for j in 0..labels.len() {
        for i in 0..j {
            if groups[i] != groups[j] && !labels[i].amodal.and(labels[j].amodal).is_empty() {
                let (kept, gone) = (groups[i].min(groups[j]), groups[i].max(groups[j]));
                groups.iter_mut().filter(|group| **group == gone).for_each(|group| *group = kept);
            }
        }
    }
    groups
}

register!(Kins);
