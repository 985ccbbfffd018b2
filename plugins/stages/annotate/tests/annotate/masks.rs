//! Labels compared with sets of pixels, and the occlusion order compared with the paper's procedure.

use crate::common::{Rays, World, annotator};
use proptest::prelude::*;
use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::Value;
use syntable_model::product::standard::*;

type Pixels = Vec<(i32, i32)>;

fn pixels(mask: &Mask) -> Pixels {
    let plane = mask.to_plane();
    let (width, height) = (mask.width() as i32, mask.height() as i32);
    let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    all.filter(|&(x, y)| *plane.at(x as u32, y as u32)).collect()
}

fn annotate(rays: &Rays, options: &str) -> Result<Products> {
    let world = World::new(rays.objects);
    let mut products = Products::new();
    let annotator = annotator("masks", options);
    for key in annotator.reads() {
        if key == INSTANCE.id() {
            products.put(INSTANCE, rays.instance())?;
        } else {
            let framed = [COVERAGE, COVERAGE_BEFORE_SUPPORT].map(|own| own.framed(key.framing));
            let own = framed.into_iter().find(|own| own.id() == key).unwrap_or_else(|| panic!("{key} is read"));
            products.put(own, rays.coverage(own))?;
        }
    }
    annotator.annotate(&world.of_view(), &mut products)?;
    Ok(products)
}

/// Expected results of the annotator, by counting pixels.
struct Truth {
    visible: BTreeMap<u16, Pixels>,
    amodal: BTreeMap<u16, Pixels>,
    rate: BTreeMap<u16, f64>,
}

fn truth(rays: &Rays, extend: bool, clip_support: bool, min_visible: usize, max_rate: f64) -> Truth {
    let mut truth = Truth { visible: BTreeMap::new(), amodal: BTreeMap::new(), rate: BTreeMap::new() };
    let image: Pixels = (0..rays.height).flat_map(|y| (0..rays.width).map(move |x| (x, y))).collect();
    let [mx, my] = rays.margin;
    for id in 1..=rays.objects as u16 {
        let select =
            |f: &dyn Fn(i32, i32) -> bool| -> Pixels { image.iter().copied().filter(|&(x, y)| f(x, y)).collect() };
        let visible = select(&|x, y| rays.at(x, y).first() == Some(&id));
        let amodal = select(&|x, y| rays.cover(x, y, clip_support).contains(&id));
        let mut whole = amodal.len();
        if extend {
            whole = (-my..rays.height + my)
                .flat_map(|y| (-mx..rays.width + mx).map(move |x| (x, y)))
                .filter(|&(x, y)| rays.cover(x, y, clip_support).contains(&id))
                .count();
        }
        let rate = 1.0 - visible.len() as f64 / whole.max(1) as f64;
        if !amodal.is_empty() && visible.len() >= min_visible && rate <= max_rate {
            truth.visible.insert(id, visible);
            truth.amodal.insert(id, amodal);
            truth.rate.insert(id, rate);
        }
    }
    truth
}

fn check(rays: &Rays, options: &str, truth: &Truth) {
    let products = annotate(rays, options).expect("labels");
    let sets = |key: Key<PerInstance<Mask>>| -> BTreeMap<u16, Pixels> {
        products.get(key).expect("made").iter().map(|(id, mask)| (id.0, pixels(mask))).collect()
    };
    let (visible, amodal, occlusion) = (sets(VISIBLE_MASK), sets(AMODAL_MASK), sets(OCCLUSION_MASK));
    assert_eq!(visible, truth.visible, "visible, {options}");
    assert_eq!(amodal, truth.amodal, "amodal, {options}");
    let minus: BTreeMap<u16, Pixels> = truth
        .amodal
        .iter()
        .map(|(id, amodal)| (*id, amodal.iter().copied().filter(|p| !truth.visible[id].contains(p)).collect()))
        .collect();
    assert_eq!(occlusion, minus, "occlusion, {options}");
    let rates = products.get(OCCLUSION_RATE).expect("made");
    assert_eq!(rates.iter().map(|(id, _)| id.0).collect::<Vec<_>>(), truth.rate.keys().copied().collect::<Vec<_>>());
    for (id, rate) in rates.iter() {
        assert!((rate - truth.rate[&id.0]).abs() < 1e-12, "rate of {id}: {rate}, not {}", truth.rate[&id.0]);
    }
    // The paper's Algorithm 1: i occludes j iff the visible mask of i meets the occlusion mask of j.
    let order = products.get(OCCLUSION_ORDER).expect("made");
    let ids: Vec<u16> = order.ids().iter().map(|id| id.0).collect();
    assert_eq!(ids, truth.visible.keys().copied().collect::<Vec<_>>());
    for (row, i) in ids.iter().enumerate() {
        for (column, j) in ids.iter().enumerate() {
            let meets = i != j && visible[i].iter().any(|p| occlusion[j].contains(p));
            assert_eq!(order.occludes(row, column), meets, "{i} occludes {j}, {options}");
        }
    }
}

fn check_all_policies(rays: &Rays) {
    for (extend, frame) in [(false, "clip"), (true, "extend")] {
        for (clip, support) in [(false, "occlude"), (true, "clip")] {
            for min_visible in [0, 1] {
                let options = format!(
                    "image_frame = \"{frame}\"\ntable_and_room = \"{support}\"\nmin_visible_px = {min_visible}"
                );
                check(rays, &options, &truth(rays, extend, clip, min_visible, 1.0));
            }
        }
    }
}

#[test]
fn three_rectangles_in_a_row() {
    // Specification 4.12, vector 3: 1 in front of 2 in front of 3.
    let inside = |x: i32, y: i32, [x0, x1, y0, y1]: [i32; 4]| (x0..=x1).contains(&x) && (y0..=y1).contains(&y);
    let boxes = [[1, 3, 1, 3], [3, 6, 1, 3], [6, 9, 3, 4]];
    let rays =
        Rays::new([13, 5], [13, 5], 3, |x, y| (1..=3).filter(|&id| inside(x, y, boxes[usize::from(id) - 1])).collect());
    check_all_policies(&rays);
    let products = annotate(&rays, "").expect("labels");
    let areas = |key: Key<PerInstance<Mask>>| {
        products.get(key).expect("made").iter().map(|(_, mask)| mask.area()).collect::<Vec<_>>()
    };
    assert_eq!(areas(AMODAL_MASK), [9, 12, 8]);
    assert_eq!(areas(VISIBLE_MASK), [9, 9, 7]);
    assert_eq!(areas(OCCLUSION_MASK), [0, 3, 1]);
    let order = products.get(OCCLUSION_ORDER).expect("made").matrix().to_vec();
    assert_eq!(order.iter().map(|&bit| u8::from(bit)).collect::<Vec<_>>(), [0, 1, 0, 0, 0, 1, 0, 0, 0]);
    let rates = products.get(OCCLUSION_RATE).expect("made").0.values().copied().collect::<Vec<_>>();
    assert_eq!(rates, [0.0, 0.25, 0.125]);
}

#[test]
fn objects_may_occlude_each_other() {
    // Left half: 1 in front; right half: 2 in front.
    let rays = Rays::new([4, 3], [4, 3], 2, |x, _| if x < 2 { vec![1, 2] } else { vec![2, 1] });
    let order = annotate(&rays, "").expect("labels");
    let order = order.get(OCCLUSION_ORDER).expect("made");
    assert!(order.occludes(0, 1) && order.occludes(1, 0) && !order.occludes(0, 0) && !order.occludes(1, 1));
    check_all_policies(&rays);
}

#[test]
fn table_in_front() {
    // The table (id 2) hides the right half of object 1; the scene has no other body.
    let rays = Rays::new([4, 3], [4, 3], 1, |x, y| match (x, y) {
        (0..2, 0..3) => vec![1, 2],
        (2..4, 0..3) => vec![2, 1],
        _ => vec![2],
    });
    check_all_policies(&rays);
    let rate = |options: &str| annotate(&rays, options).expect("labels").get(OCCLUSION_RATE).expect("made").clone();
    assert_eq!(rate("").0.values().copied().collect::<Vec<_>>(), [0.5]);
    assert_eq!(rate("table_and_room = \"clip\"").0.values().copied().collect::<Vec<_>>(), [0.0]);
}

#[test]
fn objects_at_the_border() {
    // Object 1 extends to the left of the image by three times its visible part; object 2 is completely outside.
    let rays = Rays::new([4, 3], [4, 3], 2, |x, y| match (x, y) {
        (-3..1, 1) => vec![1],
        (-4..-3, 1) => vec![2],
        _ => vec![],
    });
    check_all_policies(&rays);
    let rate = |options: &str| annotate(&rays, options).expect("labels").get(OCCLUSION_RATE).expect("made").clone();
    assert_eq!(rate("").0.into_iter().collect::<Vec<_>>(), [(InstanceId(1), 0.0)]);
    assert_eq!(rate("image_frame = \"extend\"").0.into_iter().collect::<Vec<_>>(), [(InstanceId(1), 0.75)]);
}

#[test]
fn hidden_objects_are_kept_or_left_out() {
    // 2 lies behind 1, 3 is nearly hidden (1 of 4 pixels visible), the table hides 4.
    let rays = Rays::new([4, 4], [0, 0], 4, |x, y| match (x, y) {
        (0, _) => vec![1, 2],
        (1, 0) => vec![3],
        (1, _) => vec![1, 3],
        (2, _) => vec![5, 4],
        _ => vec![],
    });
    for (options, min_visible, max_rate, want) in [
        ("min_visible_px = 0", 0, 1.0, vec![1, 2, 3, 4]),
        ("", 1, 1.0, vec![1, 3]),
        ("min_visible_px = 1", 1, 1.0, vec![1, 3]),
        ("min_visible_px = 2", 2, 1.0, vec![1]),
        ("min_visible_px = 0\nmax_occlusion_rate = 0.995", 0, 0.995, vec![1, 3]),
        ("max_occlusion_rate = 0.75", 0, 0.75, vec![1, 3]),
        ("max_occlusion_rate = 0.7", 0, 0.7, vec![1]),
    ] {
        let truth = truth(&rays, false, false, min_visible, max_rate);
        assert_eq!(truth.visible.keys().copied().collect::<Vec<u16>>(), want, "{options}");
        check(&rays, options, &truth);
    }
    // All objects are hidden: the table is in front of everything.
    let hidden = Rays::new([3, 3], [0, 0], 2, |_, _| vec![3, 1, 2]);
    check(&hidden, "min_visible_px = 0", &truth(&hidden, false, false, 0, 1.0));
    let products = annotate(&hidden, "min_visible_px = 0").expect("labels");
    assert_eq!(products.get(OCCLUSION_RATE).expect("made").0.values().copied().collect::<Vec<_>>(), [1.0, 1.0]);
    assert!(!products.get(OCCLUSION_ORDER).expect("made").matrix().contains(&true));
}

#[test]
fn an_empty_image_has_no_annotation() {
    let rays = Rays::new([5, 4], [5, 4], 2, |_, _| vec![3]);
    check_all_policies(&rays);
    let products = annotate(&rays, "").expect("labels");
    assert!(products.get(AMODAL_MASK).expect("made").0.is_empty());
    assert!(products.get(OCCLUSION_ORDER).expect("made").ids().is_empty());
}

#[test]
fn any_number_of_objects() {
    for (seed, objects) in [1, 63, 64, 65, 128, 130].into_iter().enumerate() {
        check_all_policies(&Rays::random([11, 7], objects, seed as u64));
    }
}

#[test]
fn no_object_at_all() {
    // A scene always has an object, but the kernel need not have one.
    let first = syntable_model::product::Plane::from_fn(3, 2, |_, _| InstanceId(1));
    let coverage = syntable_model::product::BitPlane::new(3, 2, 0);
    assert!(syntable_annotate::masks::sweep(&first, &coverage).expect("labels").objects.is_empty());
}

#[test]
fn planes_that_disagree_are_refused() {
    let rays = Rays::new([4, 3], [0, 0], 2, |_, _| vec![1]);
    let world = World::new(2);
    let labels = |change: &dyn Fn(&mut Products)| {
        let mut products = Products::new();
        change(&mut products);
        annotator("masks", "").annotate(&world.of_view(), &mut products).expect_err("refused").to_string()
    };
    let wrong = labels(&|products| {
        products.put(INSTANCE, rays.instance().map(|_| InstanceId(2))).expect("first");
        products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    });
    assert!(wrong.starts_with("instance 2 is visible at pixel (0, 0) but not in the coverage plane"), "{wrong}");
    let wrong = labels(&|products| {
        products.put(INSTANCE, rays.instance()).expect("first");
        products.put(COVERAGE, Rays::new([4, 2], [0, 0], 2, |_, _| vec![1]).coverage(COVERAGE)).expect("first");
    });
    assert_eq!(wrong, "the coverage plane is 4 × 2, the instance plane 4 × 3");
    let wrong = labels(&|products| {
        products.put(INSTANCE, rays.instance()).expect("first");
        products.put(COVERAGE, Rays::new([4, 3], [0, 0], 3, |_, _| vec![1]).coverage(COVERAGE)).expect("first");
    });
    assert_eq!(wrong, "the coverage plane has 3 objects, the scene 2");
}

/// Masks that overlap, as in COCO: each pixel belongs to the smallest one, and the log reports what the others lose.
#[test]
fn of_overlapping_masks_the_smallest_is_on_top() {
    let size = [23, 17];
    let mut sums = [0; 2];
    for seed in 0..20 {
        let mut stream = Stream::root(seed);
        let count = stream.integer(1, 12) as u16;
        let masks: BTreeMap<u16, Mask> = (1..=count)
            .map(|id| {
                let [x, y] = [4 * stream.below(3) as u32, 4 * stream.below(3) as u32];
                let edge = [0, 1, 3, 3, 8, 16][stream.below(6) as usize];
                (id, Mask::from_fn(23, 17, |u, v| (x..x + edge).contains(&u) && (y..y + edge).contains(&v)))
            })
            .collect();
        let mut products = Products::new();
        products
            .put(VISIBLE_MASK, masks.iter().map(|(id, mask)| (InstanceId(*id), mask.clone())).collect())
            .expect("new");
        let mut world = World::new(1);
        (world.view.camera.intrinsics.width, world.view.camera.intrinsics.height) = size.into();
        annotator("label_arrays", "").annotate(&world.of_view(), &mut products).expect("arrays");
        let ids = products.get(VISIBLE_IDS).expect("made");
        let mut seen: BTreeMap<u16, u32> = BTreeMap::new();
        for (x, y) in (0..17).flat_map(|y| (0..23).map(move |x| (x, y))) {
            let at = (x * 17 + y) as u32;
            let there = masks.iter().filter(|(_, mask)| mask.runs().any(|run| run.contains(&at)));
            let on_top = there.map(|(id, mask)| (mask.area(), *id)).min().map_or(0, |it| it.1);
            assert_eq!(ids.at(x as u32, y as u32).0, on_top, "seed {seed}: ({x}, {y})");
            *seen.entry(on_top).or_default() += 1;
        }
        let pixels: Vec<[u32; 2]> = masks
            .iter()
            .map(|(id, mask)| [mask.area(), seen.get(id).copied().unwrap_or(0)])
            .filter(|it| it[0] > 0)
            .collect();
        let some = pixels.iter().filter(|[mask, left]| left < mask).count();
        let all = pixels.iter().filter(|[_, left]| *left == 0).count();
        let said: Vec<String> = world.log.warnings().iter().map(ToString::to_string).collect();
        let want = [(some, "objects lost pixels"), (all, "objects lost all of their pixels")];
        let want = want.iter().filter(|it| it.0 > 0).map(|(count, what)| format!("{count} of {} {what}", pixels.len()));
        let want: Vec<String> = want.collect();
        assert!(
            said.len() == want.len() && said.iter().zip(&want).all(|(said, want)| said.starts_with(want)),
            "{said:?}"
        );
        sums = [sums[0] + some, sums[1] + all];
    }
    assert!(sums[0] > sums[1] && sums[1] > 3, "{sums:?}");
}

/// The planes for training loops, pixel by pixel from the rays.
#[test]
fn label_arrays_match_the_rays() {
    let mut counts = Vec::new();
    for (objects, min_visible, classes) in
        [(1, 9999, vec![]), (8, 2, vec!["a", "solid"]), (9, 2, vec!["solid"]), (70, 1, vec!["b"])]
    {
        let rays = Rays::random([19, 14], objects, objects as u64);
        let mut products = annotate(&rays, &format!("min_visible_px = {min_visible}")).expect("labels");
        let mut world = World::new(objects);
        (world.view.camera.intrinsics.width, world.view.camera.intrinsics.height) = (19, 14);
        world.dataset.classes = classes.iter().map(|&class| class.to_owned()).collect();
        annotator("label_arrays", "").annotate(&world.of_view(), &mut products).expect("arrays");
        annotator("identity", "").annotate(&world.of_view(), &mut products).expect("categories");
        let truth = truth(&rays, false, false, min_visible, 1.0);
        let annotated: Vec<u16> = truth.amodal.keys().copied().collect();
        assert_eq!(objects > 1, !annotated.is_empty());
        counts.push(annotated.len());
        let ids = products.get(VISIBLE_IDS).expect("made");
        let Value::Tensor(bits) = products.value("amodal_bits").expect("made") else { panic!("an array") };
        assert_eq!(bits.shape, [annotated.len(), 14, 3]);
        for (x, y) in (0..14).flat_map(|y| (0..24).map(move |x| (x, y))) {
            let cover = if x < 19 { rays.cover(x, y, false) } else { vec![] };
            for (k, id) in annotated.iter().enumerate() {
                let byte = bits.bytes[(k * 14 + y as usize) * 3 + x as usize / 8];
                assert_eq!(byte >> (7 - x % 8) & 1 == 1, cover.contains(id), "bit {k} of ({x}, {y})");
            }
            if x < 19 {
                let first = rays.at(x, y).first().copied().filter(|id| annotated.contains(id)).unwrap_or(0);
                assert_eq!(ids.at(x as u32, y as u32).0, first, "({x}, {y})");
            }
        }
        let id = classes.iter().position(|&class| class == "solid").map_or(1, |at| at as u32 + 2);
        let categories = products.get(CATEGORY_ID).expect("made");
        assert_eq!(
            categories.iter().map(|(of, id)| (of.0, *id)).collect::<Vec<_>>(),
            annotated.iter().map(|&of| (of, id)).collect::<Vec<_>>()
        );
    }
    assert!(counts.iter().sum::<usize>() > 9, "{counts:?}");
}

#[test]
fn only_what_is_needed_is_read() {
    let reads =
        |options: &str| annotator("masks", options).reads().iter().map(|key| key.to_string()).collect::<Vec<_>>();
    assert_eq!(reads(""), ["instance", "coverage"]);
    assert_eq!(reads("image_frame = \"extend\""), ["instance", "coverage", "coverage (canvas 3)"]);
    assert_eq!(
        reads("image_frame = \"extend\"\ntable_and_room = \"clip\""),
        ["instance", "coverage_before_support", "coverage_before_support (canvas 3)"]
    );
}

#[test]
fn the_policy_is_stated() {
    let rays = Rays::new([4, 3], [4, 3], 1, |_, _| vec![1]);
    let options = "image_frame = \"extend\"\ntable_and_room = \"clip\"\nmin_visible_px = 7\nmax_occlusion_rate = 0.995";
    let Value::Record(policy) = annotate(&rays, options).expect("labels").value("label_policy").expect("made") else {
        panic!("a record")
    };
    let policy: BTreeMap<_, _> = policy.into_iter().collect();
    assert_eq!(policy["image_frame"], "extend".into());
    assert_eq!(policy["table_and_room"], "clip".into());
    assert_eq!(policy["transparent"], "first".into());
    assert_eq!(policy["min_visible_px"], 7_i64.into());
    assert_eq!(policy["max_occlusion_rate"], 0.995.into());
    let Value::Text(statement) = &policy["statement"] else { panic!("text") };
    for part in [
        "the first one counts",
        "beyond every edge",
        "is not in its amodal mask",
        "fewer than 7 visible",
        "above 0.995",
    ] {
        assert!(statement.contains(part), "{part}: {statement}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn labels_match_the_pixels(width in 1_i32..20, height in 1_i32..20, objects in 1_usize..9, seed: u64) {
        check_all_policies(&Rays::random([width, height], objects, seed));
    }
}
