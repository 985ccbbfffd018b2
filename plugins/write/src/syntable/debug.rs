//! The files of SynTable's switch `--save-segmentation-data`.
//!
//! `k` is the object's spawn number, with gaps where objects were removed. The values are those of the released program:
//! visible and occlusion masks are 0 and 1, amodal masks 0 and the instance id; the ids of objects modulo 256, and 0 for
//! everything else.

use super::SynTable;
use super::record::Labels;
use syntable_formats::encode::{pfm, png::Image};
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::product::standard::{DEPTH, INSTANCE};

/// Paths of the files of the view `name` that are not of single objects: depth, its preview, and the ids.
pub fn paths(name: &str) -> [String; 3] {
    [format!("depth/{name}.pfm"), format!("depth/visuals/{name}.png"), format!("instance/{name}.png")]
        .map(|path| format!("data/mono/{path}"))
}

/// Writes the files of the view `name`.
pub fn write(
    config: &SynTable,
    output: &Output,
    cx: &ViewContext,
    products: &Products,
    labels: &Labels,
    name: &str,
) -> Result<()> {
    let path = |rest: String| config.path(&format!("data/mono/{rest}"));
    let [depth_path, preview_path, ids_path] = paths(name).map(|path| config.path(&path));
    let depth = products.get(DEPTH)?;
    output.write(&depth_path, &pfm::encode(depth))?;
    Image::gray8(&inverse_depth(depth)).write(output, &preview_path)?;
    let objects = cx.scene.objects().len();
    let ids = products.get(INSTANCE)?.map(|id| if usize::from(id.0) <= objects { id.0 as u8 } else { 0 });
    Image::gray8(&ids).write(output, &ids_path)?;
    for &id in labels.ids() {
        let k = cx.scene.body(id).map_or(0, |body| body.spawn);
        let [visible, amodal, occlusion] = labels.masks(id)?;
        Image::mask(visible, 1).write(output, &path(format!("instance/{name}_{k}.png")))?;
        Image::mask(amodal, id.0 as u8).write(output, &path(format!("amodal/{name}_{k}.png")))?;
        Image::mask(occlusion, 1).write(output, &path(format!("occlusion/{name}_{k}.png")))?;
    }
    Ok(())
}

/// Inverse depth relative to the nearest pixel, which becomes 255; 0 where there is no depth.
pub fn inverse_depth(depth: &Plane<f32>) -> Plane<u8> {
    let near = depth.data().iter().copied().filter(|d| d.is_finite() && *d > 0.0).fold(f32::INFINITY, f32::min);
    depth.map(|&d| if d.is_finite() && d > 0.0 { (near / d * 255.0).round() as u8 } else { 0 })
}
