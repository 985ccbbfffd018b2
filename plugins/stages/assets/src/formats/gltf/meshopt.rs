//! `EXT_meshopt_compression`: buffer views that are packed by the codecs of meshoptimizer, after the extension's
//! appendices.
//!
//! Every read is checked against the packed bytes. A stream that ends early or has excess bytes is refused.

use serde::Deserialize;
use syntable_model::error::{Error, Result};

/// Maximum size of an element, bytes.
const MAX_STRIDE: usize = 256;

/// The extension of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct CompressedView {
    /// The buffer with the packed bytes.
    pub buffer: u32,
    /// Offset of the packed bytes.
    #[serde(default)]
    pub byte_offset: u64,
    /// Number of packed bytes.
    pub byte_length: u64,
    /// Size of an unpacked element, bytes.
    pub byte_stride: usize,
    /// Number of elements.
    pub count: u64,
    mode: Mode,
    #[serde(default)]
    filter: MeshoptFilter,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Deserialize, Clone, Copy, Default, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum MeshoptFilter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
}

impl CompressedView {
    /// Number of unpacked bytes. Refuses sizes of elements that the mode does not have.
    pub fn unpacked_bytes(&self) -> Result<u64> {
        let stride = self.byte_stride;
        let fits = match (self.mode, self.filter) {
            (Mode::Attributes, MeshoptFilter::None | MeshoptFilter::Exponential) => {
                stride.is_multiple_of(4) && (4..=MAX_STRIDE).contains(&stride)
            }
            (Mode::Attributes, MeshoptFilter::Octahedral) => matches!(stride, 4 | 8),
            (Mode::Attributes, MeshoptFilter::Quaternion) => stride == 8,
            (Mode::Triangles | Mode::Indices, MeshoptFilter::None) => matches!(stride, 2 | 4),
            _ => false,
        };
        if !fits {
            return Err(Error::new(format!("packed elements of {stride} bytes do not fit their mode and filter")));
        }
        let bytes = self.count.checked_mul(stride as u64);
        bytes.ok_or_else(|| Error::new(format!("{} packed elements are too many", self.count)))
    }

    /// Unpacks the elements. The caller has reserved [`unpacked_bytes`](Self::unpacked_bytes) in the budget.
    pub fn unpack(&self, packed: &[u8]) -> Result<Vec<u8>> {
        let count = usize::try_from(self.count).map_err(|_| Error::new("too many packed elements"))?;
        let mut bytes = match self.mode {
            Mode::Attributes => attributes(packed, count, self.byte_stride)?,
            Mode::Triangles => numbers(triangles(packed, count)?, self.byte_stride),
            Mode::Indices => numbers(indices(packed, count)?, self.byte_stride),
        };
        match self.filter {
            MeshoptFilter::None => {}
            MeshoptFilter::Octahedral if self.byte_stride == 4 => {
                for row in bytes.chunks_exact_mut(4) {
                    let [x, y, one] = [row[0], row[1], row[2]].map(|byte| f32::from(byte as i8));
                    let normal = octahedral(x, y, one).map(|x| (x * 127.0).round() as i8 as u8);
                    row[..3].copy_from_slice(&normal);
                }
            }
            MeshoptFilter::Octahedral => words(&mut bytes, |[x, y, one, other]| {
                let [x, y, z] = octahedral(f32::from(x), f32::from(y), f32::from(one));
                [x, y, z].map(snorm16).into_iter().chain([other]).collect()
            }),
            MeshoptFilter::Quaternion => words(&mut bytes, |row| quaternion(row).to_vec()),
            MeshoptFilter::Exponential => {
                for word in bytes.chunks_exact_mut(4) {
                    let bits = i32::from_le_bytes(std::array::from_fn(|i| word[i]));
                    let value = f64::from(bits << 8 >> 8) * 2.0_f64.powi(bits >> 24);
                    word.copy_from_slice(&(value as f32).to_le_bytes());
                }
            }
        }
        Ok(bytes)
    }
}

/// Bytes that are read one after the other.
struct ByteStream<'a> {
    bytes: &'a [u8],
}

impl<'a> ByteStream<'a> {
    /// A stream with a header byte, without it and a tail; and the tail.
    fn open(packed: &'a [u8], header: u8, tail: usize) -> Result<(Self, &'a [u8])> {
        let Some((&first, rest)) = packed.split_first() else { return Err(ends()) };
        if first != header {
            return Err(Error::new(format!(
                "unknown kind {first:#04x} of a packed stream; only {header:#04x} is supported"
            ))
            .help("convert the file: `gltf-transform copy in.glb out.glb`"));
        }
        let middle = rest.len().checked_sub(tail).ok_or_else(ends)?;
        let (bytes, tail) = rest.split_at(middle);
        Ok((Self { bytes }, tail))
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or_else(ends)?;
        self.bytes = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    /// An integer in groups of seven bits, the lowest first.
    fn varint(&mut self) -> Result<u32> {
        let mut value = 0_u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(Error::new("a packed number has more than five bytes"))
    }

    fn finish(self) -> Result<()> {
        match self.bytes.len() {
            0 => Ok(()),
            left => Err(Error::new(format!("{left} excess packed bytes"))),
        }
    }
}

fn ends() -> Error {
    Error::new("the packed bytes end early").help("the file is cut short or damaged")
}

/// Elements whose bytes were packed plane by plane, as differences from the previous element.
fn attributes(packed: &[u8], count: usize, stride: usize) -> Result<Vec<u8>> {
    let (mut stream, tail) = ByteStream::open(packed, 0xa0, stride.max(32))?;
    // The stream has two bits at least for each byte of sixteen elements.
    if count.div_ceil(16).div_ceil(4).saturating_mul(stride) > stream.bytes.len() {
        return Err(ends());
    }
    let mut before = tail[tail.len() - stride..].to_vec();
    let mut elements = vec![0; count * stride];
    let block = ((8192 / stride) & !15).min(256);
    let mut deltas = [0; 256];
    for block in elements.chunks_mut(block * stride) {
        let groups = (block.len() / stride).div_ceil(16);
        for (at, before) in before.iter_mut().enumerate() {
            let modes = stream.take(groups.div_ceil(4))?;
            for group in 0..groups {
                let mode = modes[group / 4] >> (2 * (group % 4)) & 3;
                stream.deltas(mode, &mut deltas[16 * group..16 * group + 16])?;
            }
            for (element, &delta) in block.chunks_exact_mut(stride).zip(&deltas) {
                *before = before.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
                element[at] = *before;
            }
        }
    }
    stream.finish()?;
    Ok(elements)
}

impl ByteStream<'_> {
    /// Sixteen differences of one byte: all zero, of two or four bits with exceptions after them, or plain.
    fn deltas(&mut self, mode: u8, into: &mut [u8]) -> Result<()> {
        let bits = match mode {
            0 => {
                into.fill(0);
                return Ok(());
            }
            1 => 2,
            2 => 4,
            _ => {
                into.copy_from_slice(self.take(16)?);
                return Ok(());
            }
        };
        let small = self.take(2 * bits)?;
        let (per_byte, all) = (8 / bits, (1_u8 << bits) - 1);
        for (i, delta) in into.iter_mut().enumerate() {
            let value = small[i / per_byte] >> (8 - bits * (i % per_byte + 1)) & all;
            *delta = if value == all { self.byte()? } else { value };
        }
        Ok(())
    }
}

/// The most recent sixteen items; index 0 is the latest.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self { items: [T::default(); 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next % 16] = item;
        self.next = (self.next + 1) % 16;
    }

    fn get(&self, age: u8) -> T {
        self.items[(self.next + 15 - usize::from(age)) % 16]
    }
}

/// The next corner that no triangle has used so far.
fn fresh(next: &mut u32) -> u32 {
    *next = next.wrapping_add(1);
    next.wrapping_sub(1)
}

/// Corners of triangles. Most triangles share a recent edge.
fn triangles(packed: &[u8], count: usize) -> Result<Vec<u32>> {
    let (mut stream, table) = ByteStream::open(packed, 0xe1, 16)?;
    if !count.is_multiple_of(3) {
        return Err(Error::new(format!("{count} packed corners are not a multiple of three")));
    }
    let codes = stream.take(count / 3)?;
    let mut corners = Vec::with_capacity(count);
    let (mut edges, mut vertices) = (Recent::<[u32; 2]>::new(), Recent::<u32>::new());
    let (mut next, mut last) = (0_u32, 0_u32);
    let explicit = |stream: &mut ByteStream<'_>, last: &mut u32| -> Result<u32> {
        let value = stream.varint()?;
        *last = last.wrapping_add(value >> 1 ^ (value & 1).wrapping_neg());
        Ok(*last)
    };
    for &code in codes {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let [a, b] = edges.get(high);
            let c = match low {
                0 => fresh(&mut next),
                1..=12 => vertices.get(low),
                13 => {
                    last = last.wrapping_sub(1);
                    last
                }
                14 => {
                    last = last.wrapping_add(1);
                    last
                }
                _ => explicit(&mut stream, &mut last)?,
            };
            edges.push([c, b]);
            edges.push([a, c]);
            if low == 0 || low > 12 {
                vertices.push(c);
            }
            corners.extend([a, b, c]);
            continue;
        }
        let pair = if low < 14 { table[usize::from(low)] } else { stream.byte()? };
        if low >= 14 && pair == 0 {
            next = 0;
        }
        let a = if low == 15 { explicit(&mut stream, &mut last)? } else { fresh(&mut next) };
        let [b, c] = {
            let mut corner = |nibble: u8| match nibble {
                0 => Ok(fresh(&mut next)),
                15 if low >= 14 => explicit(&mut stream, &mut last),
                age => Ok(vertices.get(age - 1)),
            };
            [corner(pair >> 4)?, corner(pair & 15)?]
        };
        edges.push([b, a]);
        edges.push([c, b]);
        edges.push([a, c]);
        vertices.push(a);
        for (corner, nibble) in [(b, pair >> 4), (c, pair & 15)] {
            if nibble == 0 || nibble == 15 {
                vertices.push(corner);
            }
        }
        corners.extend([a, b, c]);
    }
    stream.finish()?;
    Ok(corners)
}

/// Indices as differences from one of two running values.
fn indices(packed: &[u8], count: usize) -> Result<Vec<u32>> {
    let (mut stream, _) = ByteStream::open(packed, 0xd1, 4)?;
    if count > stream.bytes.len() {
        return Err(ends());
    }
    let mut running = [0_u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let value = stream.varint()?;
        let last = &mut running[(value & 1) as usize];
        *last = last.wrapping_add(value >> 2 ^ (value >> 1 & 1).wrapping_neg());
        indices.push(*last);
    }
    stream.finish()?;
    Ok(indices)
}

/// Indices as bytes of two or four each.
fn numbers(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// Changes rows of four 16-bit integers.
fn words(bytes: &mut [u8], change: impl Fn([i16; 4]) -> Vec<i16>) {
    for row in bytes.chunks_exact_mut(8) {
        let values = std::array::from_fn(|i| i16::from_le_bytes([row[2 * i], row[2 * i + 1]]));
        let changed: Vec<u8> = change(values).into_iter().flat_map(i16::to_le_bytes).collect();
        row.copy_from_slice(&changed);
    }
}

fn snorm16(x: f32) -> i16 {
    (x * 32_767.0).round() as i16
}

/// A unit vector from the unfolded faces of an octahedron; `one` is the integer that represents 1.
fn octahedral(x: f32, y: f32, one: f32) -> [f32; 3] {
    let (mut x, mut y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // The corners of the square are the lower half, turned over.
    let below = z.min(0.0);
    x -= below.copysign(x);
    y -= below.copysign(y);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|part| part / length)
}

/// A quaternion without its largest component, whose number is in the lowest two bits of the fourth value.
fn quaternion([x, y, z, scale]: [i16; 4]) -> [i16; 4] {
    let one = f32::from(scale | 3);
    let [x, y, z] = [x, y, z].map(|part| f32::from(part) / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (scale & 3) as usize;
    let mut parts = [0; 4];
    for (i, part) in [w, x, y, z].into_iter().enumerate() {
        parts[(largest + i) % 4] = snorm16(part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use serde_json::Value;

    /// Streams by meshoptimizer's encoder, with the results of its own decoder.
    const STREAMS: &str = include_str!("meshopt_streams.json");

    fn cases() -> Vec<(String, CompressedView, Vec<u8>, Vec<u8>)> {
        let cases: Vec<Value> = serde_json::from_str(STREAMS).expect("sound");
        let bytes = |case: &Value, key: &str| STANDARD.decode(case[key].as_str().expect("text")).expect("base64");
        let case = |case: Value| {
            let (packed, unpacked) = (bytes(&case, "packed"), bytes(&case, "unpacked"));
            let name = case["name"].as_str().expect("text").to_owned();
            let view = CompressedView {
                buffer: 0,
                byte_offset: 0,
                byte_length: packed.len() as u64,
                byte_stride: case["byteStride"].as_u64().expect("a number") as usize,
                count: case["count"].as_u64().expect("a number"),
                mode: serde_json::from_value(case["mode"].clone()).expect("a mode"),
                filter: serde_json::from_value(case["filter"].clone()).expect("a filter"),
            };
            (name, view, packed, unpacked)
        };
        cases.into_iter().map(case).collect()
    }

    #[test]
    fn streams_unpack_as_with_their_own_library() {
        let cases = cases();
        assert!(cases.len() >= 12, "{}", cases.len());
        for (name, view, packed, want) in cases {
            assert_eq!(view.unpacked_bytes().expect(&name), want.len() as u64);
            let got = view.unpack(&packed).unwrap_or_else(|error| panic!("{name}: {error}"));
            if view.filter == MeshoptFilter::None || view.filter == MeshoptFilter::Exponential {
                assert_eq!(got, want, "{name}");
                continue;
            }
            // Filters are exact to one unit in the last place.
            let values = |bytes: &[u8]| -> Vec<i32> {
                match view.byte_stride {
                    4 => bytes.iter().map(|&byte| i32::from(byte as i8)).collect(),
                    _ => bytes.chunks_exact(2).map(|word| i32::from(i16::from_le_bytes([word[0], word[1]]))).collect(),
                }
            };
            let apart = values(&got).into_iter().zip(values(&want)).map(|(a, b)| (a - b).abs()).max();
            assert!(apart.is_some_and(|apart| apart <= 1), "{name}: {apart:?}");
        }
    }

    #[test]
    fn damage_is_refused_or_read_and_never_panics() {
        let mut stream = syntable_model::random::Stream::root(5);
        for (name, view, packed, _) in cases() {
            for end in 0..packed.len() {
                assert!(view.unpack(&packed[..end]).is_err(), "{name} cut at {end}");
            }
            for _ in 0..200 {
                let mut damaged = packed.clone();
                let at = stream.below(damaged.len() as u64) as usize;
                damaged[at] = stream.below(256) as u8;
                let _ = view.unpack(&damaged);
            }
            let many = CompressedView { count: 3_000_000_000, ..view };
            assert!(many.unpack(&packed).is_err(), "{name}");
        }
    }
}
