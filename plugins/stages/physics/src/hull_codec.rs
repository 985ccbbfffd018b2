//! Binary format of cached convex parts. Floats keep their bits.

use crate::decompose::ConvexParts;
use syntable_convex::ConvexHull;

const MAGIC: u32 = u32::from_le_bytes(*b"cvx2");

/// Encodes parts: magic, number of parts and their deviation; then per part the numbers of vertices and triangles, 3
/// f32 per vertex and 3 u32 per triangle; all little-endian.
pub fn encode(parts: &ConvexParts) -> Vec<u8> {
    let mut words = vec![MAGIC, parts.hulls.len() as u32, parts.deviation_m.to_bits()];
    for part in &parts.hulls {
        words.extend([part.points.len() as u32, part.triangles.len() as u32]);
        words.extend(part.points.iter().flatten().map(|x| x.to_bits()));
        words.extend(part.triangles.iter().flatten());
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Decodes parts. Returns `None` for bytes that [`encode`] did not write: truncated, of another version, or damaged.
pub fn decode(bytes: &[u8]) -> Option<ConvexParts> {
    let (chunks, rest) = bytes.as_chunks::<4>();
    if !rest.is_empty() {
        return None;
    }
    let mut words = chunks.iter().map(|chunk| u32::from_le_bytes(*chunk));
    if words.next()? != MAGIC {
        return None;
    }
    let count = words.next()? as usize;
    let deviation_m = f32::from_bits(words.next()?);
    let mut hulls = Vec::new();
    for _ in 0..count {
        let (vertices, triangles) = (words.next()? as usize, words.next()? as usize);
        if words.len() / 3 < vertices.checked_add(triangles)? {
            return None;
        }
        let mut triple = || Some([words.next()?, words.next()?, words.next()?]);
        let points: Option<Vec<_>> = (0..vertices).map(|_| triple().map(|xyz| xyz.map(f32::from_bits))).collect();
        let triangles: Option<Vec<_>> = (0..triangles).map(|_| triple()).collect();
        let part = ConvexHull { points: points?, triangles: triangles? };
        let is_valid = part.points.iter().flatten().all(|x| x.is_finite())
            && part.triangles.iter().flatten().all(|&i| (i as usize) < vertices);
        if !is_valid {
            return None;
        }
        hulls.push(part);
    }
    let is_valid = !hulls.is_empty() && deviation_m.is_finite() && words.next().is_none();
    is_valid.then_some(ConvexParts { hulls, deviation_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units;

    #[test]
    fn bits_survive_and_damage_is_detected() {
        let cube: Vec<[f32; 3]> =
            (0..8).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -0.1 } else { 1.0 / 3.0 })).collect();
        let hulls = vec![units::hull(&cube).expect("a hull"), units::hull(&cube[..5]).expect("a hull")];
        let parts = ConvexParts { hulls, deviation_m: 0.1 + 0.2 };
        let bytes = encode(&parts);
        let back = decode(&bytes).expect("reads back");
        assert_eq!(encode(&back), bytes);
        for cut in 0..bytes.len() {
            assert_eq!(decode(&bytes[..cut]), None, "cut at {cut}");
        }
        let mut longer = bytes.clone();
        longer.extend([0; 4]);
        assert_eq!(decode(&longer), None);
        for word in 0..bytes.len() / 4 {
            let mut damaged = bytes.clone();
            damaged[4 * word..4 * word + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert_eq!(decode(&damaged), None, "word {word}");
        }
    }
}
