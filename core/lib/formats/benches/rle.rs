//! Masks of 640 × 480 pixels to COCO's run lengths and back: this crate against pycocotools, with the same masks on one
//! core, in turns.
//!
//! `cargo bench -p syntable-formats --bench rle`. Times are the minimum of the repeats, milliseconds per mask.
//! pycocotools reads and writes images column by column in batches of 20; "by rows" includes NumPy's `asfortranarray`
//! before it, as for images from NumPy or PIL. This crate works by rows. Needs Python with pycocotools.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_testing::figures::{Figures, Unit};

const SIZE: [u32; 2] = [640, 480];
const MASKS: usize = 20;
const REPEATS: usize = 15;
const ROUNDS: usize = 3;

/// Script of the peer: prints three times in ms, then the run lengths.
const PEER: &str = r#"
import sys, time
import numpy as np
from pycocotools import mask
path, width, height, number, repeats = sys.argv[1], *map(int, sys.argv[2:])
images = np.fromfile(path, np.uint8).reshape(number, height, width)
columns = np.asfortranarray(images.transpose(1, 2, 0))
rows = [np.ascontiguousarray(image) for image in images]
def least(call):
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times) / number
encoded = mask.encode(columns)
assert (mask.decode(encoded) == columns).all()
print(least(lambda: mask.encode(columns)),
      least(lambda: [mask.encode(np.asfortranarray(image)) for image in rows]),
      least(lambda: mask.decode(encoded)))
print(*(rle["counts"].decode() for rle in encoded), sep="\n")
"#;

/// Scalloped disks, each cut by the disks before it.
fn clutter() -> Vec<Plane<bool>> {
    let mut stream = Stream::root(1);
    let disks: Vec<[f64; 3]> = (0..MASKS)
        .map(|_| [stream.uniform(40.0, 600.0), stream.uniform(60.0, 440.0), stream.uniform(25.0, 90.0)])
        .collect();
    let covers = |x: u32, y: u32, [cx, cy, r]: [f64; 3]| {
        let (dx, dy) = (f64::from(x) - cx, f64::from(y) - cy);
        (dx * dx + dy * dy).sqrt() < r * (1.0 + 0.1 * (9.0 * dy.atan2(dx)).sin())
    };
    let front = |x, y| disks.iter().position(|&disk| covers(x, y, disk));
    (0..MASKS).map(|i| Plane::from_fn(SIZE[0], SIZE[1], |x, y| front(x, y) == Some(i))).collect()
}

/// Regions where a sum of waves is positive: large shapes with holes.
fn blobs() -> Vec<Plane<bool>> {
    let mut stream = Stream::root(2);
    let mut blob = || {
        let waves: Vec<[f64; 3]> = (0..12)
            .map(|_| [stream.uniform(-0.08, 0.08), stream.uniform(-0.08, 0.08), stream.uniform(0.0, 6.3)])
            .collect();
        let height = |x: f64, y: f64| waves.iter().map(|[a, b, phase]| (a * x + b * y + phase).sin()).sum::<f64>();
        Plane::from_fn(SIZE[0], SIZE[1], |x, y| height(x.into(), y.into()) > 0.5)
    };
    (0..MASKS).map(|_| blob()).collect()
}

/// Random pixels: about the largest possible number of runs.
fn noise() -> Vec<Plane<bool>> {
    let mut stream = Stream::root(3);
    (0..MASKS).map(|_| Plane::from_fn(SIZE[0], SIZE[1], |_, _| stream.chance(0.5))).collect()
}

/// Minimum time of a call, ms per mask.
fn least<T>(mut call: impl FnMut() -> T) -> f64 {
    let times = (0..REPEATS).map(|_| {
        let start = Instant::now();
        black_box(call());
        start.elapsed().as_secs_f64()
    });
    1e3 * times.fold(f64::INFINITY, f64::min) / MASKS as f64
}

fn ours(images: &[Plane<bool>]) -> ([f64; 2], Vec<String>) {
    let encode = || images.iter().map(|image| Mask::from_plane(image).to_coco()).collect::<Vec<_>>();
    let encoded = encode();
    let read = |text: &String| Mask::from_coco(SIZE[0], SIZE[1], text).expect("its own letters").to_plane();
    let decode = || encoded.iter().map(read).collect::<Vec<_>>();
    assert_eq!(decode(), images);
    ([least(encode), least(decode)], encoded)
}

fn theirs(file: &Path) -> Option<([f64; 3], Vec<String>)> {
    let numbers = [SIZE[0] as usize, SIZE[1] as usize, MASKS, REPEATS].map(|number| number.to_string());
    let output = Command::new("python3").args(["-c", PEER]).arg(file).args(numbers).output().ok()?;
    if !output.status.success() {
        eprintln!("{}", String::from_utf8_lossy(&output.stderr));
        return None;
    }
    let text = String::from_utf8(output.stdout).ok()?;
    let mut lines = text.lines();
    let times: Vec<f64> = lines.next()?.split(' ').filter_map(|time| time.parse().ok()).collect();
    Some((times.try_into().ok()?, lines.map(str::to_owned).collect()))
}

fn main() {
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("masks");
    println!("ms a mask              encode ours  theirs  (by rows)  ratio   decode ours  theirs  ratio   letters");
    for (name, images) in [("clutter", clutter()), ("blobs", blobs()), ("noise", noise())] {
        let bytes: Vec<u8> = images.iter().flat_map(|image| image.data().iter().map(|&bit| bit.into())).collect();
        std::fs::write(&file, bytes).expect("written");
        let (mut we, mut they) = ([f64::INFINITY; 2], [f64::INFINITY; 3]);
        let mut letters = 0;
        for _ in 0..ROUNDS {
            let (times, encoded) = ours(&images);
            we = std::array::from_fn(|i| we[i].min(times[i]));
            letters = encoded.iter().map(String::len).sum::<usize>() / MASKS;
            let Some((times, other)) = theirs(&file) else { continue };
            they = std::array::from_fn(|i| they[i].min(times[i]));
            assert_eq!(encoded, other, "the same letters");
        }
        figures.keep(&format!("encoding of {name}"), 1e-3 * we[0], Unit::Seconds);
        figures.keep(&format!("decoding of {name}"), 1e-3 * we[1], Unit::Seconds);
        println!(
            "{name:<22} {:>11.4}  {:>6.4}  {:>9.4}  {:>5.2}   {:>11.4}  {:>6.4}  {:>5.2}   {letters:>7}",
            we[0],
            they[0],
            they[1],
            they[0] / we[0],
            we[1],
            they[2],
            they[2] / we[1]
        );
    }
}
