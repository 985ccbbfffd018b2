//! Checks that the labels of every view are consistent.
//!
//! Each check compares products that may come from different sources: masks with masks, numbers with the masks that
//! they were counted on, poses with depth. All checks are exact, except for the rounding of files; tolerances are
//! stated where they apply.

use serde_json::Value as Json;
use syntable_model::check::{Check, LabelFault};
use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CAMERA, DEPTH, LABEL_POLICY, OBJECT_INFO, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE,
    RGB, VISIBILITY, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::product::{BBox, DistortionRecord, OcclusionOrder, Product, meeting_boxes};
use syntable_model::{register_check, rule};

/// Maximum difference between a depth and the depth from a pose, m: files store whole millimeters.
const DEPTH_TOLERANCE_M: f64 = 0.002;
/// Maximum difference between outlines in the image, px: a mask is sampled at pixel centers.
const OUTLINE_TOLERANCE_PX: f64 = 1.0;
/// Maximum difference by rounding between two matrices or rates of the same object.
const ROUNDING: f64 = 1e-6;
/// Maximum difference of a matrix in single precision from a rotation.
const RIGID: f64 = 1e-3;
/// Maximum error of a rate with two decimals.
const TWO_DECIMALS: f64 = 0.005 + 1e-9;

register_check!(
    Check {
        name: rule::VISIBLE_MASKS_DISJOINT,
        doc: "No pixel is in the visible masks of two objects.",
        reads: || keys![VISIBLE_MASK],
        finds_subject: Check::ALWAYS,
        faults: disjoint,
    },
    Check {
        name: "visible_within_amodal",
        doc: "The visible mask of an object lies within its amodal mask.",
        reads: || keys![VISIBLE_MASK, AMODAL_MASK],
        finds_subject: Check::ALWAYS,
        faults: |products| each_pair(products, VISIBLE_MASK, AMODAL_MASK, |_, visible, amodal| {
            let outside = visible.minus(amodal).area();
            (outside > 0).then(|| format!("{outside} of its visible pixels are not in its amodal mask"))
        }),
    },
    Check {
        name: rule::OCCLUSION_IS_AMODAL_MINUS_VISIBLE,
        doc: "The occlusion mask of an object is its amodal mask without its visible mask.",
        reads: || keys![VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let visible = products.get(VISIBLE_MASK)?;
            each_pair(products, AMODAL_MASK, OCCLUSION_MASK, |id, amodal, occlusion| {
                let hidden = amodal.minus(visible.get(id)?);
                (hidden != *occlusion).then(|| {
                    let differ = hidden.minus(occlusion).area() + occlusion.minus(&hidden).area();
                    format!("its occlusion mask differs from amodal minus visible at {differ} pixels")
                })
            })
        },
    },
    Check {
        name: rule::RATE_IS_RATIO_OF_AREAS,
        doc: "The occlusion rate is the area of the occlusion mask divided by the area of the amodal mask.",
        reads: || keys![AMODAL_MASK, OCCLUSION_MASK, OCCLUSION_RATE],
        finds_subject: Check::ALWAYS,
        faults: rates,
    },
    Check {
        name: rule::ORDER_MATCHES_MASKS,
        doc: "An object occludes another object in the order if its visible mask overlaps the other's occlusion mask.",
        reads: || keys![VISIBLE_MASK, OCCLUSION_MASK, OCCLUSION_ORDER],
        finds_subject: Check::ALWAYS,
        faults: order,
    },
    Check {
        name: "visible_box_matches_mask",
        doc: "The visible box is the smallest one around the visible mask.",
        reads: || keys![VISIBLE_MASK, VISIBLE_BOX],
        finds_subject: Check::ALWAYS,
        faults: |products| each_pair(products, VISIBLE_MASK, VISIBLE_BOX, box_of),
    },
    Check {
        name: "amodal_box_matches_mask",
        doc: "The amodal box is the smallest one around the amodal mask.",
        reads: || keys![AMODAL_MASK, AMODAL_BOX],
        finds_subject: Check::ALWAYS,
        faults: |products| each_pair(products, AMODAL_MASK, AMODAL_BOX, box_of),
    },
    Check {
        name: "masks_have_image_size",
        doc: "Masks and image have one size.",
        reads: || keys![RGB, AMODAL_MASK, VISIBLE_MASK],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let size = [products.get(RGB)?.width(), products.get(RGB)?.height()];
            each_pair(products, AMODAL_MASK, VISIBLE_MASK, |_, amodal, visible| {
                let wrong = [amodal, visible].into_iter().find(|mask| [mask.width(), mask.height()] != size)?;
                Some(format!(
                    "a mask of it has {} × {} pixels, the image {} × {}",
                    wrong.width(),
                    wrong.height(),
                    size[0],
                    size[1]
                ))
            })
        },
    },
    Check {
        name: "depth_has_image_size",
        doc: "Depth and image have one size.",
        reads: || keys![RGB, DEPTH],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let (rgb, depth) = (products.get(RGB)?, products.get(DEPTH)?);
            let sizes = [[rgb.width(), rgb.height()], [depth.width(), depth.height()]];
            Ok((sizes[0] != sizes[1])
                .then(|| LabelFault::new(format!("depth has {:?} pixels, the image {:?}", sizes[1], sizes[0])))
                .into_iter()
                .collect())
        },
    },
    Check {
        name: rule::CAMERA_HAS_IMAGE_SIZE,
        doc: "The intrinsics fit the size of the image.",
        reads: || keys![RGB, CAMERA],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let (rgb, camera) = (products.get(RGB)?, json(products, CAMERA)?);
            let size = [camera["width"].as_u64(), camera["height"].as_u64()];
            Ok((size != [Some(rgb.width().into()), Some(rgb.height().into())])
                .then(|| {
                    let message =
                        format!("the camera has {size:?} pixels, the image {} × {}", rgb.width(), rgb.height());
                    LabelFault::new(message)
                })
                .into_iter()
                .collect())
        },
    },
    Check {
        name: "visible_pixels_have_depth",
        doc: "Visible pixels of objects have a depth.",
        reads: || keys![VISIBLE_MASK, DEPTH],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let depth = products.get(DEPTH)?;
            each(products, VISIBLE_MASK, |_, mask| {
                let missing = depths(mask, depth).filter(|depth| !(depth.is_finite() && *depth > 0.0)).count();
                (missing > 0).then(|| format!("{missing} of its visible pixels have no depth"))
            })
        },
    },
    Check {
        name: "poses_agree",
        doc: "The pose in the world is the camera's pose times the pose in the camera frame, and the camera's two poses are \
              inverse.",
        reads: || keys![CAMERA, OBJECT_INFO],
        finds_subject: |products| json(products, CAMERA).is_ok_and(|camera| camera.get("world_from_camera").is_some()),
        faults: |products| {
            let camera = json(products, CAMERA)?;
            let Some(world_from_camera) = matrix(&camera["world_from_camera"]) else {
                return Ok(vec![LabelFault::new("the pose of the camera is no 4 × 4 matrix of numbers")]);
            };
            if let Some(fault) =
                camera.get("camera_from_world").and_then(|back| is_no_inverse(back, &world_from_camera))
            {
                return Ok(vec![LabelFault::new(fault)]);
            }
            each(products, OBJECT_INFO, |_, info| {
                let info = serde_json::to_value(info).ok()?;
                let [world, camera] = ["world_from_object", "camera_from_object"].map(|key| matrix(&info[key]));
                let (Some(world), Some(camera)) = (world, camera) else {
                    return Some("a pose of it is no 4 × 4 matrix of numbers".to_owned());
                };
                let expected = product(&world_from_camera, &camera);
                let differ = difference(&world, &expected);
                (differ > ROUNDING).then(|| format!("its poses in world and camera differ by {differ:.2e}"))
            })
        },
    },
    Check {
        name: "poses_are_rigid",
        doc: "The pose of an object in the camera frame is a rotation, without a reflection, and a translation.",
        reads: || keys![OBJECT_INFO],
        finds_subject: Check::ALWAYS,
        faults: |products| each(products, OBJECT_INFO, |_, info| {
            let info = serde_json::to_value(info).ok()?;
            let Some(pose) = matrix(&info["camera_from_object"]) else {
                return Some("its pose is no 4 × 4 matrix of numbers".to_owned());
            };
            let dot = |a: usize, b: usize| (0..3).map(|i| pose[i][a] * pose[i][b]).sum::<f64>();
            let off =
                (0..9).map(|k| (dot(k / 3, k % 3) - f64::from(u8::from(k / 3 == k % 3))).abs()).fold(0.0, f64::max);
            let ends = pose[3] == [0.0, 0.0, 0.0, 1.0];
            if off > RIGID || off.is_nan() || !ends {
                return Some("its pose is not a rotation and a translation".to_owned());
            }
            let minor = |a: usize, b: usize| pose[1][a] * pose[2][b] - pose[1][b] * pose[2][a];
            let determinant = pose[0][0] * minor(1, 2) - pose[0][1] * minor(0, 2) + pose[0][2] * minor(0, 1);
            (determinant < 0.0).then(|| "its pose is mirrored: the determinant of its rotation is -1".to_owned())
        }),
    },
    Check {
        name: rule::CAMERA_IS_VALID,
        doc: "Focal lengths are positive, and the principal point is a number.",
        reads: || keys![CAMERA],
        finds_subject: Check::ALWAYS,
        faults: |products| {
            let camera = json(products, CAMERA)?;
            let k = |row: usize, column: usize| camera["K"][row][column].as_f64().unwrap_or(f64::NAN);
            let sound = k(0, 0) > 0.0 && k(1, 1) > 0.0 && k(0, 2).is_finite() && k(1, 2).is_finite();
            Ok((!sound).then(|| LabelFault::new(format!("K is {}", camera["K"]))).into_iter().collect())
        },
    },
    Check {
        name: "poses_reproject_into_masks",
        doc: "The amodal mask of an object lies within the image of its box in space.",
        reads: || keys![CAMERA, OBJECT_INFO, AMODAL_MASK],
        finds_subject: |products| has_box(products) && !is_distorted(products),
        faults: reprojected,
    },
    Check {
        name: "depth_agrees_with_poses",
        doc: "Where an object is visible, the depth is within its box in space.",
        reads: || keys![OBJECT_INFO, VISIBLE_MASK, DEPTH],
        finds_subject: has_box,
        faults: |products| {
            let depth = products.get(DEPTH)?;
            each_pair(products, VISIBLE_MASK, OBJECT_INFO, |_, mask, info| {
                let z = corners(info)?.map(|corner| corner.z);
                let near = z.iter().copied().fold(f64::INFINITY, f64::min) - DEPTH_TOLERANCE_M;
                let far = z.iter().copied().fold(f64::NEG_INFINITY, f64::max) + DEPTH_TOLERANCE_M;
                let beyond = depths(mask, depth).filter(|&depth| !(near..=far).contains(&f64::from(depth))).count();
                (beyond > 0).then(|| {
                    format!("{beyond} of its visible pixels have a depth outside of {near:.3} to {far:.3} m, where its pose puts it")
                })
            })
        },
    },
    Check {
        name: rule::COUNTS_MATCH_MASKS,
        doc: "Pixel counts equal the areas of the masks, and the parts are not larger than the whole.",
        reads: || keys![VISIBILITY, VISIBLE_MASK],
        finds_subject: Check::ALWAYS,
        faults: |products| each_pair(products, VISIBLE_MASK, VISIBILITY, |_, mask, counts| {
            let counts = serde_json::to_value(counts).ok()?;
            let [all, valid, visib] =
                ["px_count_all", "px_count_valid", "px_count_visib"].map(|key| counts[key].as_u64().unwrap_or(0));
            if visib != u64::from(mask.area()) {
                return Some(format!("`px_count_visib` is {visib}, its visible mask has {} pixels", mask.area()));
            }
            if visib > all || valid > all {
                return Some(format!("of {all} pixels in all, {valid} are valid and {visib} visible"));
            }
            let share = if all == 0 { 0.0 } else { visib as f64 / all as f64 };
            let said = counts["visib_fract"].as_f64().unwrap_or(share);
            ((said - share).abs() > ROUNDING).then(|| format!("`visib_fract` is {said}, {visib} of {all} are {share}"))
        }),
    },
);

/// One sentence for each faulty instance of a product.
fn each<T: 'static>(
    products: &Products,
    key: Key<PerInstance<T>>,
    fault: impl Fn(InstanceId, &T) -> Option<String>,
) -> Result<Vec<LabelFault>>
where
    PerInstance<T>: Product,
{
    let of = |(id, value): (InstanceId, &T)| Some(LabelFault::of(id, fault(id, value)?));
    Ok(products.get(key)?.iter().filter_map(of).collect())
}

/// Like [`each`], for two products of the same instances. An instance that is only in `one` is faulty, too; `other` may
/// have more instances, since objects can be described without being annotated.
fn each_pair<T: 'static, U: 'static>(
    products: &Products,
    one: Key<PerInstance<T>>,
    other: Key<PerInstance<U>>,
    fault: impl Fn(InstanceId, &T, &U) -> Option<String>,
) -> Result<Vec<LabelFault>>
where
    PerInstance<T>: Product,
    PerInstance<U>: Product,
{
    let values = products.get(other)?;
    each(products, one, |id, value| match values.get(id) {
        Some(other) => fault(id, value, other),
        None => Some(format!("it is in `{}` and not in `{}`", one.name(), other.name())),
    })
}

fn disjoint(products: &Products) -> Result<Vec<LabelFault>> {
    let masks = products.get(VISIBLE_MASK)?;
    let Some(size) = masks.iter().next().map(|(_, first)| [first.width(), first.height()]) else {
        return Ok(Vec::new());
    };
    // Pixels of the previous masks, in the order of runs.
    let mut taken = vec![0_u64; (size[0] as usize * size[1] as usize).div_ceil(64)];
    let mut faults = Vec::new();
    for (id, mask) in masks.iter() {
        if size != [mask.width(), mask.height()] {
            return Ok(vec![LabelFault::of(id, "its mask is not of the size of the others")]);
        }
        let shared: u32 = mask.runs().map(|run| take(&mut taken, run)).sum();
        if shared > 0 {
            faults.push(LabelFault::of(id, format!("{shared} of its visible pixels belong to other objects, too")));
        }
    }
    Ok(faults)
}

/// Sets a range of bits, and returns how many of them were already set.
fn take(bits: &mut [u64], range: std::ops::Range<u32>) -> u32 {
    let (mut start, mut before) = (range.start, 0);
    while start < range.end {
        let (word, first) = ((start / 64) as usize, start % 64);
        let count = (64 - first).min(range.end - start);
        let own = (u64::MAX >> (64 - count)) << first;
        before += (bits[word] & own).count_ones();
        bits[word] |= own;
        start += count;
    }
    before
}

fn rates(products: &Products) -> Result<Vec<LabelFault>> {
    let (occlusion, rates) = (products.get(OCCLUSION_MASK)?, products.get(OCCLUSION_RATE)?);
    // With this policy, parts outside the image count as hidden, but no mask contains them.
    let extends = products.contains(&LABEL_POLICY.id()) && json(products, LABEL_POLICY)?["image_frame"] == "extend";
    each(products, AMODAL_MASK, |id, amodal| {
        let (occlusion, &rate) = (occlusion.get(id)?, rates.get(id)?);
        let ratio = if amodal.is_empty() { 0.0 } else { f64::from(occlusion.area()) / f64::from(amodal.area()) };
        let has_two_decimals = (rate * 100.0 - (rate * 100.0).round()).abs() < ROUNDING;
        let tolerance = if has_two_decimals { TWO_DECIMALS } else { ROUNDING };
        let wrong = if extends { rate < ratio - tolerance } else { (rate - ratio).abs() > tolerance };
        (wrong || !(0.0..=1.0).contains(&rate))
            .then(|| format!("its rate is {rate}, {} of {} pixels are {ratio:.6}", occlusion.area(), amodal.area()))
    })
}

fn order(products: &Products) -> Result<Vec<LabelFault>> {
    let (visible, occlusion) = (products.get(VISIBLE_MASK)?, products.get(OCCLUSION_MASK)?);
    let order = products.get(OCCLUSION_ORDER)?;
    let ids = order.ids();
    if let Some(id) = ids.iter().find(|id| visible.get(**id).is_none() || occlusion.get(**id).is_none()) {
        return Ok(vec![LabelFault::of(*id, "it is in the order and has no mask")]);
    }
    let of = |masks: &PerInstance<Mask>| ids.iter().filter_map(|id| masks.get(*id).cloned()).collect::<Vec<Mask>>();
    let (visible, occlusion) = (of(visible), of(occlusion));
    let boxes = |masks: &[Mask]| masks.iter().map(Mask::bbox).collect::<Vec<_>>();
    let mut expected = OcclusionOrder::new(ids.to_vec());
    meeting_boxes(&boxes(&visible), &boxes(&occlusion), |row, column| {
        if row != column && visible[row].shared_area(&occlusion[column]) > 0 {
            expected.set(row, column);
        }
    });
    let mut faults = Vec::new();
    for row in 0..ids.len() {
        let [said, own] = [order, &expected].map(|order| &order.matrix()[row * ids.len()..][..ids.len()]);
        // Most rows are equal, and comparing whole rows is fast.
        if said == own {
            continue;
        }
        let one = ids[row];
        for column in (0..ids.len()).filter(|&column| said[column] != own[column]) {
            let other = ids[column];
            let says = if own[column] { "does not say that" } else { "says that" };
            faults.push(LabelFault::new(match column == row {
                true => format!("the order says that instance {one} occludes itself"),
                false => format!("the order {says} instance {one} occludes instance {other}"),
            }));
        }
    }
    Ok(faults)
}

fn box_of(_: InstanceId, mask: &Mask, said: &BBox) -> Option<String> {
    let [expected, said] = [mask.bbox(), *said].map(<[i32; 4]>::from);
    (expected != said).then(|| format!("its box is {said:?}, but its mask has {expected:?}"))
}

fn reprojected(products: &Products) -> Result<Vec<LabelFault>> {
    let camera = json(products, CAMERA)?;
    let k = |row: usize, column: usize| camera["K"][row][column].as_f64();
    let (Some(fx), Some(fy), Some(cx), Some(cy)) = (k(0, 0), k(1, 1), k(0, 2), k(1, 2)) else {
        return Ok(vec![LabelFault::new("the camera has no matrix K of numbers")]);
    };
    each_pair(products, AMODAL_MASK, OBJECT_INFO, |_, mask, info| {
        let corners = corners(info)?;
        // If the camera is inside the box, the image of the box has no bounds.
        if mask.is_empty() || corners.iter().any(|corner| corner.z <= 0.0) {
            return None;
        }
        let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for corner in corners {
            let pixel = [fx * corner.x / corner.z + cx, fy * corner.y / corner.z + cy];
            low = std::array::from_fn(|axis| low[axis].min(pixel[axis]));
            high = std::array::from_fn(|axis| high[axis].max(pixel[axis]));
        }
        let [x, y, width, height] = <[i32; 4]>::from(mask.bbox()).map(f64::from);
        let inside = x >= low[0] - OUTLINE_TOLERANCE_PX
            && y >= low[1] - OUTLINE_TOLERANCE_PX
            && x + width <= high[0] + OUTLINE_TOLERANCE_PX
            && y + height <= high[1] + OUTLINE_TOLERANCE_PX;
        (!inside).then(|| {
            format!(
                "its amodal mask reaches from ({x}, {y}) to ({}, {}), its box in space from ({:.1}, {:.1}) to ({:.1}, {:.1})",
                x + width, y + height, low[0], low[1], high[0], high[1]
            )
        })
    })
}

/// The corners of an object's box in the camera frame, m, if its size is known.
fn corners(info: &Value) -> Option<[Point3<f64>; 8]> {
    let info = serde_json::to_value(info).ok()?;
    let pose = matrix(&info["camera_from_object"])?;
    let bound = |end: usize, axis: usize| info["bounds_m"][end][axis].as_f64();
    let bounds = [[bound(0, 0)?, bound(0, 1)?, bound(0, 2)?], [bound(1, 0)?, bound(1, 1)?, bound(1, 2)?]];
    Some(std::array::from_fn(|corner| {
        let p: [f64; 3] = std::array::from_fn(|axis| bounds[corner >> axis & 1][axis]);
        let row = |row: usize| (0..3).map(|axis| pose[row][axis] * p[axis]).sum::<f64>() + pose[row][3];
        Point3::new(row(0), row(1), row(2))
    }))
}

/// The depths of the pixels of a mask; none if the two have different sizes.
fn depths<'a>(mask: &'a Mask, depth: &'a Plane<f32>) -> impl Iterator<Item = f32> + 'a {
    let same = (mask.width(), mask.height()) == (depth.width(), depth.height());
    mask.pixels().take(if same { usize::MAX } else { 0 }).map(|pixel| depth.data()[pixel])
}

fn matrix(value: &Json) -> Option<[[f64; 4]; 4]> {
    let mut matrix = [[0.0; 4]; 4];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = value.get(i)?.get(j)?.as_f64()?;
        }
    }
    Some(matrix)
}

/// Largest difference of two entries.
fn difference(a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]) -> f64 {
    (0..16).map(|i| (a[i / 4][i % 4] - b[i / 4][i % 4]).abs()).fold(0.0, f64::max)
}

/// Describes why `camera_from_world` is not the inverse of `world_from_camera`; `None` if it is.
fn is_no_inverse(said: &Json, world_from_camera: &[[f64; 4]; 4]) -> Option<String> {
    let Some(camera_from_world) = matrix(said) else {
        return Some("`camera_from_world` is no 4 × 4 matrix of numbers".to_owned());
    };
    let identity = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let differ = difference(&product(&camera_from_world, world_from_camera), &identity);
    (differ > ROUNDING)
        .then(|| format!("`camera_from_world` is not the inverse of `world_from_camera`: off by {differ:.2e}"))
}

/// Whether the size of an object is known.
fn has_box(products: &Products) -> bool {
    products.get(OBJECT_INFO).is_ok_and(|infos| infos.iter().any(|(_, info)| corners(info).is_some()))
}

/// Whether the lens has distortion, so that the image of a box may extend beyond its corners.
fn is_distorted(products: &Products) -> bool {
    json(products, CAMERA).is_ok_and(|camera| DistortionRecord::NAMES.iter().any(|name| camera.get(name).is_some()))
}

fn product(a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn json<T: Product>(products: &Products, key: Key<T>) -> Result<Json> {
    let value = products.value(key.name())?;
    serde_json::to_value(value).map_err(|error| Error::new(format!("product `{}`: {error}", key.name())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_taken_once() {
        let mut stream = Stream::root(4);
        for _ in 0..200 {
            let (mut bits, mut all) = (vec![0_u64; 4], vec![false; 256]);
            for _ in 0..6 {
                let start = stream.below(256) as u32;
                let end = start + stream.below(u64::from(257 - start)) as u32;
                let before = all[start as usize..end as usize].iter().filter(|bit| **bit).count() as u32;
                all[start as usize..end as usize].fill(true);
                assert_eq!(take(&mut bits, start..end), before, "{start}..{end}");
            }
            assert!(all.iter().enumerate().all(|(at, bit)| (bits[at / 64] >> (at % 64) & 1 == 1) == *bit));
        }
    }
}
