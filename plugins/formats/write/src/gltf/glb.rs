//! A document with its binary data, and their container (GLB 2).

use super::document::{Accessor, Buffer, BufferView, Document, Index};
use syntable_model::error::{Error, Result};

const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
const U16: u32 = 5_123;
const U32: u32 = 5_125;
const F32: u32 = 5_126;

/// A document and its buffer.
#[derive(Debug, Clone, Default)]
pub struct Glb {
    pub document: Document,
    bytes: Vec<u8>,
}

impl Glb {
    /// Adds bytes to the buffer, aligned to four.
    pub fn view(&mut self, bytes: impl IntoIterator<Item = u8>, target: Option<u32>) -> Index {
        let byte_offset = self.bytes.len();
        self.bytes.extend(bytes);
        let byte_length = self.bytes.len() - byte_offset;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.document.buffer_views.push(BufferView { buffer: 0, byte_offset, byte_length, target });
        self.document.buffer_views.len() - 1
    }

    /// Adds vectors of two to four numbers. `bounded` also states their bounds, as the standard requires of positions.
    pub fn vectors<const N: usize>(&mut self, vectors: &[[f32; N]], bounded: bool) -> Index {
        let buffer_view = self.view(vectors.iter().flatten().flat_map(|x| x.to_le_bytes()), Some(ARRAY_BUFFER));
        let bound = |start: f32, pick: fn(f32, f32) -> f32| {
            bounded.then(|| {
                let mut bound = [start; 3];
                for vector in vectors {
                    for (bound, &x) in bound.iter_mut().zip(vector) {
                        *bound = pick(*bound, x);
                    }
                }
                bound
            })
        };
        self.accessor(Accessor {
            buffer_view,
            component_type: F32,
            count: vectors.len(),
            kind: ["VEC2", "VEC3", "VEC4"][N.clamp(2, 4) - 2],
            min: bound(f32::INFINITY, f32::min),
            max: bound(f32::NEG_INFINITY, f32::max),
        })
    }

    /// Adds indices into `vertices` vertices.
    pub fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> Index {
        let corners = triangles.iter().flatten();
        // The largest value of a type is not a valid index.
        let (component_type, buffer_view) = if vertices <= usize::from(u16::MAX) {
            (U16, self.view(corners.flat_map(|&i| (i as u16).to_le_bytes()), Some(ELEMENT_ARRAY_BUFFER)))
        } else {
            (U32, self.view(corners.flat_map(|&i| i.to_le_bytes()), Some(ELEMENT_ARRAY_BUFFER)))
        };
        let count = 3 * triangles.len();
        self.accessor(Accessor { buffer_view, component_type, count, kind: "SCALAR", min: None, max: None })
    }

    fn accessor(&mut self, accessor: Accessor) -> Index {
        self.document.accessors.push(accessor);
        self.document.accessors.len() - 1
    }

    /// The bytes of the file.
    pub fn into_bytes(mut self) -> Result<Vec<u8>> {
        if !self.bytes.is_empty() {
            self.document.buffers = vec![Buffer { byte_length: self.bytes.len() }];
        }
        let mut json = serde_json::to_vec(&self.document)
            .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + json.len() + 8 + self.bytes.len();
        let word = |size: usize| -> Result<[u8; 4]> {
            let size = u32::try_from(size).map_err(|_| {
                Error::new(format!("{size} bytes are more than a GLB file can hold"))
                    .help("use smaller textures or fewer objects, or remove the gltf writer")
            })?;
            Ok(size.to_le_bytes())
        };
        let mut file = Vec::with_capacity(length);
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend(word(length)?);
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", self.bytes)] {
            file.extend(word(chunk.len())?);
            file.extend(kind);
            file.extend(chunk);
        }
        Ok(file)
    }
}
