//! Content digests: 128 bits of BLAKE3, written as 32 hexadecimal digits.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::Read;

/// A digest of content: equal content, equal digest, on any machine.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Digest([u8; 16]);

impl Digest {
    /// The digest of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Hasher::new("bytes").bytes(bytes).finish()
    }

    /// The digest of all bytes of a reader, and the number of these bytes. It is the plain BLAKE3 hash of the content,
    /// cut to 32 hexadecimal digits, as `b3sum` prints it.
    pub fn of_reader(reader: impl Read) -> std::io::Result<(Self, u64)> {
        of_parts(reader, 1 << 16, |hasher, part| {
            hasher.update(part);
        })
    }

    /// As [`of_reader`](Self::of_reader), on all threads of rayon's current pool. While it waits, the thread may run other jobs
    /// of the pool, so the caller must hold no lock that these need.
    pub fn of_reader_on_threads(reader: impl Read) -> std::io::Result<(Self, u64)> {
        of_parts(reader, 1 << 22, |hasher, part| {
            hasher.update_rayon(part);
        })
    }

    /// The first eight bytes as a number: a key for tables in memory.
    pub fn short(&self) -> u64 {
        u64::from_le_bytes(self.0[..8].try_into().expect("a digest has 16 bytes"))
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a digest of 32 hexadecimal letters");
        if text.len() != 32 || !text.is_ascii() {
            return Err(wrong());
        }
        let mut bytes = [0; 16];
        for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
            let pair = std::str::from_utf8(pair).map_err(|_| wrong())?;
            *byte = u8::from_str_radix(pair, 16).map_err(|_| wrong())?;
        }
        Ok(Self(bytes))
    }
}

/// The digest of a reader, by a function that adds parts of at most `size` bytes to the hash.
fn of_parts(
    mut reader: impl Read,
    size: u64,
    add: impl Fn(&mut blake3::Hasher, &[u8]),
) -> std::io::Result<(Digest, u64)> {
    let (mut hasher, mut part, mut all) = (blake3::Hasher::new(), Vec::new(), 0);
    loop {
        part.clear();
        let read = reader.by_ref().take(size).read_to_end(&mut part)? as u64;
        add(&mut hasher, &part);
        all += read;
        if read < size {
            return Ok((Hasher(hasher).finish(), all));
        }
    }
}

/// Builds a [`Digest`] from parts. Every part is length-prefixed, so that parts cannot run into each other.
pub struct Hasher(blake3::Hasher);

impl Hasher {
    /// Starts a digest for a purpose; digests of different purposes never agree.
    pub fn new(purpose: &str) -> Self {
        Self(blake3::Hasher::new()).bytes(purpose.as_bytes())
    }

    /// Adds bytes.
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds text.
    pub fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    /// Adds a number.
    pub fn number(self, number: f64) -> Self {
        self.bytes(&number.to_bits().to_le_bytes())
    }

    /// Adds another digest.
    pub fn digest(self, digest: Digest) -> Self {
        self.bytes(&digest.0)
    }

    /// Adds numbers, as in vertex positions.
    pub fn floats(mut self, floats: impl ExactSizeIterator<Item = f32>) -> Self {
        self.0.update(&(floats.len() as u64).to_le_bytes());
        for float in floats {
            self.0.update(&float.to_bits().to_le_bytes());
        }
        self
    }

    /// The digest of all parts.
    pub fn finish(self) -> Digest {
        Digest(self.0.finalize().as_bytes()[..16].try_into().expect("BLAKE3 gives 32 bytes"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_gives_plain_blake3() {
        // The published digest of no bytes, and of 1024 bytes 0, 1, …, 250, 0, … (test_vectors.json of BLAKE3).
        let of = |bytes: &[u8]| Digest::of_reader(bytes).expect("readable");
        assert_eq!(of(&[]).0.to_string(), "af1349b9f5f9a1a6a0404dea36dcc949");
        let bytes: Vec<u8> = (0..1024_u32).map(|i| (i % 251) as u8).collect();
        let (digest, size) = of(&bytes);
        assert_eq!((digest.to_string().as_str(), size), ("42214739f095a406f3fc83deb889744a", 1024));
    }

    /// Parts of odd sizes, by one call of the hash and by both readers.
    #[test]
    fn readers_agree_with_one_hash_whatever_the_size() {
        struct Odd<'a>(&'a [u8]);
        impl Read for Odd<'_> {
            fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
                let count = to.len().min(9_973);
                self.0.read(&mut to[..count])
            }
        }
        let all: Vec<u8> = (0..9 << 20_u32).map(|i| (i % 251) as u8).collect();
        for size in [0, 1, (1 << 16) - 1, 1 << 16, (1 << 16) + 1, (1 << 22) - 1, 1 << 22, (1 << 22) + 1, all.len()] {
            let content = &all[..size];
            let expected = (blake3::hash(content).to_hex()[..32].to_owned(), size as u64);
            let text = |(digest, size): (Digest, u64)| (digest.to_string(), size);
            assert_eq!(text(Digest::of_reader(Odd(content)).expect("in memory")), expected);
            assert_eq!(text(Digest::of_reader_on_threads(Odd(content)).expect("in memory")), expected);
        }
    }

    #[test]
    fn text_round_trip_and_separation() {
        let digest = Hasher::new("t").text("ab").text("c").finish();
        assert_ne!(digest, Hasher::new("t").text("a").text("bc").finish());
        assert_eq!(Digest::try_from(digest.to_string()), Ok(digest));
        assert!(Digest::try_from("é".repeat(16)).is_err());
    }
}
