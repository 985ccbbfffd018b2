//! The files of SynTable's switch `--save-segmentation-data`.
//!
//! `k` is the object's spawn number, with gaps where objects were removed. If the dataset does not state it, `k` is the
//! id less one, which equals the spawn number if no object was removed. The values match the released program: visible
//! and occlusion masks contain 0 and 1, amodal masks 0 and the instance id, and instance maps the ids of objects modulo
//! 256, and 0 everywhere else.

use super::SynTable;
use super::record::{ViewLabels, decoded};
use std::collections::BTreeSet;
use syntable_formats::encode::{pfm, png::PngImage};
use syntable_model::prelude::*;
use syntable_model::product::standard::{BODIES, INSTANCE, OBJECT_INFO};
use syntable_model::product::{Painted, Plane};

/// Paths of the files of the view `name` that cover all objects: depth, its preview, and the ids.
pub fn paths(name: &str) -> [String; 3] {
    [format!("depth/{name}.pfm"), format!("depth/visuals/{name}.png"), format!("instance/{name}.png")]
        .map(|path| format!("data/mono/{path}"))
}

/// Writes the files of the view `name`.
pub fn write(
    config: &SynTable,
    output: &Output,
    cx: &ImageContext,
    products: &Products,
    labels: &ViewLabels,
    name: &str,
) -> Result<()> {
    let path = |rest: String| config.path(&format!("data/mono/{rest}"));
    let [depth_path, preview_path, ids_path] = paths(name).map(|path| config.path(&path));
    let depth = products.get(config.depth.key())?;
    output.write(&depth_path, &pfm::encode(depth))?;
    PngImage::gray8(&inverse_depth(depth)).write(output, &preview_path)?;
    let ids = match (products.optional(INSTANCE)?, products.optional(BODIES)?) {
        (Some(ids), Some(bodies)) => {
            let objects = objects(bodies)?;
            ids.map(|id| if objects.contains(&id.0) { *id } else { InstanceId::default() })
        }
        // A dataset that a reader opened may have labels only.
        _ => {
            let masks = labels.ids().iter().map(|&id| Ok((id, labels.masks(id)?[0])));
            let painted = Painted::new(cx.size, masks.collect::<Result<Vec<_>>>()?);
            painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
            painted.ids
        }
    };
    PngImage::gray8(&ids.map(|id| id.0 as u8)).write(output, &ids_path)?;
    let beyond = labels.ids().iter().filter(|id| id.0 > u8::MAX.into()).count();
    let what =
        "objects have ids above 255, and these files have 8 bits: they show ids modulo 256, and 0 means no object";
    cx.log.left_out(&LeftOut::new(beyond, labels.ids().len(), what));
    let spawns = products.optional(OBJECT_INFO)?;
    for &id in labels.ids() {
        let spawn = spawns.and_then(|infos| infos.get(id)).map_or(Ok(None), spawn)?;
        let k = spawn.unwrap_or_else(|| u32::from(id.0) - 1);
        let [visible, amodal, occlusion] = labels.masks(id)?;
        PngImage::mask(visible, 1).write(output, &path(format!("instance/{name}_{k}.png")))?;
        PngImage::mask(amodal, id.0 as u8).write(output, &path(format!("amodal/{name}_{k}.png")))?;
        PngImage::mask(occlusion, 1).write(output, &path(format!("occlusion/{name}_{k}.png")))?;
    }
    Ok(())
}

/// The ids of the objects among the records of the product `bodies`.
fn objects(bodies: &Value) -> Result<BTreeSet<u16>> {
    #[derive(Deserialize)]
    struct BodyRole {
        id: u16,
        role: String,
    }
    let records: Vec<BodyRole> = decoded(BODIES.name(), bodies)?;
    Ok(records.into_iter().filter(|body| body.role == "object").map(|body| body.id).collect())
}

/// The spawn number in a record of the product `object_info`; none if the dataset does not state it.
fn spawn(info: &Value) -> Result<Option<u32>> {
    #[derive(Deserialize)]
    struct SpawnNumber {
        spawn: Option<u32>,
    }
    Ok(decoded::<SpawnNumber>(OBJECT_INFO.name(), info)?.spawn)
}

/// Inverse depth relative to the nearest pixel, which becomes 255; 0 for pixels without depth.
pub fn inverse_depth(depth: &Plane<f32>) -> Plane<u8> {
    let near = depth.data().iter().copied().filter(|d| d.is_finite() && *d > 0.0).fold(f32::INFINITY, f32::min);
    depth.map(|&d| if d.is_finite() && d > 0.0 { (near / d * 255.0).round() as u8 } else { 0 })
}
