//! Damaged datasets of every readable format: they yield errors or faults, and never a panic, an abort or a hang.
//!
//! A child process with 2 GiB mutates a file of a small dataset, reads the whole dataset as `validate` does, and
//! restores the file; the parent counts the reasons that end a child. An input is a function of the dataset,
//! `SYNTABLE_MUTATIONS_SEED` and its number. The short form uses some dozens of inputs per dataset. The long form uses
//! `SYNTABLE_MUTATIONS` inputs:
//!
//! ```console
//! $ SYNTABLE_MUTATIONS=100000 cargo test --release -p syntable-tests --test program -- --nocapture damaged_datasets
//! ```
//!
//! `SYNTABLE_MUTATIONS_ONLY=parquet` selects datasets by a part of their names, and `SYNTABLE_MUTATIONS_KEEP=DIR` keeps
//! the inputs on which a reader panicked.

#![allow(clippy::ptr_arg, reason = "all ways to damage a file are functions of one type")]

use crate::support::{checked, skip};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use syntable_model::prelude::Stream;
use syntable_model::reader::{DatasetFormat, Source};
use syntable_model::stage::DatasetInfo;
use syntable_program as _;
use syntable_testing::takes::registry;
use syntable_testing::takes::{Crowd, dataset, finish, take, write_scenes, writer};

/// Inputs per dataset in the short form.
const SHORT: u64 = 24;
/// An input that takes longer counts as a hang.
const PATIENCE: Duration = Duration::from_secs(10);
/// Memory of a child, KiB.
const MEMORY_KIB: u64 = 2 << 20;

/// Variable with the instructions for a child of this test: dataset, folder, first input, end, seed.
const CHILD: &str = "SYNTABLE_MUTATIONS_CHILD";

/// Products that generic formats include here.
const INCLUDE: &str = "include = [\"rgb\", \"depth\", \"visible_mask\", \"amodal_mask\", \"category_id\", \"occlusion_order\", \
                       \"camera\", \"object_info\"]";
const ARRAYS: &str =
    "include = [\"rgb\", \"depth\", \"visible_mask\", \"amodal_mask\", \"category_id\", \"occlusion_order\"]";

/// Options of writers whose readers have several code paths. Each adds a dataset to the dataset with default options.
/// `photographs` has no writer: the images of BOP are its folder.
const VARIANTS: &[(&str, &str)] = &[
    ("bop", "layout = \"webdataset\""),
    ("photographs", "rgb = { format = \"jpeg\" }"),
    ("jsonl", INCLUDE),
    ("jsonl", "per = \"scene\"\ninclude = [\"rgb\", \"amodal_mask\", \"settle_report\"]"),
    ("npz", ARRAYS),
    ("webdataset", INCLUDE),
    ("webdataset", "include = [\"depth\", \"normal\", \"rgb\"]\nfloats = \"exr\""),
    ("parquet", "rows = \"views\""),
    ("parquet", "rows = \"views\"\nimages = \"embedded\""),
    ("hdf5", "include = [\"visible_mask\", \"amodal_mask\", \"category_id\", \"occlusion_order\", \"camera\"]"),
    ("syntable", "compat = \"syntable_1\""),
    ("coco", "masks = \"visible\""),
];

/// The datasets: a writer and its options for every format. New formats are included automatically.
fn datasets() -> Vec<(Arc<dyn DatasetFormat>, &'static str)> {
    let mut all = Vec::new();
    for format in registry().formats() {
        let variants = VARIANTS.iter().filter(|(kind, _)| *kind == format.name()).map(|(_, options)| *options);
        all.extend([""].into_iter().chain(variants).map(|options| (Arc::clone(format), options)));
    }
    all
}

/// Writes a dataset of two views and a few objects. Returns its root; none if the writer refuses the options.
fn written(folder: &Path, kind: &str, options: &str) -> Option<PathBuf> {
    let info = DatasetInfo { classes: vec!["bowl".into(), "mug".into()], ..dataset(1, 2) };
    if kind == "ocid" {
        written(folder, "tod", options)?;
        move_to_ocid(&folder.join("data"));
        return Some(folder.join("data"));
    }
    if kind == "photographs" {
        written(folder, "bop", options)?;
        return Some(folder.join("data/train_pbr/000000/rgb"));
    }
    let writer = writer(kind, options).ok()?;
    let take = take(0, 4, &[Crowd::Random, Crowd::Hidden]);
    write_scenes(folder, "data", &*writer, &info, [&take]).expect("written");
    finish(folder, "data", &*writer, &info, &[0]).expect("finished");
    let _ = std::fs::remove_dir_all(folder.join(".syntable"));
    Some(registry().find_dataset(&Source::new(folder), None).unwrap_or_else(|error| panic!("{kind}: {error}")).1.path)
}

/// Moves the images of TOD's first scene to where OCID has them, since no writer writes OCID.
fn move_to_ocid(root: &Path) {
    let sequence = root.join("ARID20/table/top/seq01");
    for (image, folder) in [("rgb", "rgb"), ("depth", "depth"), ("segmentation", "label")] {
        std::fs::create_dir_all(sequence.join(folder)).expect("a folder");
        let scene = std::fs::read_dir(root.join("training_set/scene_00000")).expect("a scene");
        for path in scene.flatten().map(|entry| entry.path()) {
            let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
            if let Some(view) = stem.strip_prefix(image) {
                std::fs::rename(&path, sequence.join(folder).join(format!("result{view}.png"))).expect("moved");
            }
        }
    }
    std::fs::remove_dir_all(root.join("training_set")).expect("there");
}

/// Reads a whole dataset. Returns the errors and faults.
fn read(format: &dyn DatasetFormat, root: &Path) -> Vec<String> {
    let source = Source::new(root);
    let _ = registry().find_dataset(&source, None);
    let opened = match format.open(&source) {
        Ok(opened) => opened,
        Err(error) => return vec![error.to_string()],
    };
    let found = checked(&opened).expect("a thread");
    let mut messages: Vec<String> = found.faults.into_iter().map(|fault| fault.message).collect();
    let offers = &opened.offers;
    for image in 0..opened.images.len() {
        messages.extend(opened.crowds(image).err().map(|error| error.to_string()));
    }
    messages.extend(opened.not_objects(offers).into_iter().filter(|it| it.count > 0).map(|it| it.to_string()));
    messages.extend(opened.caveats(offers));
    messages
}

/// Files of a folder.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        match entry.path() {
            path if path.is_dir() => all.extend(files(&path)),
            path => drop(all.insert(path.clone(), std::fs::read(path).expect("a file"))),
        }
    }
    all
}

/// Random numbers for an input.
struct Dice(Stream);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0.below(end.max(1) as u64) as usize
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

/// Numbers that provoke arithmetic errors.
const NUMBERS: [u64; 20] = [
    0,
    1,
    2,
    7,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0xffff_ffff_ffff_fff0,
    u64::MAX,
];

/// Replacements for values in JSON.
const VALUES: [&str; 24] = [
    "0",
    "-1",
    "1",
    "0.5",
    "255",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "-2147483649",
    "18446744073709551616",
    "1e308",
    "1e999",
    "-1e-400",
    "NaN",
    "null",
    "true",
    "\"\"",
    "\"é\\u0000/../x\"",
    "[]",
    "{}",
    "[[]]",
    "[1e18,-1e18]",
    "{\"size\":[65535,65535],\"counts\":\"0\"}",
];

/// Damages bytes in one of many ways. Most of these know the file format.
fn mutate(bytes: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    for _ in 0..1 + dice.below(3) {
        if bytes.is_empty() {
            return;
        }
        let own: &[fn(&mut Vec<u8>, &mut Dice)] = match &bytes[..] {
            [0x89, b'P', b'N', b'G', ..] => &[png, png, png],
            [b'P', b'K', ..] => &[zip, zip],
            [b'P', b'A', b'R', b'1', ..] => &[parquet, parquet, parquet],
            [0x89, b'H', b'D', b'F', ..] => &[hdf5, hdf5, hdf5],
            [b'{' | b'[', ..] => &[json, json, json],
            bytes if bytes.get(257..262) == Some(b"ustar") => &[tar, tar, json],
            bytes if bytes.is_ascii() => &[json, json],
            _ => &[overwrite],
        };
        let general: &[fn(&mut Vec<u8>, &mut Dice)] = &[flip, truncate, overwrite, remove, repeat];
        match dice.below(own.len() + general.len() + 1) {
            way if way < own.len() => own[way](bytes, dice),
            way if way < own.len() + general.len() => general[way - own.len()](bytes, dice),
            _ => splice(bytes, other, dice),
        }
    }
}

fn flip(bytes: &mut Vec<u8>, dice: &mut Dice) {
    for _ in 0..1 + dice.below(8) {
        let at = dice.below(bytes.len());
        bytes[at] ^= 1 << dice.below(8);
    }
}

fn truncate(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let end = dice.below(bytes.len());
    bytes.truncate(end);
}

/// Writes a number of 1 to 8 bytes, in either order.
fn overwrite(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let at = dice.below(bytes.len());
    number(bytes, at, dice);
}

fn number(bytes: &mut [u8], at: usize, dice: &mut Dice) {
    let (value, width) = (dice.of(&NUMBERS).wrapping_add(dice.below(3) as u64), dice.of(&[1, 2, 4, 8]));
    let little = value.to_le_bytes();
    let own: Vec<u8> =
        if dice.below(2) == 0 { little[..width].to_vec() } else { little[..width].iter().rev().copied().collect() };
    for (to, from) in bytes.iter_mut().skip(at).zip(own) {
        *to = from;
    }
}

fn range(length: usize, dice: &mut Dice) -> std::ops::Range<usize> {
    let start = dice.below(length);
    let most = dice.of(&[4, 64, 1024]).min(length - start);
    start..start + dice.below(most + 1)
}

fn remove(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let gone = range(bytes.len(), dice);
    bytes.drain(gone);
}

fn repeat(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let part = bytes[range(bytes.len(), dice)].to_vec();
    let at = dice.below(bytes.len() + 1);
    let many = part.repeat(dice.of(&[1, 2, 50]));
    bytes.splice(at..at, many);
}

/// Puts a part of another file of the dataset over or between the bytes.
fn splice(bytes: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    let (at, part) = (dice.below(bytes.len()), &other[range(other.len().max(1), dice).start.min(other.len())..]);
    let part = &part[..part.len().min(dice.of(&[8, 256, 4096]))];
    let end = if dice.below(2) == 0 { at } else { (at + part.len()).min(bytes.len()) };
    bytes.splice(at..end, part.iter().copied());
}

/// Replaces a number, a string or a list in JSON, in TOML or in a text table.
fn json(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let starts: Vec<usize> = (0..bytes.len())
        .filter(|&at| {
            let before = if at == 0 { b' ' } else { bytes[at - 1] };
            b"[:, \n".contains(&before) && (bytes[at].is_ascii_digit() || b"-\"[{".contains(&bytes[at]))
        })
        .collect();
    if starts.is_empty() {
        return overwrite(bytes, dice);
    }
    let start = dice.of(&starts);
    let is_end = |byte: &u8| b",]} \n".contains(byte);
    let end = match bytes[start] {
        b'"' => bytes[start + 1..].iter().position(|byte| *byte == b'"').map(|length| start + length + 2),
        b'[' => bytes[start..].iter().position(|byte| *byte == b']').map(|length| start + length + 1),
        _ => bytes[start..].iter().position(is_end).map(|length| start + length),
    };
    let end = end.unwrap_or(bytes.len());
    let new = match dice.below(12) {
        0 => "[".repeat(100_000),
        1 => format!("{}1{}", "[".repeat(120), "]".repeat(120)),
        2 => format!("[{}0]", "0,".repeat(5000)),
        3 => dice.below(1 << 40).to_string(),
        4 => format!("\"{}\"", "0".repeat(1 + dice.below(300))),
        _ => dice.of(&VALUES).to_owned(),
    };
    bytes.splice(start..end, new.bytes());
}

/// CRC-32 of ISO 3309, as used in PNG and ZIP.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    };
    !bytes.iter().fold(u32::MAX, step)
}

/// Changes a chunk of a PNG file and corrects its checksum.
fn png(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let (mut chunks, mut at) = (Vec::new(), 8);
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        if at + 12 + length > bytes.len() {
            break;
        }
        chunks.push((at, length));
        at += 12 + length;
    }
    if chunks.is_empty() {
        return flip(bytes, dice);
    }
    let (at, length) = dice.of(&chunks);
    let mut body = bytes[at + 4..at + 8 + length].to_vec();
    match dice.below(6) {
        0 if body.len() > 4 => {
            let place = 4 + dice.below(body.len() - 4);
            number(&mut body, place, dice);
        }
        // Width, height, bit depth and color type.
        1 if &body[..4] == b"IHDR" => {
            let place = dice.of(&[4, 8, 12, 13, 16]);
            number(&mut body, place, dice);
        }
        2 => body[..4]
            .copy_from_slice(dice.of(&[b"IDAT", b"PLTE", b"tRNS", b"iCCP", b"zTXt", b"IEND", b"acTL", b"fdAT"])),
        3 => {
            // A compressed chunk.
            let mut unfolds = dice.of(&[b"iCCPx\0\0", b"zTXtx\0\0"]).to_vec();
            unfolds.extend([0x78, 0x9c, 0xed, 0xc1, 0x01, 0x0d]);
            unfolds.extend(vec![0; dice.below(4000)]);
            body = unfolds;
        }
        4 => truncate(&mut body, dice),
        _ if body.len() > 4 => {
            let place = 4 + dice.below(body.len() - 4);
            body[place] ^= 1 << dice.below(8);
        }
        _ => {}
    }
    let sum = crc(&body).to_be_bytes();
    let length_now = (body.len().saturating_sub(4) as u32).to_be_bytes();
    let chunk = [&length_now[..], &body, &sum].concat();
    bytes.splice(at..at + 12 + length, chunk);
}

/// Changes a header of a ZIP archive: of a member, of the directory or of the end record.
fn zip(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let signature = dice.of(&[b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06"]);
    let places: Vec<usize> = bytes.windows(4).enumerate().filter(|(_, it)| it == signature).map(|(at, _)| at).collect();
    if let Some(at) = (!places.is_empty()).then(|| dice.of(&places)) {
        let place = at + 4 + dice.below(42);
        number(bytes, place, dice);
    }
}

/// Changes a header of a tar file and corrects its checksum.
fn tar(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let heads: Vec<usize> = (0..bytes.len() / 512)
        .map(|at| 512 * at)
        .filter(|at| bytes.get(at + 257..at + 262) == Some(b"ustar"))
        .collect();
    if heads.is_empty() {
        return flip(bytes, dice);
    }
    let at = dice.of(&heads);
    match dice.below(4) {
        // The size in octal digits, or in binary.
        0 => bytes[at + 124..at + 136].copy_from_slice(format!("{:011o}\0", dice.of(&NUMBERS) >> 31).as_bytes()),
        1 => {
            bytes[at + 124] = 0x80;
            number(bytes, at + 125 + dice.below(8), dice);
        }
        2 => bytes[at + 156] = dice.of(b"0125LKxgS7"),
        _ => {
            let place = at + dice.below(500);
            bytes[place] ^= 1 << dice.below(8);
        }
    }
    bytes[at + 148..at + 156].fill(b' ');
    let sum: u32 = bytes[at..at + 512].iter().map(|byte| u32::from(*byte)).sum();
    bytes[at + 148..at + 156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
}

/// Changes the footer of a Parquet file, or the header of a page.
fn parquet(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let length = bytes.len();
    if length < 16 {
        return flip(bytes, dice);
    }
    let tail = [0, 1, 2, 3].map(|at| bytes[length - 8 + at]);
    let footer = (u32::from_le_bytes(tail) as usize).min(length - 12);
    let place = match dice.below(5) {
        0 => length - 8 + dice.below(4),
        1 => 4 + dice.below(64.min(length - 4)),
        _ => length - 8 - footer + dice.below(footer),
    };
    match dice.below(5) {
        0 => number(bytes, place, dice),
        1 => bytes[place] = dice.of(&[0x00, 0x15, 0x16, 0x18, 0x19, 0x1c, 0x25, 0x2c, 0xff, 0xfc, 0x8c]),
        // A number with many groups of seven bits.
        2 => {
            let many: Vec<u8> = vec![0xff; dice.below(10)].into_iter().chain([dice.below(128) as u8]).collect();
            for (to, from) in bytes.iter_mut().skip(place).zip(many) {
                *to = from;
            }
        }
        3 => {
            // The footer grows, and so does its stated length.
            let part: Vec<u8> = (0..1 + dice.below(12)).map(|_| dice.below(256) as u8).collect();
            let grown = (footer + part.len()) as u32;
            bytes.splice(place..place, part);
            let at = bytes.len() - 8;
            bytes[at..at + 4].copy_from_slice(&grown.to_le_bytes());
        }
        _ => bytes[place] ^= 1 << dice.below(8),
    }
}

/// Changes the beginning of an HDF5 file or a structure with a signature, and corrects the checksums of headers.
fn hdf5(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let signed: Vec<usize> = bytes
        .windows(4)
        .enumerate()
        .filter(|(_, it)| {
            [b"OHDR", b"OCHK", b"TREE", b"SNOD", b"HEAP", b"FRHP", b"BTHD", b"FAHD", b"EAHD", b"GCOL"]
                .contains(&<&[u8; 4]>::try_from(*it).expect("four"))
        })
        .map(|(at, _)| at)
        .collect();
    let base = if signed.is_empty() || dice.below(4) == 0 { 0 } else { dice.of(&signed) };
    let place = (base + dice.below(dice_reach(bytes.len() - base))).min(bytes.len() - 1);
    match dice.below(3) {
        0 => number(bytes, place, dice),
        1 => bytes[place] = dice.below(256) as u8,
        _ => bytes[place] ^= 1 << dice.below(8),
    }
    for at in signed {
        sum_of_header(bytes, at);
    }
    // Superblocks of versions 2 and 3 end with their own checksum.
    if bytes.len() > 48 && bytes[8] >= 2 && bytes[9] == 8 {
        let sum = lookup3(&bytes[..44]).to_le_bytes();
        bytes[44..48].copy_from_slice(&sum);
    }
}

fn dice_reach(rest: usize) -> usize {
    rest.clamp(1, 400)
}

/// Corrects the checksum of an object header of version 2.
fn sum_of_header(bytes: &mut [u8], at: usize) -> Option<()> {
    if bytes.get(at..at + 5)? != b"OHDR\x02" {
        return None;
    }
    let flags = *bytes.get(at + 5)?;
    let mut place = at + 6 + if flags & 0x20 != 0 { 16 } else { 0 } + if flags & 0x10 != 0 { 4 } else { 0 };
    let width = 1_usize << (flags & 3);
    let size = bytes.get(place..place + width)?.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    place += width;
    let end = place.checked_add(size)?;
    let sum = lookup3(bytes.get(at..end)?).to_le_bytes();
    bytes.get_mut(end..end + 4)?.copy_from_slice(&sum);
    Some(())
}

/// Bob Jenkins' hash lookup3 with a seed of 0, the checksum of HDF5's metadata.
fn lookup3(bytes: &[u8]) -> u32 {
    let mut state = [0xdead_beef_u32.wrapping_add(bytes.len() as u32); 3];
    let mut rest = bytes;
    let add = |state: &mut [u32; 3], block: &[u8]| {
        for (at, byte) in block.iter().enumerate() {
            state[at / 4] = state[at / 4].wrapping_add(u32::from(*byte) << (8 * (at % 4)));
        }
    };
    while rest.len() > 12 {
        add(&mut state, &rest[..12]);
        let [mut a, mut b, mut c] = state;
        for (turns, which) in [(4, 0), (6, 1), (8, 2), (16, 0), (19, 1), (4, 2)] {
            // Each of the three values in turn is mixed with its predecessor.
            match which {
                0 => (a, c) = (a.wrapping_sub(c) ^ c.rotate_left(turns), c.wrapping_add(b)),
                1 => (b, a) = (b.wrapping_sub(a) ^ a.rotate_left(turns), a.wrapping_add(c)),
                _ => (c, b) = (c.wrapping_sub(b) ^ b.rotate_left(turns), b.wrapping_add(a)),
            }
        }
        state = [a, b, c];
        rest = &rest[12..];
    }
    add(&mut state, rest);
    let [mut a, mut b, mut c] = state;
    if !rest.is_empty() {
        c = (c ^ b).wrapping_sub(b.rotate_left(14));
        a = (a ^ c).wrapping_sub(c.rotate_left(11));
        b = (b ^ a).wrapping_sub(a.rotate_left(25));
        c = (c ^ b).wrapping_sub(b.rotate_left(16));
        a = (a ^ c).wrapping_sub(c.rotate_left(4));
        b = (b ^ a).wrapping_sub(a.rotate_left(14));
        c = (c ^ b).wrapping_sub(b.rotate_left(24));
    }
    c
}

/// Findings of a child.
#[derive(Debug, Default)]
struct Found {
    inputs: u64,
    /// Inputs with errors, faults or caveats that the undamaged dataset does not have.
    refused: u64,
    /// Panics of libraries and of this program that a guard caught, by location.
    caught: BTreeMap<String, u64>,
    aborts: Vec<u64>,
    hangs: Vec<u64>,
    slowest: Duration,
    peak_kib: u64,
}

/// The location in a message about a caught panic.
fn place_of_panic(message: &str) -> Option<&str> {
    let (_, rest) = message.split_once("failed on it: panicked at ")?;
    rest.split_once(": ").map(|(place, _)| place)
}

/// Runs inputs of a dataset from `first` on, and prints the findings.
fn child(spec: &str) {
    let parts: Vec<&str> = spec.split('|').collect();
    let [name, root, first, end, seed] = parts[..] else { panic!("{spec}") };
    let (first, end, seed): (u64, u64, u64) =
        (first.parse().expect("a number"), end.parse().expect("a number"), seed.parse().expect("a number"));
    let root = Path::new(root);
    let registry = registry();
    let kind = name.split(':').next().expect("a name");
    let format = registry.formats().iter().find(|format| format.name() == kind).expect("a format");
    let folder = if root.is_dir() { root } else { root.parent().expect("a folder") };
    let all: Vec<(PathBuf, Vec<u8>)> = files(folder).into_iter().collect();
    let keep = std::env::var_os("SYNTABLE_MUTATIONS_KEEP");
    let sound = read(&**format, root);
    let tag = name.bytes().fold(0_u64, |hash, byte| hash.wrapping_mul(31).wrapping_add(byte.into()));
    let (mut found, mut start) = (Found::default(), Instant::now());
    for input in first..end {
        println!("at {input}");
        let mut dice = Dice(Stream::root(seed).at(tag).at(input));
        let (path, content) = &all[dice.below(all.len())];
        let other = &all[dice.below(all.len())].1;
        let mut bytes = content.clone();
        mutate(&mut bytes, other, &mut dice);
        std::fs::write(path, &bytes).expect("written");
        let messages = read(&**format, root);
        found.refused += u64::from(messages != sound);
        let panics: std::collections::BTreeSet<&str> = messages.iter().filter_map(|it| place_of_panic(it)).collect();
        if let Some(keep) = keep.as_ref().filter(|_| !panics.is_empty()) {
            let end = path.extension().unwrap_or_default().to_string_lossy();
            let _ = std::fs::write(Path::new(keep).join(format!("{}-{input}.{end}", format.name())), &bytes);
        }
        for place in panics {
            println!("panic {place}");
        }
        std::fs::write(path, content).expect("written");
        if start.elapsed() > PATIENCE {
            println!("hang {input}");
        }
        found.slowest = found.slowest.max(start.elapsed());
        start = Instant::now();
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<u64>().ok());
    println!("end {} {} {}", found.refused, found.slowest.as_millis(), peak.unwrap_or_default());
}

/// Lets child processes run all inputs of a dataset. If a child ends early, the next child continues.
fn parent(name: &str, root: &Path, count: u64, seed: u64) -> Found {
    let mut found = Found { inputs: count, ..Found::default() };
    let mut first = 0;
    while first < count {
        // A child runs thousands of inputs, so that leaked memory is noticed, too.
        let end = count.min(first + 20_000);
        let spec = format!("{name}|{}|{first}|{end}|{seed}", root.display());
        let exe = std::env::current_exe().expect("a test");
        let mut child = Command::new("sh")
            .arg("-c")
            .arg(format!("ulimit -v {MEMORY_KIB}; ulimit -c 0; exec \"$0\" --exact \"$1\" --nocapture"))
            .arg(exe)
            .arg(std::thread::current().name().expect("the test's name"))
            .env(CHILD, spec)
            .env("RUST_BACKTRACE", "0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell");
        let out = child.stdout.take().expect("piped");
        let (send, receive) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for line in std::io::BufRead::lines(std::io::BufReader::new(out)).map_while(Result::ok) {
                if send.send(line).is_err() {
                    break;
                }
            }
        });
        let (mut at, mut is_done, mut hung) = (first, false, false);
        loop {
            match receive.recv_timeout(3 * PATIENCE) {
                Ok(line) => {
                    let words: Vec<&str> = line.split(' ').collect();
                    match words[..] {
                        ["at", input] => at = input.parse().expect("a number"),
                        ["hang", input] => found.hangs.push(input.parse().expect("a number")),
                        ["panic", ..] => *found.caught.entry(words[1..].join(" ")).or_default() += 1,
                        ["end", refused, slowest, peak] => {
                            is_done = true;
                            found.refused += refused.parse::<u64>().expect("a number");
                            found.slowest =
                                found.slowest.max(Duration::from_millis(slowest.parse().expect("a number")));
                            found.peak_kib = found.peak_kib.max(peak.parse().expect("a number"));
                        }
                        _ => {}
                    }
                }
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {
                    hung = true;
                    break;
                }
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break,
            }
        }
        if hung {
            found.hangs.push(at);
            child.kill().expect("it runs");
        }
        child.wait().expect("it ends");
        if is_done {
            first = end;
            continue;
        }
        if !hung {
            found.aborts.push(at);
        }
        first = at + 1;
        // Undoes changes of the child.
        restore(root);
    }
    found
}

/// Restores the original files of the dataset.
fn restore(root: &Path) {
    let folder = if root.is_dir() { root } else { root.parent().expect("a folder") };
    for path in files(folder).into_keys() {
        let whole = whole_of(&path);
        if whole.is_file() {
            std::fs::copy(whole, path).expect("copied");
        }
    }
}

/// Path where the parent keeps the original of a file.
fn whole_of(path: &Path) -> PathBuf {
    PathBuf::from(path.display().to_string().replace("/mutated/", "/whole/"))
}

#[test]
fn damaged_datasets_are_refused_and_nothing_panics() {
    if let Ok(spec) = std::env::var(CHILD) {
        return child(&spec);
    }
    if !Path::new("/proc/self/status").is_file() {
        return skip("no /proc: the memory of readers of damaged datasets is not measured");
    }
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let (count, seed) = (number("SYNTABLE_MUTATIONS").unwrap_or(SHORT), number("SYNTABLE_MUTATIONS_SEED").unwrap_or(1));
    let only = std::env::var("SYNTABLE_MUTATIONS_ONLY").unwrap_or_default();
    let base = if Path::new("/dev/shm").is_dir() { "/dev/shm".into() } else { std::env::temp_dir() };
    let mut wrong = Vec::new();
    for (number, (format, options)) in datasets().into_iter().enumerate() {
        let name = format!("{}:{number}", format.name());
        if !name.contains(&only) {
            continue;
        }
        let folder = tempfile::tempdir_in(&base).expect("a folder");
        let [mutated, whole] = ["mutated", "whole"].map(|part| folder.path().join(part));
        let root = written(&mutated, format.name(), options).unwrap_or_else(|| panic!("{}: {options}", format.name()));
        written(&whole, format.name(), options).expect("written again");
        let start = Instant::now();
        let found = parent(&name, &root, count, seed);
        let rate = count as f64 / start.elapsed().as_secs_f64();
        println!(
            "{} {options:?}: {} inputs, {} refused, {} panics caught, {} aborts, {} hangs, slowest {:.2} s, peak {} MiB, {rate:.0} per s",
            format.name(),
            found.inputs,
            found.refused,
            found.caught.values().sum::<u64>(),
            found.aborts.len(),
            found.hangs.len(),
            found.slowest.as_secs_f64(),
            found.peak_kib >> 10,
        );
        for (place, count) in &found.caught {
            println!("    {count} panics at {place}");
        }
        // Panics of libraries are not counted as ours, as long as they are caught.
        let own = found.caught.keys().any(|place| place.starts_with("core/") || place.starts_with("plugins/"));
        if own || !found.aborts.is_empty() || !found.hangs.is_empty() {
            wrong.push(format!("{name} {options:?}: {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
