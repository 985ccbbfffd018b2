//! The files of a BOP scene that do not depend on the numbers of the assets.

use super::record::{
    BopImage, CameraProduct, GroundTruthInfo, ObjectInfoProduct, ObjectRecord, SAMPLE_CAMERA, SAMPLE_DEPTH,
    SAMPLE_GT_INFO, SAMPLE_MASK, SAMPLE_MASK_VISIB, SCENE_FILES, SceneCamera, ViewRecord, VisibilityProduct, key, read,
};
use super::shard::Shard;
use super::{Bop, BopLayout, BopMeshes, BopObjects};
use std::borrow::Cow;
use syntable_formats::encode::json_shard::push_line;
use syntable_formats::encode::png::{self, Rounding, depth_image};
use syntable_formats::json::unwritable;
use syntable_formats::read::label_of;
use syntable_formats::segmentation::UncompressedRle;
use syntable_model::prelude::*;
use syntable_model::product::BitPlane;
use syntable_model::product::standard::{
    AMODAL_MASK, CAMERA, COVERAGE, INSTANCE, OBJECT_INFO, OBJECT_MODELS, RGB, VISIBILITY, VISIBLE_MASK,
};
use syntable_model::scene::ViewId;

pub struct BopScene {
    config: Bop,
    folder: String,
    output: Output,
    /// Content of [`SCENE_FILES`].
    entries: [Entries; 2],
    shard: Shard,
}

impl BopScene {
    pub fn new(config: Bop, folder: String, output: Output) -> Result<Self> {
        let shard = Shard::new(&output)?;
        Ok(Self { config, folder, output, entries: Default::default(), shard })
    }

    fn write(&self, view: ViewId, image: BopImage, content: &png::PngImage) -> Result<()> {
        content.write(&self.output, &format!("{}/{}", self.folder, image.path(view)))
    }

    /// Writes the files of a view, and its entries in the files of the scene.
    fn write_files(&mut self, view: ViewId, of: &BopView, objects: &[BopObject]) -> Result<()> {
        let path = BopImage::Rgb.path_as(view, self.config.rgb.extension());
        self.output.write(&format!("{}/{path}", self.folder), &of.rgb)?;
        self.write(view, BopImage::Depth, &of.depth)?;
        for (index, object) in objects.iter().enumerate() {
            self.write(view, BopImage::Mask(index), &png::PngImage::mask(&object.amodal, u8::MAX))?;
            self.write(view, BopImage::MaskVisib(index), &png::PngImage::mask(&object.visible, u8::MAX))?;
        }
        let [cameras, all_infos] = &mut self.entries;
        cameras.push(view.0, &of.camera)?;
        all_infos.push(view.0, &of.infos)
    }

    /// Adds the sample of a view without `gt.json`, which needs `obj_id`.
    fn add_sample(&mut self, key: &str, of: &BopView, objects: &[BopObject]) -> Result<()> {
        let masks = |mask: fn(&BopObject) -> Mask| {
            let mut entries = Entries::default();
            let mut numbered = objects.iter().map(mask).enumerate();
            numbered.try_for_each(|(index, mask)| entries.push(index, &UncompressedRle::encode(&mask)))?;
            Ok(entries.finish())
        };
        self.shard.sample(key, &self.config.rgb.file_name(RGB.name()), &of.rgb)?;
        self.shard.sample(key, SAMPLE_DEPTH, &of.depth.encode()?)?;
        self.shard.sample(key, SAMPLE_CAMERA, &json(&of.camera)?)?;
        self.shard.sample(key, SAMPLE_GT_INFO, &json(&of.infos)?)?;
        self.shard.sample(key, SAMPLE_MASK, &masks(|object| object.amodal.clone().into_owned())?)?;
        self.shard.sample(key, SAMPLE_MASK_VISIB, &masks(|object| object.visible.clone().into_owned())?)
    }
}

/// A value as a line of JSON.
pub fn json(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut line = Vec::new();
    push_line(&mut line, value)?;
    Ok(line)
}

/// How to store what a depth image cannot hold.
const DEEPER: &str = "raise `depth_scale`: 0.2 mm reaches 13.1 m, 1 mm 65.5 m";

/// The content of a view in either layout.
struct BopView {
    /// The file of the color image.
    rgb: Vec<u8>,
    depth: png::PngImage,
    camera: SceneCamera,
    infos: Vec<GroundTruthInfo>,
}

impl SceneWriter for BopScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let Bop { depth_scale: scale, pixel_centers, .. } = self.config;
        let view = cx.view_id;
        let camera: CameraProduct = read(products.get(CAMERA)?, CAMERA.name())?;
        if !camera.distortion.is_none() {
            return Err(Error::new("BOP has no cameras with lens distortion")
                .help("leave distortion out of the camera's options, or write the dataset with another writer"));
        }
        let objects = at_sizes_of_models(self.config.objects.of(products)?, cx.log);
        let depth = products.get(self.config.depth.key())?;
        let files = BopView {
            rgb: self.config.rgb.encode(products.get(RGB)?)?,
            depth: depth_image(depth, scale, Rounding::Nearest, (cx.log, DEEPER)),
            camera: camera.scene_camera(scale, pixel_centers),
            infos: objects.iter().map(|object| object.visibility.info(object.visible.bbox())).collect(),
        };
        match self.config.layout {
            BopLayout::Scenewise => self.write_files(view, &files, &objects)?,
            BopLayout::Webdataset => self.add_sample(&key(cx.scene_id, view), &files, &objects)?,
        }
        let objects = objects.into_iter().map(BopObject::record).collect();
        self.shard.view(&ViewRecord { view: view.0, camera: camera.camera(scale, pixel_centers), objects })
    }

    fn close(mut self: Box<Self>, _: &ImagesContext, products: &Products) -> Result<()> {
        if self.config.layout == BopLayout::Scenewise {
            for (name, entries) in SCENE_FILES.into_iter().zip(self.entries) {
                self.output.write(&format!("{}/{name}", self.folder), &entries.finish())?;
            }
        }
        if self.config.models != BopMeshes::None {
            self.shard.models(products.get(OBJECT_MODELS)?, &self.output)?;
        }
        self.shard.finish()
    }
}

/// The products of an object.
struct BopObject<'a> {
    identity: ObjectInfoProduct,
    visibility: VisibilityProduct,
    /// The object without occluders, within the image.
    amodal: Cow<'a, Mask>,
    visible: Cow<'a, Mask>,
}

impl BopObjects {
    /// The objects of a view, by id.
    fn of<'a>(self, products: &'a Products) -> Result<Vec<BopObject<'a>>> {
        let masks = match self {
            Self::Annotated => annotated(products)?,
            Self::All => all(products)?,
        };
        let (infos, visibilities) = (products.get(OBJECT_INFO)?, products.get(VISIBILITY)?);
        let missing = |product: &str| {
            Error::new(format!("`{product}` does not describe all objects"))
                .help(format!("set `objects = \"all\"` in the options of the annotator `{product}`, too"))
        };
        let object = |(id, [amodal, visible]): (InstanceId, [Cow<'a, Mask>; 2])| {
            let identity = infos.get(id).ok_or_else(|| missing(OBJECT_INFO.name()))?;
            let visibility = visibilities.get(id).ok_or_else(|| missing(VISIBILITY.name()))?;
            let visibility: VisibilityProduct = read(visibility, VISIBILITY.name())?;
            // Table and room may clip the masks of the product; BOP's masks are not clipped.
            let is_cut = u64::from(amodal.area()) != visibility.px_count_in_frame;
            let whole = is_cut && products.contains(COVERAGE.name());
            let amodal = if whole { Cow::Owned(covered(products.get(COVERAGE)?, id)) } else { amodal };
            let object = BopObject { identity: read(identity, OBJECT_INFO.name())?, visibility, amodal, visible };
            object.check(id)?;
            Ok(object)
        };
        masks.into_iter().map(object).collect()
    }
}

/// The objects that are as large as their models. The others are left out, since a pose of BOP has no scale.
fn at_sizes_of_models<'a>(objects: Vec<BopObject<'a>>, log: &dyn Log) -> Vec<BopObject<'a>> {
    let all = objects.len();
    let is_kept = |object: &BopObject| object.identity.scale.is_none_or(|scale| scale == 1.0);
    let kept: Vec<BopObject> = objects.into_iter().filter(is_kept).collect();
    let what = "objects are left out: they differ in size from their models, and a pose of BOP has no scale";
    let help = "make the dataset without the option `scale` of its placers";
    log.left_out(&LeftOut::new(all - kept.len(), all, what).help(help));
    kept
}

type ObjectMaskPairs<'a> = Vec<(InstanceId, [Cow<'a, Mask>; 2])>;

/// Amodal and visible masks of the annotated objects.
fn annotated(products: &Products) -> Result<ObjectMaskPairs<'_>> {
    let masks = products.get(AMODAL_MASK)?.iter().map(|(id, amodal)| {
        let visible = label_of(products, VISIBLE_MASK, id)?;
        Ok((id, [Cow::Borrowed(amodal), Cow::Borrowed(visible)]))
    });
    masks.collect()
}

/// Amodal and visible masks of all objects of the scene; objects outside the image have empty masks.
fn all(products: &Products) -> Result<ObjectMaskPairs<'_>> {
    let (coverage, instance) = (products.get(COVERAGE)?, products.get(INSTANCE)?);
    let masks = (1..=coverage.objects()).map(|object| {
        let id = InstanceId(object as u16);
        let visible = Mask::from_fn(coverage.width(), coverage.height(), |x, y| *instance.at(x, y) == id);
        Ok((id, [Cow::Owned(covered(coverage, id)), Cow::Owned(visible)]))
    });
    masks.collect()
}

/// The pixels that an object covers; none if the plane does not contain the id.
fn covered(coverage: &BitPlane, id: InstanceId) -> Mask {
    let is_known = (1..=coverage.objects()).contains(&usize::from(id.0));
    Mask::from_fn(coverage.width(), coverage.height(), |x, y| is_known && coverage.contains(x, y, id))
}

impl BopObject<'_> {
    fn record(self) -> ObjectRecord {
        ObjectRecord::new(self.identity, self.visibility.visib_fract, &self.visible, &self.amodal)
    }

    /// Checks that the masks have as many pixels as `visibility` counted.
    fn check(&self, id: InstanceId) -> Result<()> {
        let masks = [&self.amodal, &self.visible].map(|mask| u64::from(mask.area()));
        let counted = [self.visibility.px_count_in_frame, self.visibility.px_count_visib];
        if masks == counted {
            return Ok(());
        }
        Err(Error::new(format!(
            "instance {id} has {} pixels in its amodal and {} in its visible mask, where `visibility` counts {} and {}",
            masks[0], masks[1], counted[0], counted[1]
        ))
        .help("BOP's masks have what the table hides: make the dataset with `table_and_room = \"occlude\"` of the annotator `masks`"))
    }
}

/// A JSON object that is written entry by entry, one per line, with numbers as names.
#[derive(Default)]
pub struct Entries(Vec<u8>);

impl Entries {
    pub fn push(&mut self, name: impl std::fmt::Display, value: &impl Serialize) -> Result<()> {
        let separator = if self.0.is_empty() { "{" } else { "," };
        self.0.extend(format!("{separator}\n  \"{name}\": ").into_bytes());
        serde_json::to_writer(&mut self.0, value).map_err(unwritable)
    }

    pub fn finish(mut self) -> Vec<u8> {
        let end: &[u8] = if self.0.is_empty() { b"{}\n" } else { b"\n}\n" };
        self.0.extend(end);
        self.0
    }
}
