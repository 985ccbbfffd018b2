//! Results of the reference code for small images.

use std::collections::BTreeMap;
use syntable_evaluate::Convention;
use syntable_evaluate::boundary::{Boundary, radius};
use syntable_evaluate::image::ImagePair;
use syntable_evaluate::masked_object::MaskedObject;
use syntable_evaluate::matching::assign;
use syntable_evaluate::measure::{Measures, Tally};
use syntable_model::product::Mask;

/// A mask of inclusive ranges of columns and rows.
fn rect([width, height]: [u32; 2], [x0, x1]: [u32; 2], [y0, y1]: [u32; 2]) -> Mask {
    Mask::from_fn(width, height, |x, y| (x0..=x1).contains(&x) && (y0..=y1).contains(&y))
}

fn values(pairs: &[ImagePair]) -> BTreeMap<String, f64> {
    let measures = Measures::named(&[], &[], Convention::Release).expect("metrics");
    let tallies: Vec<Tally> = pairs.iter().map(|pair| measures.tally(pair)).collect();
    let values = measures.values(&tallies.iter().collect::<Vec<_>>());
    measures.names().into_iter().zip(values).filter_map(|(name, value)| Some((name, value?))).collect()
}

fn check(found: &BTreeMap<String, f64>, wanted: &[(&str, f64)]) {
    for (name, value) in wanted {
        assert!((found[*name] - value).abs() < 5e-7, "{name} is {}, not {value}", found[*name]);
    }
}

fn whole(mask: Mask, of: fn(Mask, Mask) -> MaskedObject) -> MaskedObject {
    of(mask.clone(), mask)
}

fn second() -> ImagePair {
    let size = [10, 6];
    let [a1, a2, a3] = [rect(size, [1, 4], [1, 4]), rect(size, [3, 8], [1, 3]), rect(size, [7, 8], [4, 5])];
    let labels = vec![
        whole(a1.clone(), MaskedObject::labeled),
        MaskedObject::labeled(a2.clone(), a2.minus(&a1)),
        whole(a3, MaskedObject::labeled),
    ];
    let [p1, p2] = [rect(size, [1, 4], [1, 3]), rect(size, [4, 8], [1, 3])];
    let predictions =
        vec![whole(p1.clone(), MaskedObject::predicted), MaskedObject::predicted(p2.clone(), p2.minus(&p1))];
    ImagePair::new(labels, predictions).expect("one size")
}

#[test]
fn label_maps() {
    let size = [12, 8];
    let labels = [rect(size, [1, 3], [1, 4]), rect(size, [6, 9], [2, 5])];
    let predictions = [rect(size, [2, 4], [1, 4]), rect(size, [6, 9], [2, 4]), rect(size, [9, 11], [6, 7])];
    let lines = |masks: &[Mask]| masks.iter().map(|mask| Boundary::of(mask).len()).collect::<Vec<_>>();
    assert_eq!((lines(&labels), lines(&predictions)), (vec![14, 16], vec![14, 14, 6]));
    let near = |i: usize, j: usize| {
        let (a, b) = (Boundary::of(&labels[i]), Boundary::of(&predictions[j]));
        [b.near(&a), a.near(&b)]
    };
    assert_eq!([near(0, 0), near(1, 1), near(1, 0), near(1, 2)], [[14, 14], [14, 16], [4, 4], [4, 4]]);
    let pair = ImagePair::new(
        labels.into_iter().map(|mask| whole(mask, MaskedObject::labeled)).collect(),
        predictions.into_iter().map(|mask| whole(mask, MaskedObject::predicted)).collect(),
    );
    check(
        &values(&[pair.expect("one size")]),
        &[
            ("visible_overlap_p", 0.666667),
            ("visible_overlap_r", 0.714286),
            ("visible_overlap_f", 0.689655),
            ("visible_boundary_p", 0.823529),
            ("visible_boundary_r", 1.0),
            ("visible_boundary_f", 0.903226),
            ("visible_f75", 0.5),
            // 8 of 16 and 12 of 16 pixels.
            ("visible_miou", 0.625),
        ],
    );
}

#[test]
fn stacks_of_amodal_masks() {
    check(
        &values(&[second()]),
        &[
            ("amodal_overlap_p", 1.0),
            ("amodal_overlap_r", 0.710526),
            ("amodal_overlap_f", 0.830769),
            ("amodal_boundary_p", 1.0),
            ("amodal_boundary_r", 0.829268),
            ("amodal_boundary_f", 0.906667),
            ("amodal_f75", 0.666667),
            ("acc_o", 1.0),
            ("f_o", 0.8),
            ("invisible_overlap_p", 1.0),
            ("invisible_overlap_r", 0.5),
            ("invisible_overlap_f", 0.666667),
            ("invisible_boundary_p", 1.0),
            ("invisible_boundary_r", 1.0),
            ("invisible_f75", 0.0),
            ("visible_overlap_p", 1.0),
            ("visible_overlap_r", 0.75),
            ("visible_overlap_f", 0.857143),
            ("visible_boundary_p", 1.0),
            ("visible_boundary_r", 0.810811),
            ("visible_boundary_f", 0.895522),
            ("visible_f75", 0.666667),
        ],
    );
}

#[test]
fn means_over_images() {
    let lone = whole(rect([10, 6], [1, 4], [1, 3]), MaskedObject::labeled);
    let pairs = [second(), ImagePair::new(vec![lone], Vec::new()).expect("one size")];
    check(
        &values(&pairs),
        &[
            ("amodal_overlap_p", 1.0),
            ("amodal_overlap_r", 0.355263),
            ("amodal_overlap_f", 0.415385),
            ("amodal_boundary_r", 0.414634),
            ("amodal_boundary_f", 0.453333),
            ("amodal_f75", 0.333333),
            ("acc_o", 1.0),
            ("f_o", 0.666667),
        ],
    );
}

#[test]
fn occlusion_order() {
    let size = [13, 5];
    let [a1, a2, a3] = [rect(size, [1, 3], [1, 3]), rect(size, [3, 6], [1, 3]), rect(size, [6, 9], [3, 4])];
    let all = |of: fn(Mask, Mask) -> MaskedObject| {
        [of(a1.clone(), a1.clone()), of(a2.clone(), a2.minus(&a1)), of(a3.clone(), a3.minus(&a2))]
    };
    let labels = all(MaskedObject::labeled);
    let perfect = all(MaskedObject::predicted);
    let mut swapped = perfect.clone();
    swapped[0] = MaskedObject::predicted(a1.clone(), a1.minus(&a2));
    swapped[1] = MaskedObject::predicted(a2.clone(), a2.clone());
    let of = |predictions: &[MaskedObject]| {
        values(&[ImagePair::new(labels.to_vec(), predictions.to_vec()).expect("one size")])
    };
    check(&of(&perfect), &[("acc_oo", 1.0), ("acc_oo_release", 0.666667), ("edge_p", 1.0), ("edge_f1", 1.0)]);
    check(&of(&perfect[..2]), &[("acc_oo", 0.333333), ("acc_oo_release", 0.333333), ("edge_r", 0.5)]);
    check(&of(&swapped), &[("acc_oo", 0.666667), ("acc_oo_release", 0.5)]);
    // A predictor without occlusion is right about two thirds of the pairs, and finds no edge.
    let never = [&a1, &a2, &a3].map(|mask| whole(mask.clone(), MaskedObject::predicted));
    check(&of(&never), &[("acc_oo", 0.666667), ("edge_r", 0.0), ("edge_f1", 0.0)]);
}

#[test]
fn boundaries_at_the_edges_of_the_image() {
    let of = |x, y| Boundary::of(&rect([8, 6], x, y)).pixels();
    assert_eq!(of([0, 1], [0, 1]), [[1, 0], [0, 1], [1, 1]]);
    assert_eq!(of([6, 7], [4, 5]), [[5, 3], [6, 3], [7, 3], [5, 4], [5, 5]]);
    assert_eq!(of([3, 3], [2, 2]), [[2, 1], [3, 1], [2, 2], [3, 2]]);
    assert_eq!(of([0, 7], [0, 5]), [[0_usize; 2]; 0]);
    let sizes = [[640, 480], [1280, 720], [1920, 1080], [320, 240], [12, 8]];
    assert_eq!(sizes.map(|[width, height]| radius(width, height)), [3, 5, 7, 2, 1]);
}

#[test]
fn assignments_are_the_best_and_of_those_the_lowest() {
    assert_eq!(assign(&[vec![0.0; 3], vec![0.0; 3]], 3), [(0, 0), (1, 1)]);
    assert_eq!(assign(&[vec![0.5, 0.5], vec![0.5, 0.0]], 2), [(0, 1), (1, 0)]);
    assert_eq!(assign(&[vec![0.0], vec![0.0], vec![0.2]], 1), [(2, 0)]);
    let mut stream = syntable_model::random::Stream::root(4);
    for _ in 0..300 {
        let [rows, columns] = [0; 2].map(|_| stream.integer(0, 4) as usize);
        let scores: Vec<Vec<f64>> =
            (0..rows).map(|_| (0..columns).map(|_| stream.integer(0, 3) as f64 / 4.0).collect()).collect();
        assert_eq!(assign(&scores, columns), by_trial(&scores, columns), "{scores:?}");
    }
}

/// The best of all assignments, by trying them in lexicographic order.
fn by_trial(scores: &[Vec<f64>], columns: usize) -> Vec<(usize, usize)> {
    fn go(
        scores: &[Vec<f64>],
        columns: usize,
        row: usize,
        taken: &mut Vec<(usize, usize)>,
        best: &mut (f64, Vec<(usize, usize)>),
    ) {
        if row == scores.len() {
            let sum = taken.iter().map(|&(i, j)| scores[i][j]).sum();
            if taken.len() == columns.min(scores.len()) && sum > best.0 {
                *best = (sum, taken.clone());
            }
            return;
        }
        for column in 0..columns {
            if taken.iter().all(|it| it.1 != column) {
                taken.push((row, column));
                go(scores, columns, row + 1, taken, best);
                taken.pop();
            }
        }
        go(scores, columns, row + 1, taken, best);
    }
    let mut best = (-1.0, Vec::new());
    go(scores, columns, 0, &mut Vec::new(), &mut best);
    best.1
}

#[test]
fn nothing_labeled_predicted_or_to_be_seen() {
    let some = |of: fn(Mask, Mask) -> MaskedObject| vec![whole(rect([8, 6], [1, 3], [1, 3]), of)];
    let all = |of: fn(Mask, Mask) -> MaskedObject| vec![whole(rect([8, 6], [0, 7], [0, 5]), of)];
    let (labeled, predicted) = (MaskedObject::labeled, MaskedObject::predicted);
    for (labels, predictions, [p, r, f]) in [
        (vec![], vec![], [1.0, 1.0, 1.0]),
        (some(labeled), vec![], [1.0, 0.0, 0.0]),
        (vec![], some(predicted), [0.0, 1.0, 0.0]),
        // Without any boundary, the reference returns NaN.
        (all(labeled), all(predicted), [1.0, 1.0, 1.0]),
    ] {
        let found = values(&[ImagePair::new(labels, predictions).expect("one size")]);
        for kind in ["amodal", "visible"] {
            for measure in ["overlap", "boundary"] {
                let of = |score: &str| found[format!("{kind}_{measure}_{score}").as_str()];
                assert_eq!([of("p"), of("r"), of("f")], [p, r, f], "{kind} {measure}");
            }
            assert_eq!(found[format!("{kind}_f75").as_str()], f);
        }
        // No object is occluded, and no prediction is.
        check(&found, &[("invisible_overlap_f", 1.0), ("invisible_f75", 1.0)]);
        assert!(!found.contains_key("acc_oo"));
    }
}

#[test]
fn later_predictions_are_painted_over_earlier_ones() {
    let size = [10, 4];
    let of = |masks: &[[u32; 2]], make: fn(Mask, Mask) -> MaskedObject| -> Vec<MaskedObject> {
        masks.iter().map(|columns| whole(rect(size, *columns, [0, 3]), make)).collect()
    };
    let labels = of(&[[0, 2], [3, 8]], MaskedObject::labeled);
    // The last but one disappears below the last.
    let predictions = of(&[[0, 5], [4, 7], [3, 8]], MaskedObject::predicted);
    let found = values(&[ImagePair::new(labels, predictions).expect("one size")]);
    check(&found, &[("visible_overlap_p", 1.0), ("visible_overlap_r", 1.0), ("visible_f75", 1.0)]);
    check(&found, &[("amodal_overlap_p", 9.0 / 16.0)]);
}

#[test]
fn masks_of_another_size_are_refused() {
    let [small, large] = [[8, 6], [8, 7]].map(|size| vec![whole(rect(size, [1, 2], [1, 2]), MaskedObject::predicted)]);
    let error = ImagePair::new(small, large).expect_err("two sizes").to_string();
    assert!(error.contains("8 × 7") && error.contains("8 × 6"), "{error}");
}
