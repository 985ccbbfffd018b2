//! Buffers, buffer views and images of a document, resolved and checked.

use super::items::get;
use super::meshopt::CompressedView;
use crate::formats::within;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, Engine, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::accessor::Accessor;
use gltf::json::{self, Index, Root};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;
use syntable_mesh::root::AssetRoot;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};

/// The extension that packs buffer views.
const MESHOPT: &str = "EXT_meshopt_compression";

/// Data outside the JSON, loaded on demand.
pub struct GltfBuffers<'a> {
    document: &'a Root,
    binary: Option<&'a [u8]>,
    root: &'a AssetRoot,
    folder: &'a Path,
    file: &'a Path,
    log: &'a dyn Log,
    loaded: BTreeMap<usize, Vec<u8>>,
    /// Views that were unpacked.
    unpacked: BTreeMap<usize, Vec<u8>>,
    /// Accessors of the current primitive that were unpacked.
    pub unpacked_arrays: UnpackedArrays,
}

/// Bytes with the elements of an accessor.
pub struct Elements<'a> {
    pub bytes: &'a [u8],
    /// Offset of the first element.
    pub offset: u64,
    /// Distance of elements, if stated.
    pub stride: Option<usize>,
}

/// Elements of accessors that have no view of their own.
#[derive(Default)]
pub struct UnpackedArrays {
    /// Number of elements of each array.
    pub count: u64,
    /// Elements by accessor, without gaps.
    pub bytes: BTreeMap<usize, Vec<u8>>,
}

impl<'a> GltfBuffers<'a> {
    /// Data of a document in a folder, relative to the root; `binary` is the chunk of a GLB, `file` for messages.
    pub fn new(
        document: &'a Root,
        binary: Option<&'a [u8]>,
        root: &'a AssetRoot,
        folder: &'a Path,
        file: &'a Path,
        log: &'a dyn Log,
    ) -> Self {
        Self {
            document,
            binary,
            root,
            folder,
            file,
            log,
            loaded: BTreeMap::new(),
            unpacked: BTreeMap::new(),
            unpacked_arrays: UnpackedArrays::default(),
        }
    }

    /// The file, for messages.
    pub fn file(&self) -> &'a Path {
        self.file
    }

    /// Number of elements of an accessor: of its unpacked elements, or as stated.
    pub fn count(&self, index: Index<Accessor>) -> Result<u64> {
        match self.unpacked_arrays.bytes.contains_key(&index.value()) {
            true => Ok(self.unpacked_arrays.count),
            false => Ok(get(&self.document.accessors, index, "accessor")?.count.0),
        }
    }

    /// The elements of an accessor; `None` if it has neither unpacked elements nor a view.
    pub fn elements(&mut self, index: Index<Accessor>) -> Result<Option<Elements<'_>>> {
        if self.unpacked_arrays.bytes.contains_key(&index.value()) {
            let bytes = self.unpacked_arrays.bytes.get(&index.value());
            return Ok(bytes.map(|bytes| Elements { bytes, offset: 0, stride: None }));
        }
        let accessor = get(&self.document.accessors, index, "accessor")?;
        let Some(view) = accessor.buffer_view else { return Ok(None) };
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        self.view(view).map(|(bytes, stride)| Some(Elements { bytes, offset, stride }))
    }

    /// The asset's remaining budget.
    pub fn budget(&self) -> &'a Budget {
        self.root.budget()
    }

    /// Bytes of a view and their stride, if stated. Checked against the buffer, and the buffer against its file.
    pub fn view(&mut self, index: Index<json::buffer::View>) -> Result<(&[u8], Option<usize>)> {
        let view = get(&self.document.buffer_views, index, "buffer view")?;
        let packed = view.extensions.as_ref().and_then(|extensions| extensions.others.get(MESHOPT));
        if let Some(packed) = packed {
            let within = |error| within(error, format!("buffer view {} ({MESHOPT})", index.value()));
            let packed = CompressedView::deserialize(packed).map_err(|error| within(Error::new(error.to_string())))?;
            if !self.unpacked.contains_key(&index.value()) {
                let bytes = self.unpack(&packed).map_err(within)?;
                self.unpacked.insert(index.value(), bytes);
            }
            let bytes = self.unpacked.get(&index.value()).map(Vec::as_slice).unwrap_or_default();
            return Ok((bytes, Some(packed.byte_stride)));
        }
        let (offset, length) = (view.byte_offset.map_or(0, |offset| offset.0), view.byte_length.0);
        let stride = view.byte_stride.map(|stride| stride.0);
        let (buffer, bytes) = (view.buffer.value(), self.buffer(view.buffer)?);
        let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
        match end {
            Some(end) => Ok((&bytes[offset as usize..end as usize], stride)),
            None => Err(Error::new(format!(
                "buffer view {} reaches from byte {offset} over {length} bytes, but buffer {buffer} has {}",
                index.value(),
                bytes.len()
            ))),
        }
    }

    fn unpack(&mut self, packed: &CompressedView) -> Result<Vec<u8>> {
        self.budget().bytes(packed.unpacked_bytes()?)?;
        let bytes = self.buffer(Index::new(packed.buffer))?;
        let end = packed.byte_offset.checked_add(packed.byte_length).filter(|&end| end <= bytes.len() as u64);
        match end {
            Some(end) => packed.unpack(&bytes[packed.byte_offset as usize..end as usize]),
            None => Err(Error::new(format!(
                "the view reaches from byte {} over {} bytes, but buffer {} has {}",
                packed.byte_offset,
                packed.byte_length,
                packed.buffer,
                bytes.len()
            ))),
        }
    }

    fn buffer(&mut self, index: Index<json::Buffer>) -> Result<&[u8]> {
        let buffer = get(&self.document.buffers, index, "buffer")?;
        let number = index.value();
        if buffer.uri.is_some() && !self.loaded.contains_key(&number) {
            let bytes = self.resolve(buffer.uri.as_deref().unwrap_or_default(), &format!("buffer {number}"))?;
            let bytes = bytes.ok_or_else(|| {
                Error::new(format!(
                    "buffer {number} refers to the missing file `{}`",
                    shown(buffer.uri.as_deref().unwrap_or_default())
                ))
            })?;
            self.loaded.insert(number, bytes);
        }
        let bytes: &[u8] = match (self.loaded.get(&number), self.binary) {
            (Some(bytes), _) => bytes,
            (None, Some(binary)) if number == 0 => binary,
            _ => return Err(Error::new(format!("buffer {number} has neither a file nor a binary chunk"))),
        };
        // A GLB chunk is padded, so there may be more bytes than stated.
        let stated = buffer.byte_length.0;
        usize::try_from(stated).ok().and_then(|stated| bytes.get(..stated)).ok_or_else(|| {
            let of = buffer.uri.as_deref().map_or("its chunk".into(), |uri| format!("`{}`", shown(uri)));
            Error::new(format!("buffer {number} declares {stated} bytes, but {of} has {}", bytes.len()))
        })
    }

    /// An image; `None` if its file is missing.
    pub fn image(&mut self, index: Index<json::Image>) -> Result<Option<DecodedImage>> {
        let image = get(&self.document.images, index, "image")?;
        let what = format!("image {}", index.value());
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                let Some(bytes) = self.resolve(uri, &what)? else {
                    return Ok(None);
                };
                let named = |error: Error| {
                    if uri.starts_with("data:") { within(error, &what) } else { error.in_file(self.folder_of(uri)) }
                };
                DecodedImage::decode(&bytes, self.budget()).map(Some).map_err(named)
            }
            (None, Some(view)) => {
                let budget = self.budget();
                let (bytes, _) = self.view(view).map_err(|error| within(error, &what))?;
                DecodedImage::decode(bytes, budget).map(Some).map_err(|error| within(error, &what))
            }
            (None, None) => Err(Error::new(format!("{what} has neither a file nor a buffer view"))),
        }
    }

    fn folder_of(&self, uri: &str) -> std::path::PathBuf {
        self.root.folder().join(self.folder).join(percent_decode(uri))
    }

    /// Bytes of a data URI, or of a file inside the asset's folder; `None` if the file is missing.
    fn resolve(&self, uri: &str, what: &str) -> Result<Option<Vec<u8>>> {
        let named = |error: Error| within(error, what);
        if let Some(data) = uri.strip_prefix("data:") {
            let (head, body) = data.split_once(',').ok_or_else(|| named(Error::new("the data URI has no data")))?;
            if !head.ends_with(";base64") {
                return Err(named(Error::new("the data URI is not encoded in base64")));
            }
            self.budget().bytes(body.len() as u64).map_err(named)?;
            return decode_base64(body).map(Some).map_err(named);
        }
        match self.root.find(self.folder, &percent_decode(uri)).map_err(named)? {
            Some(found) => {
                let path = found.noted(|note| self.log.warn(&named(note).in_file(self.file)));
                self.root.read(&path).map(Some).map_err(named)
            }
            None => Ok(None),
        }
    }
}

/// Decodes base64 of either alphabet (RFC 4648). White space is ignored; padding is optional.
fn decode_base64(text: &str) -> Result<Vec<u8>> {
    const LENIENT: GeneralPurposeConfig = GeneralPurposeConfig::new()
        .with_decode_allow_trailing_bits(true)
        .with_decode_padding_mode(DecodePaddingMode::Indifferent);
    const ENGINE: GeneralPurpose = GeneralPurpose::new(&alphabet::STANDARD, LENIENT);
    let standard = |letter: u8| match letter {
        b'-' => b'+',
        b'_' => b'/',
        other => other,
    };
    let letters: Vec<u8> = text.bytes().filter(|letter| !letter.is_ascii_whitespace()).map(standard).collect();
    ENGINE.decode(letters).map_err(|error| Error::new(format!("not valid base64: {error}")))
}

/// Replaces `%20` and the like; anything else stays.
fn percent_decode(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let digit = |i: usize| bytes.get(at + i).and_then(|&b| char::from(b).to_digit(16));
        match (bytes[at], digit(1), digit(2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

fn shown(uri: &str) -> String {
    syntable_mesh::text::shorten(uri)
}

#[cfg(test)]
mod tests {
    #[test]
    fn percent_codes() {
        assert_eq!(super::percent_decode("a%20b%C3%A4%2e%zz%"), "a bä.%zz%");
    }

    #[test]
    fn the_vectors_of_rfc_4648() {
        for (text, want) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob"), ("Zm9v\nYmFy", "foobar")]
        {
            assert_eq!(super::decode_base64(text).expect(text), want.as_bytes(), "{text}");
        }
        assert_eq!(super::decode_base64("-_8").expect("URL-safe"), [0xfb, 0xff]);
        for wrong in ["Zm9*", "Zg==Zg==", "A"] {
            assert!(super::decode_base64(wrong).is_err(), "{wrong}");
        }
    }
}
