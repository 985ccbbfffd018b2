//! Statistics of label sets with known answers, and of random label sets compared with a count pixel by pixel.

use std::collections::BTreeMap;
use syntable_formats::read::{self, ObjectLabels};
use syntable_model::error::Result;
use syntable_model::product::standard::{CAMERA, DEPTH, OBJECT_INFO, OBJECT_NAME, RGB};
use syntable_model::product::{KeyId, Mask, OcclusionOrder, Plane, Products, Value};
use syntable_model::random::Stream;
use syntable_model::reader::{ImageRef, ImageSource, OpenDataset, Opened, ReadImage, Source};
use syntable_model::scene::{InstanceId, SceneId, ViewId};
use syntable_model::stage::DatasetInfo;
use syntable_report::stats::distance::{distances, jensen_shannon, wasserstein_1};
use syntable_report::stats::distribution::{Binning, Distribution};
use syntable_report::stats::quantity::Quantity;
use syntable_report::stats::table::{Described, csv, json, text};
use syntable_report::stats::{DatasetStatistics, Edges, LayerCounts, StatisticsOptions, bin_alike, of};
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_runtime::workers::Pool;

/// An object: its amodal and visible masks in a handmade label set.
#[derive(Clone)]
struct LabelObject {
    amodal: Mask,
    visible: Mask,
    name: &'static str,
}

/// A dataset in memory: the scene and objects of each image, and optional data.
#[derive(Clone)]
struct Paper {
    info: DatasetInfo,
    refs: Vec<ImageRef>,
    images: Vec<Vec<LabelObject>>,
    orders: Vec<OcclusionOrder>,
    rgb: Vec<Plane<[u8; 3]>>,
    depth: Vec<Plane<f32>>,
    poses: bool,
    visible_alone: bool,
}

const SIZE: [u32; 2] = [20, 16];

impl Paper {
    fn new(images: Vec<(u32, Vec<LabelObject>)>) -> Self {
        let mut paper = Self {
            info: read::Categories::default().info("paper".into(), String::new(), &[], String::new()),
            refs: Vec::new(),
            images: Vec::new(),
            orders: Vec::new(),
            rgb: Vec::new(),
            depth: Vec::new(),
            poses: false,
            visible_alone: false,
        };
        for (number, (scene, objects)) in (0..).zip(images) {
            paper.refs.push(ImageRef {
                scene: SceneId(scene),
                view: ViewId(number),
                name: format!("{number}"),
                id: None,
            });
            paper.images.push(objects);
        }
        paper
    }

    fn open(&self) -> OpenDataset {
        let mut offers = read::KnownMasks::with_amodal(!self.visible_alone).offers();
        offers.push(OBJECT_NAME.id());
        let more =
            [(RGB.id(), !self.rgb.is_empty()), (DEPTH.id(), !self.depth.is_empty()), (OBJECT_INFO.id(), self.poses)];
        offers.extend(more.into_iter().filter(|(_, has)| *has).map(|(key, _)| key));
        let opened = || Ok(Opened::new(self.info.clone(), self.refs.clone(), offers, self.clone()));
        OpenDataset::open("paper", &Source::new("paper"), opened).expect("opens")
    }

    fn statistics(&self, options: &StatisticsOptions, threads: usize) -> DatasetStatistics {
        of(
            &self.open(),
            options,
            &ImageWork { workers: &Pool::new(threads).expect("threads"), reporter: &Quiet, stop: &Stop::default() },
        )
        .unwrap_or_else(|error| panic!("{error}"))
    }
}

impl ImageSource for Paper {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let ids = || (1..).map(InstanceId);
        let labels = ids().zip(&self.images[image]).map(|(id, object)| ObjectLabels {
            id,
            visible: object.visible.clone(),
            amodal: (!self.visible_alone).then(|| object.amodal.clone()),
            occlusion: None,
            rate: None,
            visible_box: None,
            amodal_box: None,
            category: 1,
        });
        let mut products = Products::new();
        read::put(&labels.collect::<Vec<_>>(), self.orders.get(image).cloned(), wants, &mut products)?;
        if wants.contains(&OBJECT_NAME.id()) {
            products
                .put(OBJECT_NAME, ids().zip(&self.images[image]).map(|(id, it)| (id, it.name.to_owned())).collect())?;
        }
        if wants.contains(&OBJECT_INFO.id()) {
            // The center of a box of 0.3 × 0.4 × 0.2 m lies 3 m to the right of the camera and 4 m ahead of it. The
            // camera is rotated by 90°.
            let info = Value::of(&serde_json::json!({
                "bounds_m": [[0.0, 0.0, 0.0], [0.3, 0.4, 0.2]],
                "camera_from_object": [[0, -1, 0, 3.2], [1, 0, 0, -0.15], [0, 0, 1, 3.9], [0, 0, 0, 1]],
            }))?;
            products.put(OBJECT_INFO, ids().zip(&self.images[image]).map(|(id, _)| (id, info.clone())).collect())?;
        }
        if let Some(rgb) = self.rgb.get(image).filter(|_| wants.contains(&RGB.id())) {
            products.put(RGB, rgb.clone())?;
        }
        if let Some(depth) = self.depth.get(image).filter(|_| wants.contains(&DEPTH.id())) {
            products.put(DEPTH, depth.clone())?;
        }
        assert!(!wants.contains(&CAMERA.id()));
        Ok(ReadImage::new(SIZE, products))
    }
}

/// A rectangle of columns and rows that starts at x and y.
fn rect([x, y, width, height]: [u32; 4]) -> Mask {
    Mask::from_fn(SIZE[0], SIZE[1], |u, v| (x..x + width).contains(&u) && (y..y + height).contains(&v))
}

/// Rectangles from front to back: each rectangle hides the rectangles behind it.
fn stacked(shapes: &[[u32; 4]]) -> Vec<LabelObject> {
    let mut front = Mask::empty(SIZE[0], SIZE[1]);
    let of = |shape: &[u32; 4]| {
        let amodal = rect(*shape);
        let visible = amodal.minus(&front);
        front = front.or(&amodal);
        LabelObject { amodal, visible, name: "box" }
    };
    shapes.iter().map(of).collect()
}

/// Objects with 18 visible pixels, one row each, and for each edge (i, j) one pixel of i that hides j.
fn with_edges(objects: u32, edges: &[(u32, u32)]) -> Vec<LabelObject> {
    let row = |it: u32| rect([0, it, 18, 1]);
    let of = |it: u32| {
        let occluders = edges.iter().filter(|edge| edge.1 == it);
        let amodal = occluders.fold(row(it), |whole, (front, _)| whole.or(&rect([it, *front, 1, 1])));
        LabelObject { amodal, visible: row(it), name: "rod" }
    };
    (0..objects).map(of).collect()
}

fn histogram(of: &DatasetStatistics, quantity: Quantity) -> BTreeMap<String, u64> {
    let of = of.distribution(quantity).expect("values");
    of.edges().iter().map(|edge| format!("{edge:.4}")).zip(of.histogram()).filter(|it| it.1 > 0).collect()
}

fn values(of: &DatasetStatistics, quantity: Quantity) -> Vec<(f64, u64)> {
    of.distribution(quantity).map_or_else(Vec::new, |it| it.counts().collect())
}

fn near(found: Option<f64>, wanted: f64) {
    assert!(found.is_some_and(|found| (found - wanted).abs() < 1e-12), "{found:?}, not {wanted}");
}

#[test]
fn two_boxes_on_paper() {
    // An object of 4 px in front of an object of 16 px, with 2 hidden pixels; an image with one box, and an empty
    // image.
    let paper =
        Paper::new(vec![(0, stacked(&[[3, 3, 2, 2], [4, 3, 4, 4]])), (0, stacked(&[[0, 0, 5, 2]])), (1, Vec::new())]);
    let found = paper.statistics(&StatisticsOptions::default(), 2);
    let of = found.totals;
    assert_eq!((of.images, of.empty_images, of.scenes, of.objects), (3, Some(1), 2, Some(1)));
    assert_eq!((of.visible_instances, of.occluded_instances, of.hidden_instances), (Some(3), Some(1), 0));
    assert_eq!((of.amodal_px, of.occluded_px), (Some(30), Some(2)));
    // Weighted by pixels, which differs from the mean of the rates 0, 1/8 and 0.
    near(of.average_occlusion_rate, 2.0 / 30.0);
    near(of.mean_occlusion_rate, 1.0 / 24.0);
    near(of.mean_occlusion_rate_of_occluded, 1.0 / 8.0);
    assert_eq!(
        histogram(&found, Quantity::OcclusionRate),
        BTreeMap::from([("0.0000".into(), 2), ("0.1000".into(), 1)])
    );
    assert_eq!(values(&found, Quantity::ObjectsPerView), [(0.0, 1), (1.0, 1), (2.0, 1)]);
    assert_eq!(values(&found, Quantity::ComponentSize), [(1.0, 1), (2.0, 1)]);
    assert_eq!(values(&found, Quantity::ComponentsPerView), [(0.0, 1), (1.0, 2)]);
    assert_eq!(values(&found, Quantity::ObjectArea), [(4.0, 1), (10.0, 1), (16.0, 1)]);
    assert_eq!(found.layers, Some(LayerCounts { top: 2, intermediate: 0, bottom: 1 }));
    let asset = &found.assets.as_ref().expect("names")[0];
    assert_eq!((asset.name.as_str(), asset.instances, asset.views, asset.scenes), ("box", 3, 2, 1));
    let row = found.images[0].occlusion.expect("amodal masks");
    assert_eq!((row.occluded, row.edges, row.components, row.depth_layers), (1, 1, 1, 2));
    near(row.rate, 0.1);
    assert_eq!((row.max_rate, found.images[2].occlusion.expect("masks").rate), (Some(0.125), None));
}

#[test]
fn graphs_on_paper() {
    // The examples of the specification: a chain with a shortcut and a pair; a ring of three with a tail; two objects
    // that hide each other.
    let paper = Paper::new(vec![
        (0, with_edges(6, &[(0, 1), (1, 2), (0, 2), (3, 4)])),
        (0, with_edges(5, &[(0, 1), (1, 2), (2, 0), (2, 3)])),
        (0, with_edges(3, &[(0, 1), (1, 0)])),
    ]);
    let found = paper.statistics(&StatisticsOptions::default(), 1);
    let of = found.totals;
    assert_eq!((of.edges, of.mutual_pairs, of.cyclic_views), (Some(10), Some(1), Some(2)));
    assert_eq!(values(&found, Quantity::ComponentSize), [(1.0, 3), (2.0, 2), (3.0, 1), (4.0, 1)]);
    assert_eq!(values(&found, Quantity::ComponentsPerView), [(2.0, 2), (3.0, 1)]);
    let rows: Vec<_> = found.images.iter().map(|it| it.occlusion.expect("amodal masks")).collect();
    assert_eq!(rows.iter().map(|row| row.layers.counts()).collect::<Vec<_>>(), [[3, 1, 2], [1, 3, 1], [1, 2, 0]]);
    assert_eq!(rows.iter().map(|row| row.largest_component).collect::<Vec<_>>(), [3, 4, 2]);
    // The longest path of the first graph has two edges; a cycle is one layer.
    assert_eq!(rows.iter().map(|row| row.depth_layers).collect::<Vec<_>>(), [3, 2, 1]);
    assert_eq!(found.layers, Some(LayerCounts { top: 5, intermediate: 6, bottom: 3 }));
}

#[test]
fn conventions_of_the_authors() {
    let edges = [(0, 1), (1, 2), (0, 2), (3, 4)];
    let mut paper = Paper::new(vec![(0, with_edges(6, &edges))]);
    let with = |paper: &Paper, options: StatisticsOptions| paper.statistics(&options, 1);
    // Prefixes of 1 to 6 objects: {1}, {2}, {3}, {3, 1}, {3, 2}, {3, 2, 1}.
    let prefixes = with(&paper, StatisticsOptions { prefixes: true, ..StatisticsOptions::default() });
    assert_eq!(values(&prefixes, Quantity::ComponentSize), [(1.0, 3), (2.0, 3), (3.0, 4)]);
    assert_eq!(values(&prefixes, Quantity::ComponentsPerView), [(1.0, 3), (2.0, 2), (3.0, 1)]);
    assert_eq!(prefixes.images[0].occlusion.expect("masks").components, 3);
    // One pixel of 18 is an IoU below 0.1; a rod that hides 6 of the 18 pixels is above.
    assert_eq!(
        with(&paper, StatisticsOptions { edges: Edges::Iou, ..StatisticsOptions::default() }).totals.edges,
        Some(0)
    );
    let overlap = Paper::new(vec![(0, stacked(&[[0, 0, 6, 3], [0, 0, 9, 4]]))]);
    assert_eq!(
        with(&overlap, StatisticsOptions { edges: Edges::Iou, ..StatisticsOptions::default() }).totals.edges,
        Some(1)
    );
    // Ten bins from the minimum to the maximum rate: 0, and 1/19 and 2/20 for objects hidden by one or two others.
    let equal = with(&paper, StatisticsOptions { binning: Binning::Equal, ..StatisticsOptions::default() });
    let rates = equal.distribution(Quantity::OcclusionRate).expect("rates");
    assert_eq!((rates.edges()[0], rates.edges()[10]), (0.0, 0.1));
    assert_eq!(rates.histogram(), [3, 0, 0, 0, 0, 2, 0, 0, 0, 1]);
    // The order that the dataset stores, regardless of the masks.
    let mut order = OcclusionOrder::new((1..=6).map(InstanceId).collect());
    order.set(5, 0);
    paper.orders = vec![order];
    let stored = with(&paper, StatisticsOptions { edges: Edges::Stored, ..StatisticsOptions::default() });
    assert_eq!((stored.totals.edges, stored.totals.occluded_instances), (Some(1), Some(3)));
}

#[test]
fn hidden_objects_count_by_themselves() {
    let mut objects = stacked(&[[2, 2, 6, 6], [3, 3, 2, 2], [6, 2, 4, 2]]);
    objects[1].name = "hidden";
    let found = Paper::new(vec![(0, objects)]).statistics(&StatisticsOptions::default(), 1);
    let of = found.totals;
    assert_eq!((of.visible_instances, of.hidden_instances, of.occluded_instances), (Some(2), 1, Some(1)));
    near(of.average_occlusion_rate, 4.0 / 44.0);
    assert_eq!((of.objects, of.edges, found.images[0].hidden_objects), (Some(1), Some(1), 1));
    assert!(text(&[described(found)]).contains("without a visible pixel, not counted elsewhere: 1"));
}

fn described(statistics: DatasetStatistics) -> Described {
    Described { dataset: "paper".into(), format: "paper", statistics }
}

#[test]
fn what_a_format_lacks_is_said() {
    let mut paper = Paper::new(vec![(0, stacked(&[[3, 3, 2, 2], [4, 3, 4, 4]]))]);
    paper.visible_alone = true;
    let found = paper.statistics(&StatisticsOptions::default(), 1);
    assert_eq!((found.totals.visible_instances, found.totals.occluded_instances, found.layers), (Some(2), None, None));
    assert_eq!(found.totals.average_occlusion_rate, None);
    assert_eq!(values(&found, Quantity::ObjectArea), [(4.0, 1), (14.0, 1)]);
    assert!(found.distribution(Quantity::OcclusionRate).is_none() && found.near_duplicates.is_none());
    let said = found.unknown.join("\n");
    for part in ["no amodal masks", "no boxes in space", "no poses", "no depth images", "no color images"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(found.unknown.len(), 5, "{said}");
}

#[test]
fn depth_distance_size_and_brightness() {
    let mut paper = Paper::new(vec![(0, stacked(&[[3, 3, 2, 2]])), (0, Vec::new()), (1, Vec::new())]);
    paper.poses = true;
    let gray = |level: u8| Plane::from_fn(SIZE[0], SIZE[1], move |_, _| [level; 3]);
    paper.rgb = vec![gray(51), gray(102), gray(54)];
    let depth = |left: f32| Plane::from_fn(SIZE[0], SIZE[1], move |x, _| if x < 5 { left } else { 2.37 });
    paper.depth = vec![depth(f32::INFINITY), depth(0.0), depth(0.5)];
    let found = paper.statistics(&StatisticsOptions::default(), 2);
    near(found.distribution(Quantity::ObjectDistance).and_then(Distribution::mean), 5.0);
    near(found.distribution(Quantity::ObjectSize).and_then(Distribution::mean), 0.4);
    near(found.images[0].mean_distance_m, 5.0);
    // Depths of 15, 15 and 20 of 20 columns.
    let depths: Vec<_> =
        values(&found, Quantity::Depth).iter().map(|(m, n)| ((m * 100.0).round() as u64, *n)).collect();
    assert_eq!(depths, [(50, 80), (237, 720)]);
    assert!((found.images[2].mean_depth_m.expect("depth") - (0.25 * 0.5 + 0.75 * 2.37)).abs() < 1e-6);
    let brightness = found.distribution(Quantity::Brightness).expect("images");
    near(brightness.mean(), (51.0 + 102.0 + 54.0) / 3.0 / 255.0);
    assert_eq!(brightness.histogram(), [0, 0, 2, 0, 1, 0, 0, 0, 0, 0]);
    // 51 and 54 differ by three levels, in different scenes.
    let duplicates = found.near_duplicates.expect("images");
    assert_eq!((duplicates.views, duplicates.redundant, duplicates.groups_in_scene), (2, 1, 0));
    assert_eq!(duplicates.groups, [["0", "2"]]);
    assert_eq!(found.images.iter().map(|it| it.duplicates).collect::<Vec<_>>(), [Some(0), None, Some(0)]);
    let strict = paper.statistics(&StatisticsOptions { levels: 2, ..StatisticsOptions::default() }, 1);
    assert_eq!(strict.near_duplicates.expect("images").views, 0);
    let labels = paper.statistics(&StatisticsOptions { labels_only: true, ..StatisticsOptions::default() }, 1);
    assert!(labels.near_duplicates.is_none() && labels.distribution(Quantity::Depth).is_none());
    assert!(labels.unknown.iter().any(|it| it.contains("not read")), "{:?}", labels.unknown);
}

/// Overlapping random rectangles with a random order for each pair, so cycles occur.
fn random(stream: &mut Stream, images: u32) -> Paper {
    const NAMES: [&str; 4] = ["mug", "bowl", "can", "fork"];
    let mut draw = |low: u32, high: u32| (stream.uniform(f64::from(low), f64::from(high)) as u32).min(high - 1);
    let image = |number: u32| {
        let shapes: Vec<Mask> =
            (0..draw(0, 9)).map(|_| rect([draw(0, 9), draw(0, 7), draw(1, 9), draw(1, 8)])).collect();
        let n = shapes.len();
        let mut front = vec![false; n * n];
        for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
            front[if draw(0, 2) == 0 { i * n + j } else { j * n + i }] = true;
        }
        let objects = (0..n).map(|j| {
            let others = (0..n).filter(|i| front[i * n + j]);
            let visible = others.fold(shapes[j].clone(), |seen, i| seen.minus(&shapes[i]));
            LabelObject { amodal: shapes[j].clone(), visible, name: NAMES[j % 4] }
        });
        (number / 3, objects.collect())
    };
    Paper::new((0..images).map(image).collect())
}

/// Recomputes all numbers from sets of pixels.
#[test]
fn random_labels_are_counted_as_pixel_by_pixel() {
    let paper = random(&mut Stream::root(11), 120);
    let found = paper.statistics(&StatisticsOptions::default(), 3);
    let (mut rates, mut sizes, mut layers, mut edges, mut cyclic) = (Vec::new(), Vec::new(), [0; 3], 0, 0);
    let (mut hidden_px, mut amodal_px, mut occluded, mut unseen) = (0, 0, 0, 0);
    for (image, row) in paper.images.iter().zip(&found.images) {
        let planes = |mask: &Mask| mask.to_plane().data().to_vec();
        let objects: Vec<(Vec<bool>, Vec<bool>)> = image
            .iter()
            .map(|it| (planes(&it.visible), planes(&it.amodal)))
            .filter(|(visible, _)| visible.contains(&true))
            .collect();
        unseen += image.len() - objects.len();
        let count = |plane: &[bool]| plane.iter().filter(|it| **it).count();
        let n = objects.len();
        let occludes = |i: usize, j: usize| {
            let ((front, _), (visible, amodal)) = (&objects[i], &objects[j]);
            i != j && (0..front.len()).any(|at| front[at] && amodal[at] && !visible[at])
        };
        for (visible, amodal) in &objects {
            let (all, seen) = (count(amodal), count(visible));
            (hidden_px, amodal_px) = (hidden_px + all - seen, amodal_px + all);
            occluded += usize::from(all > seen);
            rates.push((all - seen) as f64 / all as f64);
        }
        // Components, found by spreading numbers along edges until nothing changes.
        let mut number: Vec<usize> = (0..n).collect();
        for _ in 0..n {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| occludes(i, j)) {
                let least = number[i].min(number[j]);
                (number[i], number[j]) = (least, least);
            }
        }
        let of_image: Vec<usize> =
            (0..n).map(|it| number.iter().filter(|other| **other == it).count()).filter(|size| *size > 0).collect();
        assert_eq!(row.occlusion.expect("masks").components as usize, of_image.len());
        sizes.extend(of_image);
        for it in 0..n {
            let (is_occluded, is_front) = ((0..n).any(|i| occludes(i, it)), (0..n).any(|j| occludes(it, j)));
            layers[if !is_occluded {
                0
            } else if is_front {
                1
            } else {
                2
            }] += 1;
            edges += (0..n).filter(|j| occludes(it, *j)).count();
        }
        // Repeatedly removing all unoccluded nodes removes every node of a graph without cycles.
        let mut left: Vec<usize> = (0..n).collect();
        for _ in 0..n {
            let remaining = left.clone();
            left.retain(|j| remaining.iter().any(|i| occludes(*i, *j)));
        }
        cyclic += u64::from(!left.is_empty());
    }
    let of = found.totals;
    assert_eq!((of.visible_instances, of.occluded_instances), (Some(rates.len() as u64), Some(occluded as u64)));
    assert_eq!((of.amodal_px, of.occluded_px), (Some(amodal_px as u64), Some(hidden_px as u64)));
    assert_eq!((of.edges, of.cyclic_views, of.hidden_instances), (Some(edges as u64), Some(cyclic), unseen as u64));
    assert!(cyclic > 0 && unseen > 0, "the sample has both");
    assert_eq!(found.layers.expect("masks").counts(), layers);
    near(of.mean_occlusion_rate, rates.iter().sum::<f64>() / rates.len() as f64);
    let mut bins = [0; 10];
    rates.iter().for_each(|rate| bins[((rate * 10.0 + 1e-9) as usize).min(9)] += 1);
    assert_eq!(found.distribution(Quantity::OcclusionRate).expect("rates").histogram(), bins);
    let mut by_size: BTreeMap<usize, u64> = BTreeMap::new();
    sizes.iter().for_each(|size| *by_size.entry(*size).or_default() += 1);
    let wanted: Vec<_> = by_size.into_iter().map(|(size, count)| (size as f64, count)).collect();
    assert_eq!(values(&found, Quantity::ComponentSize), wanted);
    for asset in found.assets.expect("names") {
        let seen = |image: &&Vec<LabelObject>| image.iter().any(|it| it.name == asset.name && !it.visible.is_empty());
        assert_eq!(asset.views as usize, paper.images.iter().filter(seen).count(), "{}", asset.name);
        let mut scenes: Vec<u32> =
            paper.refs.iter().zip(&paper.images).filter(|it| seen(&it.1)).map(|it| it.0.scene.0).collect();
        scenes.dedup();
        assert_eq!(asset.scenes as usize, scenes.len(), "{}", asset.name);
    }
}

#[test]
fn threads_change_nothing() {
    let mut paper = random(&mut Stream::root(3), 300);
    let mut stream = Stream::root(4);
    let mut level = || stream.uniform(0.0, 60.0) as u8;
    paper.rgb = (0..300).map(|_| [level(); 3]).map(|color| Plane::from_fn(SIZE[0], SIZE[1], |_, _| color)).collect();
    let of = |threads| [described(paper.statistics(&StatisticsOptions::default(), threads))];
    let (one, four) = (of(1), of(4));
    assert_eq!((json(&one), text(&one), csv(&one)), (json(&four), text(&four), csv(&four)));
    assert!(json(&one).contains("\"groups_in_scene\""));
}

/// Samples of equal size are transformed into each other by pairing them in order.
#[test]
fn distances_by_other_means() {
    let mut stream = Stream::root(9);
    let mut sample = |n: usize, low: f64, high: f64| -> Vec<f64> {
        let mut all: Vec<f64> = (0..n).map(|_| (stream.uniform(low, high) * 1e3).round() / 1e3).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let of = |values: &[f64]| {
        let mut of = Distribution::new(Quantity::ObjectDistance);
        values.iter().for_each(|value| of.add(*value));
        of
    };
    for (n, ends) in [(1, [2.0, 3.0]), (50, [0.0, 1.0]), (400, [0.4, 5.0])] {
        let (a, b) = (sample(n, 0.0, 2.0), sample(n, ends[0], ends[1]));
        let moved = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / n as f64;
        let found = wasserstein_1(&of(&a), &of(&b)).expect("values");
        assert!((found - moved).abs() < 1e-9, "{found}, not {moved}");
        // For samples of different sizes, each value is repeated.
        let twice: Vec<f64> = b.iter().flat_map(|it| [*it; 3]).collect();
        assert!((wasserstein_1(&of(&a), &of(&twice)).expect("values") - moved).abs() < 1e-9);
        assert!(wasserstein_1(&of(&b), &of(&twice)).expect("values") < 1e-12);
    }
    assert_eq!(wasserstein_1(&of(&[]), &of(&[1.0])), None);
    near(jensen_shannon(&[3, 5], &[6, 10]), 0.0);
    near(jensen_shannon(&[4, 0], &[0, 2]), 1.0);
    assert_eq!(jensen_shannon(&[0, 0], &[0, 2]), None);
    // (1/2, 1/2) and (1, 0): H(3/4, 1/4) minus the mean of one bit and zero bits.
    let entropy = 0.75 * (4.0_f64 / 3.0).log2() + 0.25 * 2.0;
    near(jensen_shannon(&[7, 7], &[9, 0]), entropy - 0.5);
}

#[test]
fn datasets_side_by_side() {
    let one =
        Paper::new(vec![(0, stacked(&[[3, 3, 2, 2], [4, 3, 4, 4]]))]).statistics(&StatisticsOptions::default(), 1);
    let mut paper = Paper::new(vec![(0, stacked(&[[0, 0, 5, 2]])), (0, stacked(&[[0, 0, 5, 2]]))]);
    paper.depth = vec![Plane::from_fn(SIZE[0], SIZE[1], |_, _| 1.0); 2];
    let mut all = [described(one), described(paper.statistics(&StatisticsOptions::default(), 1))];
    bin_alike(&mut all.iter_mut().map(|it| &mut it.statistics).collect::<Vec<_>>(), Binning::Fixed);
    let [one, two] = &all;
    let found = distances(&one.statistics, &two.statistics);
    let of = |name: &str| found.iter().find(|it| it.name == name).map(|it| (it.wasserstein_1, it.jensen_shannon));
    // Two objects against one; half of the rates move by 1/8; only one dataset has depth.
    assert_eq!(of("objects_per_view"), Some((Some(1.0), 1.0)));
    let (moved, _) = of("occlusion_rate").expect("rates");
    near(moved, 1.0 / 16.0);
    assert_eq!(of("depth"), None);
    assert!(of("layer").is_some_and(|(moved, bits)| moved.is_none() && bits > 0.2));
    let edges = [one, two].map(|it| it.statistics.distribution(Quantity::ObjectArea).expect("areas").edges().to_vec());
    assert_eq!((&edges[0], &edges[0]), (&edges[1], &vec![4.0, 8.0, 16.0, 32.0]));
    let said = text(&all);
    assert!(said.contains("distance of paper from paper") && said.contains("Wasserstein-1"), "{said}");
    let lines: Vec<String> = csv(&all).lines().map(str::to_owned).collect();
    assert_eq!((lines.len(), lines[0].split(',').count()), (4, lines[1].split(',').count()));
    assert!(lines[1].starts_with("\"paper\",\"0\",,0,0,2,0,1,2,20,0.1,"), "{}", lines[1]);
}

#[test]
fn an_empty_dataset_is_refused() {
    let (pool, stop) = (Pool::new(1).expect("a thread"), Stop::default());
    let work = ImageWork { workers: &pool, reporter: &Quiet, stop: &stop };
    let error = of(&Paper::new(Vec::new()).open(), &StatisticsOptions::default(), &work);
    assert_eq!(error.expect_err("no image").to_string(), "the dataset has no image");
}
