//! The files of SynTable's switch `--save-segmentation-data`.
//!
//! `k` is the object's spawn number, with gaps where objects were removed; of a dataset that is converted, it is the id less
//! one, which is the spawn number if none was removed. The values are those of the released program:
//! visible and occlusion masks are 0 and 1, amodal masks 0 and the instance id; the ids of objects modulo 256, and 0 for
//! everything else.

use super::SynTable;
use super::record::Labels;
use syntable_formats::encode::{pfm, png::Image};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, INSTANCE};
use syntable_model::product::{Painted, Plane};

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
    // A dataset that was read has no scene: then the labels are all that is known.
    let scene = cx.scene().ok();
    let ids = match scene {
        Some(scene) => {
            let objects = scene.objects().len();
            products.get(INSTANCE)?.map(|id| if usize::from(id.0) <= objects { *id } else { InstanceId::default() })
        }
        None => {
            let masks = labels.ids().iter().map(|&id| Ok((id, labels.masks(id)?[0])));
            let painted = Painted::new(cx.size, masks.collect::<Result<Vec<_>>>()?);
            painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
            painted.ids
        }
    };
    Image::gray8(&ids.map(|id| id.0 as u8)).write(output, &ids_path)?;
    let beyond = labels.ids().iter().filter(|id| id.0 > u8::MAX.into()).count();
    let what =
        "objects have ids above 255, and these files have 8 bits: they show ids modulo 256, of which 0 is nothing";
    cx.log.left_out(&LeftOut::new(beyond, labels.ids().len(), what));
    for &id in labels.ids() {
        let spawn = scene.and_then(|scene| scene.body(id)).map(|body| body.spawn);
        let k = spawn.unwrap_or_else(|| u32::from(id.0) - 1);
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
