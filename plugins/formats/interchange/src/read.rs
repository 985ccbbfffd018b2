//! Shared code of this crate's readers: it finds files, and corrects masks from outlines.

use std::collections::BTreeSet;
use std::path::Path;
use syntable_formats::read::ObjectLabels;
use syntable_model::prelude::*;
use syntable_model::product::{BBox, meeting_boxes};
use syntable_model::reader::DatasetFault;
use syntable_model::rule;

/// The note about the accuracy of polygons.
pub const POLYGONS: &str = "outlines are polygons, which are exact to about a pixel at an object's edges";

/// Tolerance of the box of polygons, px: some tools compute the box from the pixels that the polygons touch.
const OUTLINE_BOX_PX: f64 = 1.0;

/// Whether the name of a file begins with `start`.
pub fn name_starts(path: &Path, start: &str) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(start))
}

/// The box of whole pixels around a box, `[x, y, width, height]`.
pub fn pixels_around(bbox: [f64; 4]) -> BBox {
    let [x, y] = [bbox[0], bbox[1]].map(|low| low.floor());
    let [w, h] = [bbox[0] + bbox[2] - x, bbox[1] + bbox[3] - y].map(|size| size.ceil());
    BBox::from([x, y, w, h].map(|edge| edge as i32))
}

/// The fault of an object without a pixel.
pub fn no_pixels() -> DatasetFault {
    let message = "the object has no pixels, since no mask covers the center of a pixel of the image";
    DatasetFault::new(rule::OBJECTS_HAVE_PIXELS, message)
}

/// The hidden part of an object with an amodal mask.
pub fn hidden_of(label: &ObjectLabels) -> Mask {
    label.hidden().unwrap_or_else(|| Mask::empty(label.visible.width(), label.visible.height()))
}

/// Tolerances between the numbers in a file and their mask.
#[derive(Debug, Clone, Copy)]
pub struct MaskTolerance {
    /// Of an area, px².
    pub area_px2: f64,
    /// Of the edges of a box, px.
    pub box_px: f64,
}

/// Compares an area and a box in a file with their mask. Each is given with its key. A missing number is no fault.
pub fn fits_mask(
    mask: &Mask,
    (area_key, area): (&str, Option<f64>),
    (bbox_key, bbox): (&str, Option<[f64; 4]>),
    tolerance: MaskTolerance,
) -> Vec<DatasetFault> {
    let mut faults = Vec::new();
    if let Some(area) = area.filter(|area| (area - f64::from(mask.area())).abs() > tolerance.area_px2) {
        let message = format!("`{area_key}` is {area}, its mask has {}", mask.area());
        faults.push(DatasetFault::new(rule::AREAS_MATCH_MASKS, message));
    }
    let own = <[i32; 4]>::from(mask.bbox()).map(f64::from);
    let is_off = |bbox: &[f64; 4]| bbox.iter().zip(&own).any(|(said, own)| (said - own).abs() > tolerance.box_px);
    if let Some(bbox) = bbox.filter(is_off) {
        let message = format!("`{bbox_key}` is {bbox:?}, but its mask has {own:?}");
        faults.push(DatasetFault::new(rule::BOX_MATCHES_MASK, message));
    }
    faults
}

/// Area that outlines enclose, px². The intersection of two outlines is counted twice.
pub fn enclosed_px2(outlines: &[Vec<f64>]) -> f64 {
    let of = |outline: &Vec<f64>| {
        let corners = outline.as_chunks::<2>().0;
        let next = corners.iter().cycle().skip(1);
        (corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0).abs()
    };
    outlines.iter().map(of).sum()
}

/// Compares an area and a box in a file with their outlines. Each is given with its key. The area may be the area of
/// the outlines or of their mask. The box may enclose the outlines or only their part in the image.
pub fn fits_outlines(
    (key, outlines): (&str, &[Vec<f64>]),
    mask: &Mask,
    (area_key, area): (&str, Option<f64>),
    (bbox_key, bbox): (&str, Option<[f64; 4]>),
) -> Vec<DatasetFault> {
    let outside = |message: String| vec![DatasetFault::new("polygons_are_in_the_image", message)];
    let mut faults = Vec::new();
    let corners = || outlines.iter().flat_map(|outline| outline.as_chunks::<2>().0);
    let low: [f64; 2] = std::array::from_fn(|axis| corners().map(|at| at[axis]).fold(f64::INFINITY, f64::min));
    let high: [f64; 2] = std::array::from_fn(|axis| corners().map(|at| at[axis]).fold(f64::NEG_INFINITY, f64::max));
    let image = [mask.width(), mask.height()].map(f64::from);
    let enclosed = enclosed_px2(outlines);
    if (0..2).any(|axis| high[axis] < 0.0 || low[axis] > image[axis]) {
        return outside(format!("`{key}` is outside of the image: {low:?} to {high:?}"));
    }
    if enclosed == 0.0 {
        return outside(format!("`{key}` encloses no area"));
    }
    faults.extend(area.and_then(|area| fault_of_area(area, (area_key, bbox_key), (mask, enclosed), bbox)));
    let Some(bbox) = bbox else { return faults };
    let said = [bbox[0], bbox[1], bbox[0] + bbox[2], bbox[1] + bbox[3]];
    let own = [low[0], low[1], high[0], high[1]];
    let off = |side: usize| {
        let shown = own[side].clamp(0.0, image[side % 2]);
        // NaN is off, too.
        let is_near = |own: f64| (said[side] - own).abs() <= OUTLINE_BOX_PX;
        !is_near(own[side]) && !is_near(shown)
    };
    if (0..4).any(off) {
        let message = format!("`{bbox_key}` is {bbox:?}, its polygons reach from {low:?} to {high:?}");
        faults.push(DatasetFault::new(rule::BOX_MATCHES_MASK, message));
    }
    faults
}

/// The fault of an area that neither outlines nor their mask have. The outlines enclose `enclosed` px².
fn fault_of_area(
    area: f64,
    (area_key, bbox_key): (&str, &str),
    (mask, enclosed): (&Mask, f64),
    bbox: Option<[f64; 4]>,
) -> Option<DatasetFault> {
    let own = f64::from(mask.area());
    let is_within = |px2: f64| (own.min(enclosed) - px2..=own.max(enclosed) + px2).contains(&area);
    // The edge takes longer than the rest, and seldom matters.
    if is_within(1.0) || is_within(edge_px2(mask)) {
        return None;
    }
    // Roboflow states it for every object.
    let is_of_box = bbox.is_some_and(|[.., width, height]| (width * height - area).abs() <= 1.0);
    let stated = if is_of_box { format!(", the area of `{bbox_key}`") } else { String::new() };
    let message = format!("`{area_key}` is {area}{stated}, its polygons enclose {enclosed:.1} px²");
    Some(DatasetFault::new(rule::AREAS_MATCH_MASKS, message))
}

/// Number of pixels by which a polygon around a mask may differ from the mask.
pub fn edge_px2(mask: &Mask) -> f64 {
    f64::from(mask.minus(&eroded(mask)).area())
}

/// Resolves ambiguities of polygons. A polygon follows its mask to within a pixel, so visible pixels just outside of
/// the amodal mask are added to it, and a pixel at the edges of two objects belongs to the first object. Polygons have
/// no holes: if visible pixels of an object lie within the outline of another object, away from its edge, the other
/// object has a hole there or is behind. Other faults remain.
pub fn settle_edges(labels: &mut [ObjectLabels]) {
    for label in labels.iter_mut() {
        if let Some(amodal) = &mut label.amodal
            && label.visible.minus(&dilated(amodal)).is_empty()
        {
            *amodal = amodal.or(&label.visible);
        }
    }
    let boxes: Vec<BBox> = labels.iter().map(|label| label.visible.bbox()).collect();
    let mut pairs = Vec::new();
    meeting_boxes(&boxes, &boxes, |back, front| pairs.extend((front < back).then_some((back, front))));
    pairs.sort_unstable();
    for (back, front) in pairs {
        let shared = labels[front].visible.and(&labels[back].visible);
        if shared.is_empty() {
            continue;
        }
        let inner = [front, back].map(|of| eroded(&labels[of].visible));
        let is_within = |inner: &Mask| shared.minus(inner).is_empty();
        let loser = match inner.each_ref().map(is_within) {
            [true, false] => front,
            [_, true] => back,
            _ if shared.and(&inner[0]).and(&inner[1]).is_empty() => {
                cut_edge(&mut labels[back], &shared);
                continue;
            }
            _ => continue,
        };
        labels[loser].visible = labels[loser].visible.minus(&shared);
    }
}

/// Removes shared edge pixels from the visible mask of an object. If the record shows the object as fully visible, they
/// are also removed from the amodal mask, so that it remains fully visible.
fn cut_edge(label: &mut ObjectLabels, shared: &Mask) {
    let is_whole = label.amodal.as_ref().is_some_and(|amodal| *amodal == label.visible);
    // An object that is no wider than its edge keeps its pixels.
    let rest = label.visible.minus(shared);
    if rest.is_empty() {
        return;
    }
    label.visible = rest;
    if is_whole {
        label.amodal = Some(label.visible.clone());
    }
}

/// Removes holes from an amodal mask that was read from outlines without holes. Holes are hidden parts that the rest of
/// the object encloses, `area_px2` in total. The part whose area is nearest to the remaining area is removed, provided
/// that the remaining area is at least half of the part.
pub fn cut_holes(label: &mut ObjectLabels, mut area_px2: f64) {
    let Some(amodal) = label.amodal.as_mut().filter(|_| area_px2 > 0.0) else { return };
    let mut parts = enclosed(&amodal.minus(&label.visible), amodal);
    while area_px2 > 0.0 {
        let differs = |part: &Mask| (f64::from(part.area()) - area_px2).abs();
        let near = (0..parts.len()).min_by(|a, b| differs(&parts[*a]).total_cmp(&differs(&parts[*b])));
        let Some(hole) = near.map(|at| parts.swap_remove(at)).filter(|it| f64::from(it.area()) <= 2.0 * area_px2)
        else {
            return;
        };
        *amodal = amodal.minus(&hole);
        area_px2 -= f64::from(hole.area());
    }
}

/// The connected parts of a mask that do not reach the edge of `whole`. Pixels that meet only at a corner are not
/// connected.
pub fn enclosed(mask: &Mask, whole: &Mask) -> Vec<Mask> {
    let [width, height] = [mask.width(), mask.height()];
    let (mut open, inner) = (mask.to_plane(), eroded(whole).to_plane());
    let mut parts = Vec::new();
    for start in mask.pixels() {
        let (mut part, mut todo) = (BTreeSet::new(), vec![start]);
        while let Some(pixel) = todo.pop() {
            if !std::mem::replace(&mut open.data_mut()[pixel], false) {
                continue;
            }
            part.insert(pixel);
            let (column, row, columns) = (pixel as u32 % width, pixel as u32 / width, width as usize);
            todo.extend((column > 0).then(|| pixel - 1));
            todo.extend((column + 1 < width).then(|| pixel + 1));
            todo.extend((row > 0).then(|| pixel - columns));
            todo.extend((row + 1 < height).then(|| pixel + columns));
        }
        if !part.is_empty() && part.iter().all(|&pixel| inner.data()[pixel]) {
            parts.push(Mask::from_fn(width, height, |x, y| part.contains(&((y * width + x) as usize))));
        }
    }
    parts
}

/// The pixels of a mask whose neighbors in the image are all in the mask.
pub fn eroded(mask: &Mask) -> Mask {
    surroundings(mask, |inside, all| inside == all)
}

/// The pixels of a mask and their neighbors.
fn dilated(mask: &Mask) -> Mask {
    surroundings(mask, |inside, _| inside > 0)
}

/// The pixels for which `holds` accepts two counts in their 3 × 3 surroundings: pixels of the mask, and pixels of the
/// image.
fn surroundings(mask: &Mask, holds: impl Fn(usize, usize) -> bool) -> Mask {
    let [width, height] = [mask.width(), mask.height()];
    if mask.is_empty() {
        return mask.clone();
    }
    // The pixels of the box around the mask, column by column. All pixels outside the box are unset.
    let [left, top, columns, rows] = <[i32; 4]>::from(mask.bbox()).map(|edge| edge as u32);
    let mut inside = vec![false; columns as usize * rows as usize];
    let place = |x: u32, y: u32| (x.wrapping_sub(left) as usize, y.wrapping_sub(top) as usize);
    for position in mask.runs().flatten() {
        let (x, y) = place(position / height, position % height);
        inside[x * rows as usize + y] = true;
    }
    let is_set = |x: u32, y: u32| {
        let (x, y) = place(x, y);
        x < columns as usize && y < rows as usize && inside[x * rows as usize + y]
    };
    let around = |at: u32, end: u32| at.saturating_sub(1)..(at + 2).min(end);
    let near = |from: u32, long: u32, end: u32| from.saturating_sub(1)..(from + long + 1).min(end);
    // Positions, in column order, where the value changes. Between the columns of the box, the value is false.
    let (mut flips, mut is_on, mut next) = (Vec::new(), false, 0);
    let mut set = |position: u32, value: bool, is_on: &mut bool| {
        if value != *is_on {
            flips.push(position);
            *is_on = value;
        }
    };
    for x in near(left, columns, width) {
        for y in near(top, rows, height) {
            let position = x * height + y;
            if position > next {
                set(next, false, &mut is_on);
            }
            let pixels = || around(y, height).flat_map(|y| around(x, width).map(move |x| (x, y)));
            let count = pixels().filter(|&(x, y)| is_set(x, y)).count();
            set(position, holds(count, pixels().count()), &mut is_on);
            next = position + 1;
        }
    }
    if next < width * height {
        set(next, false, &mut is_on);
    }
    Mask::from_flips(width, height, &flips)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle([x, y, w, h]: [u32; 4]) -> Mask {
        Mask::from_fn(30, 20, |u, v| (x..x + w).contains(&u) && (y..y + h).contains(&v))
    }

    fn seen_whole(id: u16, visible: Mask) -> ObjectLabels {
        let amodal = Some(visible.clone());
        ObjectLabels {
            id: InstanceId(id),
            visible,
            amodal,
            occlusion: None,
            rate: None,
            visible_box: None,
            amodal_box: None,
            category: 1,
        }
    }

    fn settled(shapes: [[u32; 4]; 2]) -> [ObjectLabels; 2] {
        let mut labels = [1, 2].map(|id| seen_whole(id, rectangle(shapes[usize::from(id) - 1])));
        settle_edges(&mut labels);
        labels
    }

    #[test]
    fn touching_objects_stay_whole() {
        let [a, b] = settled([[2, 2, 8, 8], [9, 2, 8, 8]]);
        assert_eq!((a.visible.area(), b.visible.area()), (64, 56));
        assert!(a.visible.and(&b.visible).is_empty());
        assert_eq!((a.amodal.as_ref(), b.amodal.as_ref()), (Some(&a.visible), Some(&b.visible)), "nothing is hidden");
    }

    #[test]
    fn what_lies_on_an_object_is_seen() {
        // A cable 2 px wide across a plate, in either order.
        let (plate, cable) = ([2, 2, 20, 14], [6, 8, 10, 2]);
        for (shapes, at) in [([plate, cable], 1), ([cable, plate], 0)] {
            let labels = settled(shapes);
            assert_eq!((labels[at].visible.area(), labels[1 - at].visible.area()), (20, 260));
        }
    }

    #[test]
    fn deep_overlaps_stay_faults() {
        let [a, b] = settled([[2, 2, 10, 10], [7, 2, 10, 10]]);
        assert_eq!(a.visible.and(&b.visible).area(), 50);
    }

    #[test]
    fn masks_grow_and_shrink_as_counting_all_pixels_says() {
        let mut stream = Stream::root(3);
        for _ in 0..40 {
            let [width, height] = [1 + stream.below(9) as u32, 1 + stream.below(9) as u32];
            let fill = stream.unit();
            let mask = Mask::from_fn(width, height, |_, _| stream.chance(fill));
            let plane = mask.to_plane();
            let count = |x: u32, y: u32| {
                let near = |a: u32, b: u32| a.abs_diff(b) <= 1;
                let all = (0..width).flat_map(|u| (0..height).map(move |v| (u, v)));
                let all: Vec<(u32, u32)> = all.filter(|&(u, v)| near(u, x) && near(v, y)).collect();
                (all.iter().filter(|&&(u, v)| *plane.at(u, v)).count(), all.len())
            };
            let [grown, shrunk] = [(1, 0), (0, 1)].map(|(least, all)| {
                Mask::from_fn(width, height, |x, y| {
                    let (inside, of) = count(x, y);
                    if all == 1 { inside == of } else { inside >= least }
                })
            });
            assert_eq!((dilated(&mask), eroded(&mask)), (grown, shrunk), "{width} × {height}: {mask:?}");
        }
    }
}
