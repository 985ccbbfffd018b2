//! Metrics beyond the reference, compared with values computed by hand or by reimplementations pixel by pixel.

use std::collections::BTreeMap;
use syntable_evaluate::boundary::{Boundary, radius};
use syntable_evaluate::image::ImagePair;
use syntable_evaluate::masked_object::MaskedObject;
use syntable_evaluate::measure::{Measure, Measurement, Measures, Metric, Tally, linked};
use syntable_evaluate::{Convention, bootstrap, register_metric};
use syntable_model::context::Workers;
use syntable_model::product::Mask;
use syntable_model::random::Stream;
use syntable_model::reader::Crowd;

/// A mask of inclusive ranges of columns and rows.
fn rect([width, height]: [u32; 2], [x0, x1]: [u32; 2], [y0, y1]: [u32; 2]) -> Mask {
    Mask::from_fn(width, height, |x, y| (x0..=x1).contains(&x) && (y0..=y1).contains(&y))
}

fn values(pairs: &[ImagePair], names: &[&str]) -> BTreeMap<String, Option<f64>> {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let measures = Measures::named(&names, &[], Convention::Release).expect("metrics");
    let tallies: Vec<Tally> = pairs.iter().map(|pair| measures.tally(pair)).collect();
    measures.names().into_iter().zip(measures.values(&tallies.iter().collect::<Vec<_>>())).collect()
}

fn assert_values(found: &BTreeMap<String, Option<f64>>, wanted: &[(&str, f64)]) {
    for (name, value) in wanted {
        let found = found[*name].unwrap_or(f64::NAN);
        assert!((found - value).abs() < 1e-12, "{name} is {found}, not {value}");
    }
}

fn seen(mask: Mask) -> MaskedObject {
    MaskedObject::labeled(mask.clone(), mask)
}

/// Three objects in a row that overlap their neighbors; `fronts` states which neighbor is in front.
fn row(fronts: [bool; 2]) -> Vec<MaskedObject> {
    let size = [13, 5];
    let amodal = [rect(size, [1, 3], [1, 3]), rect(size, [3, 6], [1, 3]), rect(size, [6, 9], [3, 4])];
    let mut visible = amodal.clone();
    for (first, is_front) in fronts.into_iter().enumerate() {
        let (front, back) = if is_front { (first, first + 1) } else { (first + 1, first) };
        visible[back] = visible[back].minus(&amodal[front]);
    }
    amodal.into_iter().zip(visible).map(|(amodal, visible)| MaskedObject::labeled(amodal, visible)).collect()
}

#[test]
fn orders_of_others() {
    let of = |predictions: Vec<MaskedObject>| {
        let pair = ImagePair::new(row([true, true]), predictions).expect("one size");
        values(&[pair], &["insta_order", "deocclusion"])
    };
    let same =
        [("insta_order_r", 1.0), ("insta_order_p", 1.0), ("deocclusion_all", 1.0), ("deocclusion_occluded", 1.0)];
    assert_values(&of(row([true, true])), &same);
    // One of two edges is reversed: two of six ordered pairs are wrong, both with an edge in the labels.
    assert_values(
        &of(row([true, false])),
        &[
            ("insta_order_r", 0.5),
            ("insta_order_p", 0.5),
            ("insta_order_f1", 0.5),
            ("deocclusion_all", 4.0 / 6.0),
            ("deocclusion_occluded", 0.5),
        ],
    );
    // Without the last object, InstaOrder lacks its edges, and De-occlusion's pairs with it are wrong.
    let mut two = row([true, true]);
    two.truncate(2);
    assert_values(
        &of(two),
        &[
            ("insta_order_r", 0.5),
            ("insta_order_p", 1.0),
            ("insta_order_f1", 2.0 / 3.0),
            ("deocclusion_all", 2.0 / 6.0),
            ("deocclusion_occluded", 0.5),
        ],
    );
    // Without predictions, no edge is wrong.
    assert_values(&of(Vec::new()), &[("insta_order_r", 0.0), ("insta_order_p", 1.0), ("insta_order_f1", 0.0)]);
    // A single object has no order, and its image is not part of any mean.
    let lone = || vec![seen(rect([13, 5], [1, 3], [1, 3]))];
    let pairs = [ImagePair::new(lone(), lone()), ImagePair::new(row([true, true]), row([true, false]))]
        .map(|it| it.expect("one"));
    assert_values(&values(&pairs, &["insta_order"]), &[("insta_order_f1", 0.5)]);
    assert_eq!(values(&pairs[..1], &["insta_order", "deocclusion"]).values().flatten().count(), 0);
}

#[test]
fn panoptic_quality_and_mean_iou() {
    let size = [20, 10];
    let labels =
        vec![seen(rect(size, [0, 3], [0, 3])), seen(rect(size, [6, 9], [0, 3])), seen(rect(size, [12, 15], [0, 3]))];
    let predictions = vec![
        seen(rect(size, [0, 3], [0, 2])),   // IoU 12 / 16
        seen(rect(size, [6, 9], [0, 1])),   // IoU 8 / 16: not above one half
        seen(rect(size, [16, 18], [6, 9])), // of nothing, half of it in a crowd
    ];
    let of = |crowds: Vec<Mask>| {
        let crowds = crowds.into_iter().map(|mask| Crowd { mask, category: 1 }).collect();
        let pair = ImagePair::new(labels.clone(), predictions.clone()).and_then(|pair| pair.with(Vec::new(), crowds));
        values(&[pair.expect("one size")], &["panoptic", "miou"])
    };
    let half = of(vec![rect(size, [16, 18], [6, 7])]);
    assert_values(&half, &[("pq", 0.75 / 3.0), ("sq", 0.75), ("rq", 1.0 / 3.0)]);
    // The pairs share 12 + 8 pixels; the third pair shares none.
    assert_values(&half, &[("amodal_miou", 20.0 / (16.0 + 16.0 + 28.0)), ("visible_miou", 20.0 / 60.0)]);
    assert_values(&of(vec![rect(size, [16, 18], [6, 8])]), &[("pq", 0.75 / 2.5), ("rq", 1.0 / 2.5)]);
    let lone = |labels: &[MaskedObject], predictions: &[MaskedObject]| {
        values(&[ImagePair::new(labels.to_vec(), predictions.to_vec()).expect("one size")], &["panoptic", "miou"])
    };
    assert_values(&lone(&[], &[]), &[("amodal_miou", 1.0)]);
    assert_eq!(lone(&[], &[])["pq"], None);
    assert_values(&lone(&labels, &[]), &[("amodal_miou", 0.0), ("pq", 0.0)]);
}

#[test]
fn objects_by_rate_and_size() {
    let size = [200, 200];
    // Hidden fractions: zero, one half, nine tenths; areas 100, 1024 (both small) and 10,000.
    let amodal = [rect(size, [0, 9], [0, 9]), rect(size, [20, 51], [20, 51]), rect(size, [90, 189], [90, 189])];
    let visible = [amodal[0].clone(), rect(size, [20, 35], [20, 51]), rect(size, [90, 99], [90, 189])];
    let labels: Vec<MaskedObject> =
        amodal.iter().zip(&visible).map(|(a, v)| MaskedObject::labeled(a.clone(), v.clone())).collect();
    // The first is found, the second only in its upper half, and the last is missing.
    let half = rect(size, [20, 51], [20, 35]);
    let predictions = vec![labels[0].clone(), MaskedObject::labeled(half.clone(), half)];
    let found = values(&[ImagePair::new(labels, predictions).expect("one size")], &["strata"]);
    let third = 1.0 / 3.0;
    assert_values(
        &found,
        &[
            ("occluded_0_10_share", third),
            ("occluded_0_10_amodal_f", 1.0),
            ("occluded_50_60_share", third),
            ("occluded_50_60_amodal_f", 2.0 * third),
            ("occluded_50_60_visible_f", 0.5),
            ("occluded_50_60_amodal_f75", 0.0),
            ("occluded_90_100_amodal_f", 0.0),
            ("small_share", 2.0 * third),
            ("small_amodal_f", (1.0 + 2.0 * third) / 2.0),
            ("small_amodal_f75", 0.5),
            ("medium_share", 0.0),
            ("large_visible_f", 0.0),
        ],
    );
    assert_eq!((found["medium_amodal_f"], found["occluded_10_20_visible_f"]), (None, None));
}

/// Boundaries and the pixels near them, pixel by pixel from the definition.
#[test]
fn boundaries_of_random_masks() {
    let mut stream = Stream::root(5);
    for [width, height] in [[7, 5], [40, 70], [150, 64], [90, 129], [1500, 130], [1, 9], [9, 1]] {
        for _ in 0..4 {
            let masks = [0; 2].map(|_| {
                let [x, y] = [width, height].map(|edge| stream.integer(0, i64::from(edge) - 1) as u32);
                let [w, h] = [width, height].map(|edge| stream.integer(1, i64::from(edge)) as u32);
                let holes: Vec<bool> = (0..w * h).map(|_| stream.chance(0.9)).collect();
                Mask::from_fn(width, height, |u, v| {
                    (x..x + w).contains(&u) && (y..y + h).contains(&v) && holes[((v - y) * w + u - x) as usize]
                })
            });
            let maps = masks.each_ref().map(map_of);
            let boundaries = masks.each_ref().map(Boundary::of);
            for (map, boundary) in maps.iter().zip(&boundaries) {
                assert_eq!(&boundary.pixels(), map);
                assert_eq!((boundary.len(), boundary.is_empty()), (map.len(), map.is_empty()));
            }
            let reach = (radius(width, height) as f64).powi(2);
            let far = |a: &[usize; 2], b: &[usize; 2]| (0..2).map(|i| (a[i] as f64 - b[i] as f64).powi(2)).sum::<f64>();
            let near = maps[0].iter().filter(|a| maps[1].iter().any(|b| far(a, b) <= reach)).count();
            assert_eq!(boundaries[0].near(&boundaries[1]), near, "{width} × {height}");
        }
    }
}

fn map_of(mask: &Mask) -> Vec<[usize; 2]> {
    let plane = mask.to_plane();
    let [width, height] = [mask.width(), mask.height()];
    let differs = |x: u32, y: u32, dx: u32, dy: u32| {
        x + dx < width && y + dy < height && plane.at(x, y) != plane.at(x + dx, y + dy)
    };
    let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let on = all.filter(|&(x, y)| [(1, 0), (0, 1), (1, 1)].into_iter().any(|(dx, dy)| differs(x, y, dx, dy)));
    on.map(|(x, y)| [x as usize, y as usize]).collect()
}

/// Workers that run one after another, starting from either end.
struct InTurn(bool);

impl Workers for InTurn {
    fn threads(&self) -> usize {
        1
    }

    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..jobs).for_each(|index| job(if self.0 { jobs - 1 - index } else { index }));
    }
}

#[test]
fn intervals_match_theory() {
    let size = [40, 40];
    let mut stream = Stream::root(11);
    let pairs: Vec<ImagePair> = (0..400)
        .map(|_| {
            let rows = stream.integer(0, 39) as u32;
            ImagePair::new(vec![seen(rect(size, [0, 39], [0, 39]))], vec![seen(rect(size, [0, 39], [0, rows]))])
                .expect("one size")
        })
        .collect();
    let measures = Measures::named(&["amodal".into()], &[], Convention::Release).expect("metrics");
    let tallies: Vec<Tally> = pairs.iter().map(|pair| measures.tally(pair)).collect();
    let images: Vec<&Tally> = tallies.iter().collect();
    let of = |seed, is_turned| bootstrap::intervals(&measures, &images, 2000, seed, &InTurn(is_turned));
    let recalls: Vec<f64> = images.iter().filter_map(|image| measures.values(&[image])[1]).collect();
    let mean = recalls.iter().sum::<f64>() / recalls.len() as f64;
    let variance = recalls.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / recalls.len() as f64;
    let half = 1.959964 * (variance / recalls.len() as f64).sqrt();
    assert_eq!(measures.names()[1], "amodal_overlap_r");
    let [low, high] = of(3, false)[1].expect("an interval");
    assert!(
        (mean - half - low).abs() < 0.1 * half && (mean + half - high).abs() < 0.1 * half,
        "{low} {high} {mean} {half}"
    );
    // The order of work does not matter, but the seed does.
    assert_eq!(of(3, false), of(3, true));
    assert_ne!(of(3, false), of(4, false));
    // All precisions are 1.
    assert_eq!(of(3, false)[0], Some([1.0; 2]));
}

/// Number of predictions per object: a metric from another crate.
struct Surplus;

impl Measure for Surplus {
    type Tally = [usize; 2];

    fn names(&self) -> Vec<String> {
        vec!["surplus".into()]
    }

    fn tally(&self, pair: &ImagePair) -> [usize; 2] {
        [pair.predictions.len(), pair.labels.len()]
    }

    fn values(&self, images: &[&[usize; 2]]) -> Vec<Option<f64>> {
        let [predictions, labels] = [0, 1].map(|of| images.iter().map(|tally| tally[of]).sum::<usize>());
        vec![(labels > 0).then(|| predictions as f64 / labels as f64)]
    }
}

register_metric!(Metric {
    name: "surplus",
    doc: "Predictions by labels.",
    build: |_| Measurement::of(Surplus),
    crate_name: env!("CARGO_PKG_NAME"),
});

#[test]
fn a_crate_adds_a_metric() {
    let mask = seen(rect([8, 6], [1, 3], [1, 3]));
    let pair = ImagePair::new(vec![mask.clone(), mask.clone()], vec![mask]).expect("one size");
    assert_eq!(values(&[pair], &["surplus"]), BTreeMap::from([("surplus".to_owned(), Some(0.5))]));
    assert!(linked(&[]).expect("names differ").iter().any(|metric| metric.name() == "surplus"));
    let error = Measures::named(&["mask_ap".into()], &[], Convention::Release).err().expect("unknown").to_string();
    assert!(error.contains("`mask_ap`") && error.contains("surplus"), "{error}");
}
