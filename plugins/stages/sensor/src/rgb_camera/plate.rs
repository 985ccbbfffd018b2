//! Photographs behind rendered objects.

use super::finite;
use super::inverse::Inverse;
use crate::image_filter::filled;
use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use std::path::Path;
use syntable_formats::photographs::{Photographs, photograph};
use syntable_model::prelude::*;
use syntable_model::product::standard::{OPACITY, RADIANCE};
use syntable_model::product::{Lighting, ScenePart};
use syntable_model::scene::RecordedCamera;

/// A photograph behind the rendered objects.
///
/// With `behind = "foreground"`, the photograph shows everything except objects and distractors. Table, room and lights of the
/// scene are stand-ins: they catch shadows, reflect light onto objects, and hide parts of objects, but are not visible. Where an
/// object changes the light on a stand-in, the photograph gets brighter or darker by the same ratio, in each channel: `plate · (lit
/// with objects / lit without them)`, differential rendering after Debevec (SIGGRAPH 1998) with a ratio instead of a difference.
/// The photograph must be taken by a camera like the view's, at the same place before a surface like the stand-in. Glass and mirrors
/// show the stand-ins. With `behind = "bodies"`, the photograph only replaces lights and sky.
///
/// The photograph fills the image: it is scaled to its width or height, and its center is cut out. It passes through exposure, white
/// balance and tone unchanged, except saturated colors under `agx`, whose gamut is smaller. Exposure and white balance are metered on
/// the rendered scene, before the effects of lens and image sensor, which apply to photograph and objects alike. Depth and labels
/// show the scene, not the photograph. A denoiser smooths both renders of the stand-ins separately, so their ratio keeps a little
/// noise near objects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Plate {
    /// Folder of JPEG and PNG files. Without it, the plate is the recorded image that the view rebuilds, which needs a step of the
    /// kind `recorded` in `[[place]]` and in `[views]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photographs: Option<AssetPath>,
    /// The photograph that a view gets.
    pub order: PlateOrder,
    /// The bodies in front of the photograph.
    pub behind: Behind,
}

/// The photograph that a view gets.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlateOrder {
    /// Any of them, at random.
    #[default]
    Random,
    /// View `i` of every scene gets photograph `i` in the order of names, for fixed cameras.
    ByView,
}

/// The bodies in front of a photograph.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Behind {
    /// Objects and distractors. All other bodies are stand-ins for the real table, bin or room.
    #[default]
    Foreground,
    /// All bodies. The photograph replaces lights and sky.
    Bodies,
}

impl Default for Plate {
    fn default() -> Self {
        Self { photographs: None, order: PlateOrder::Random, behind: Behind::Foreground }
    }
}

/// How much of a pixel objects cover.
const MATTE: Key<Plane<f32>> = OPACITY.of_part(ScenePart::Foreground);
/// Light of the stand-ins behind the objects, with the objects in the scene and without them.
const SHADOWED: Key<Plane<[f32; 3]>> = RADIANCE.of_part(ScenePart::Furniture(Lighting::InScene));
const EMPTY: Key<Plane<[f32; 3]>> = RADIANCE.of_part(ScenePart::Furniture(Lighting::Alone));
const SKY: Key<Plane<[f32; 3]>> = RADIANCE.of_part(ScenePart::Background);

/// Largest factor by which objects brighten a stand-in: beyond it, the rendered surface is too dark to tell.
const BRIGHTEST: f32 = 4.0;
/// Light that is too dark to compare, as a fraction of white.
const DARK: f32 = 1e-4;

impl Plate {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.photographs.is_none() && self.order == PlateOrder::ByView {
            return Err(ConfigError::new("plate.order", "`plate.order` is `by_view`, but `plate.photographs` is not set")
                .help("set `plate.photographs` to a folder of photographs, or leave `order` out: recorded images belong to views"));
        }
        Ok(())
    }

    /// The cameras of a recorded scene, if their images are the plates.
    pub(super) fn needs(&self) -> Option<Part> {
        self.photographs.is_none().then_some(Part::RecordedCameras)
    }

    /// Checks that the folder has photographs, and one for each view if they belong to views.
    pub(super) fn found(&self, views: u32) -> Result<()> {
        let Some(folder) = &self.photographs else { return Ok(()) };
        let photographs = Photographs::of(folder.path())?;
        match (self.order, photographs.files().len()) {
            (PlateOrder::ByView, count) if count < views as usize => Err(too_few(count as u32, count, folder.path())),
            _ => Ok(()),
        }
    }

    pub(super) fn reads(&self) -> Vec<KeyId> {
        match self.behind {
            Behind::Foreground => keys![RADIANCE, MATTE, SHADOWED, EMPTY],
            Behind::Bodies => keys![RADIANCE, OPACITY, SKY],
        }
    }

    /// Radiance of the scene with the photograph, and the record of the photograph. `inverse` turns its codes into radiance.
    ///
    /// The light behind objects goes out as it came in, and the photograph comes in: `light + open · (plate · ratio − behind)`. At an
    /// edge, a denoiser may give objects more or less of the pixel than `open` leaves. The difference has the light of `behind`, which
    /// is about as bright as the photograph, so edges get no outline.
    pub(super) fn composed(
        &self,
        (cx, stream): (&ViewContext, &Stream),
        (inverse, white): (&Inverse, f64),
        products: &Products,
    ) -> Result<(Plane<[f32; 3]>, Value)> {
        let (plate, name) = self.photograph(cx, stream)?;
        let rendered = products.get(RADIANCE)?;
        let size = [rendered.width(), rendered.height()];
        let plate = filling(plate, size);
        let compose = |x: u32, y: u32, opacity: f32, behind: &[f32; 3], ratio: &dyn Fn(usize) -> f32| {
            let (light, shown, open) = (rendered.at(x, y), inverse.nits(*plate.at(x, y)), 1.0 - opacity);
            let channel = |c: usize| match open {
                ..=0.0 => light[c],
                1.0.. => shown[c] * ratio(c),
                _ => light[c] + open * (shown[c] * ratio(c) - behind[c]),
            };
            std::array::from_fn(|c| finite(channel(c)))
        };
        let light = match self.behind {
            Behind::Foreground => {
                let (matte, shadowed, empty) = (products.get(MATTE)?, products.get(SHADOWED)?, products.get(EMPTY)?);
                let dark = DARK * white as f32;
                filled(cx.workers, size, |y, row: &mut [[f32; 3]]| {
                    for (x, pixel) in (0..).zip(row) {
                        let (lit, before) = (shadowed.at(x, y), empty.at(x, y));
                        *pixel = compose(x, y, *matte.at(x, y), lit, &|c| {
                            let ratio = (lit[c] + dark) / (before[c] + dark);
                            if ratio.is_finite() { ratio.clamp(0.0, BRIGHTEST) } else { 1.0 }
                        });
                    }
                })
            }
            Behind::Bodies => {
                let (opacity, sky) = (products.get(OPACITY)?, products.get(SKY)?);
                filled(cx.workers, size, |y, row: &mut [[f32; 3]]| {
                    for (x, pixel) in (0..).zip(row) {
                        *pixel = compose(x, y, *opacity.at(x, y), sky.at(x, y), &|_| 1.0);
                    }
                })
            }
        };
        Ok((light, Value::record([("photograph", name.into())])))
    }

    /// The photograph of a view, and its name.
    fn photograph(&self, cx: &ViewContext, stream: &Stream) -> Result<(Plane<[u8; 3]>, String)> {
        let Some(folder) = &self.photographs else { return recorded(cx) };
        let photographs = Photographs::of(folder.path())?;
        let files = photographs.files();
        let file = match self.order {
            PlateOrder::Random => stream.clone().pick(files),
            PlateOrder::ByView => files.get(cx.view.id.0 as usize),
        };
        let Some(file) = file else {
            return Err(too_few(cx.view.id.0, files.len(), folder.path()));
        };
        Ok((photograph(file)?, name_of(file)))
    }
}

/// The error for a view beyond the photographs of a folder.
fn too_few(view: u32, count: usize, folder: &Path) -> Error {
    let help = "add photographs, lower `views_per_scene` in [dataset], or set `plate.order = \"random\"`";
    Error::new(format!("view {view} has no photograph: the folder has {count}")).in_file(folder).help(help)
}

/// The recorded image of a view, and its name.
fn recorded(cx: &ViewContext) -> Result<(Plane<[u8; 3]>, String)> {
    let cameras = cx.scene.recorded_cameras().map_err(|error| {
        error.help(
            "set `plate.photographs` to a folder, or rebuild a dataset by a step of the kind `recorded` in [[place]]",
        )
    })?;
    let is_own = |it: &&RecordedCamera| it.camera.world_from_camera == cx.view.camera.world_from_camera;
    // Several images can have one pose: the number of the view tells them apart.
    let by_number = cameras.get(cx.view.id.0 as usize).filter(is_own);
    let Some(camera) = by_number.or_else(|| cameras.iter().find(is_own)) else {
        return Err(Error::new("the camera of the view took no recorded image, so it has no plate")
            .help("set `kind = \"recorded\"` in [views], or `plate.photographs` to a folder"));
    };
    let (own, taken) = (&cx.view.camera, &camera.camera);
    if (own.intrinsics, own.distortion) != (taken.intrinsics, taken.distortion) {
        let message = format!(
            "the camera of the view is not the camera that took `{}`: its intrinsics or distortion differ",
            camera.image
        );
        return Err(Error::new(message).help("set `kind = \"recorded\"` in [camera]"));
    }
    let Some(photograph) = &camera.photograph else {
        return Err(Error::new(format!("the recorded dataset has no color image of `{}`", camera.image))
            .help("set `plate.photographs` to a folder"));
    };
    let (photograph, size) = (photograph.read()?, [taken.intrinsics.width, taken.intrinsics.height]);
    if [photograph.width(), photograph.height()] != size {
        let found = format!("{} × {}", photograph.width(), photograph.height());
        let message = format!("`{}` has {found} pixels, its camera {} × {}", camera.image, size[0], size[1]);
        return Err(
            Error::new(message).help("correct the intrinsics of the dataset, or set `plate.photographs` to a folder")
        );
    }
    Ok((photograph, camera.image.clone()))
}

fn name_of(file: &Path) -> String {
    file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The photograph at another size: scaled until it fills it, and cut to its center. Unchanged if it has this size.
fn filling(photograph: Plane<[u8; 3]>, [width, height]: [u32; 2]) -> Plane<[u8; 3]> {
    let (own_width, own_height) = (photograph.width(), photograph.height());
    if [own_width, own_height] == [width, height] {
        return photograph;
    }
    // The largest part with the proportions of the image.
    let (wide, high) = (u64::from(own_width) * u64::from(height), u64::from(own_height) * u64::from(width));
    let part = match wide > high {
        true => [((high / u64::from(height)) as u32).max(1), own_height],
        false => [own_width, ((wide / u64::from(width)) as u32).max(1)],
    };
    let corner = [(own_width - part[0]) / 2, (own_height - part[1]) / 2];
    let pixels = photograph.data().as_flattened().to_vec();
    let Some(whole) = RgbImage::from_raw(own_width, own_height, pixels) else { return photograph };
    let cut = crop_imm(&whole, corner[0], corner[1], part[0], part[1]).to_image();
    let scaled = resize(&cut, width, height, FilterType::CatmullRom);
    Plane::from_vec(width, height, scaled.into_raw().as_chunks().0.to_vec())
}
