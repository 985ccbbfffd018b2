//! Messages and answers: NumPy archives with a length.

use std::io::{self, Read};
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::npz;
use syntable_formats::npz_archive::IDS;
use syntable_formats::record_arrays;
use syntable_model::limits::MEMBER_BYTES;
use syntable_model::prelude::*;

/// First letters of a message, with the version.
pub const START: [u8; 4] = *b"SYN1";
/// Prefix of the names of arrays that messages reserve.
pub const RESERVED: &str = "syntable_";
/// Array of an answer that ends the run: a text.
pub const ERROR: &str = "syntable_error";
/// Array of an answer: texts that become warnings.
pub const WARNINGS: &str = "syntable_warnings";
/// Array of an answer: the number of the message.
pub const NUMBER: &str = "syntable_number";
/// Array of the answer of a writer: a text that it gets at the end.
pub const RECORD: &str = "syntable_record";

/// A message that is composed.
pub struct Message(Vec<(String, Array)>);

impl Message {
    /// A message of a kind: `start`, `view` or `finish`.
    pub fn new(kind: &str) -> Self {
        Self(Vec::new()).text("message", kind)
    }

    /// Adds its number, which its answer repeats.
    pub fn numbered(self, number: u64) -> Self {
        self.integers("number", &[number], false)
    }

    /// Adds an array that is no product.
    pub fn with(mut self, name: &str, array: Array) -> Self {
        self.0.push((format!("{RESERVED}{name}"), array));
        self
    }

    /// Adds a text.
    pub fn text(self, name: &str, text: &str) -> Self {
        self.with(name, Array::text(text))
    }

    /// Adds a list of texts.
    pub fn texts<'t>(self, name: &str, texts: impl IntoIterator<Item = &'t str>) -> Self {
        self.with(name, Array::texts(&texts.into_iter().collect::<Vec<_>>()))
    }

    /// Adds bytes.
    pub fn bytes(self, name: &str, bytes: Vec<u8>) -> Self {
        self.with(name, Array { descr: "|u1".into(), shape: vec![bytes.len()], bytes })
    }

    /// Adds integers without a sign, along one axis, or as a single number.
    pub fn integers(self, name: &str, numbers: &[u64], is_list: bool) -> Self {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let shape = if is_list { vec![numbers.len()] } else { Vec::new() };
        self.with(name, Array { descr: "<u8".into(), shape, bytes })
    }

    /// Adds the number of a scene and of a view, the size of the image and the seed.
    pub fn of_view(self, cx: &ImageContext, stream: &Stream) -> Self {
        let [width, height] = cx.size.map(u64::from);
        let seed = stream.at(cx.scene_id.0.into()).at(cx.view_id.0.into()).seed();
        self.integers("scene", &[cx.scene_id.0.into()], false)
            .integers("view", &[cx.view_id.0.into()], false)
            .integers("size", &[height, width], true)
            .integers("seed", &[seed], false)
    }

    /// Adds products, and the ids of the instances along their first axes.
    ///
    /// # Errors
    /// If a product has no arrays, or two products are of different instances.
    pub fn products(
        mut self,
        [width, height]: [u32; 2],
        products: &Products,
    ) -> Result<(Self, Option<Vec<InstanceId>>)> {
        let mut ids: Option<(KeyId, Array)> = None;
        for key in products.keys() {
            let name = key.to_string();
            let arrays = record_arrays::arrays(&name, &key, &products.value(&key)?, [height as usize, width as usize])?;
            self.0.extend(arrays.arrays);
            match (&ids, arrays.ids) {
                (None, of) => ids = of.map(|of| (key, of)),
                (Some((_, same)), Some(of)) if *same != of => {
                    let (first, _) = ids.as_ref().expect("just matched");
                    return Err(Error::new(format!("`{first}` and `{key}` are of different objects"))
                        .help("read them in two stages of the kind exec"));
                }
                _ => {}
            }
        }
        let ids = ids.map(|(_, ids)| ids);
        let numbers =
            ids.as_ref().map(|ids| ids.bytes.as_chunks().0.iter().map(|id| InstanceId(u16::from_le_bytes(*id))));
        let numbers = numbers.map(Iterator::collect);
        self.0.extend(ids.map(|ids| (IDS.to_owned(), ids)));
        Ok((self, numbers))
    }

    /// The bytes of the message.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let archive = npz::encode(self.0.iter().map(|(name, array)| (name.as_str(), array)), false)?;
        let length = u32::try_from(archive.len()).map_err(|_| {
            Error::new(format!("a message has {} bytes, more than 4 GiB", archive.len()))
                .help("read fewer products, or compact ones: visible_ids and amodal_bits instead of masks; keep shorter records")
        })?;
        let mut bytes = Vec::with_capacity(START.len() + size_of::<u32>() + archive.len());
        bytes.extend_from_slice(&START);
        bytes.extend_from_slice(&length.to_le_bytes());
        bytes.extend_from_slice(&archive);
        Ok(bytes)
    }
}

/// Why no answer could be read.
pub enum Unread {
    /// The output ended, or cannot be read.
    Ended,
    /// The output is no answer.
    Wrong(Error),
}

/// Reads the archive of an answer.
pub fn read(output: &mut impl Read) -> Result<Vec<u8>, Unread> {
    let mut start = [0; 8];
    let mut filled = 0;
    while filled < start.len() {
        match output.read(&mut start[filled..]) {
            Ok(0) if filled == 0 => return Err(Unread::Ended),
            Ok(0) => break,
            Ok(more) => filled += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return Err(Unread::Ended),
        }
        // Text that was printed by mistake may be shorter than the start of an answer.
        let seen = filled.min(START.len());
        if start[..seen] != START[..seen] {
            return Err(Unread::Wrong(unlike(&start[..filled])));
        }
    }
    let length = u32::from_le_bytes([start[4], start[5], start[6], start[7]]);
    if filled < start.len() {
        return Err(Unread::Ended);
    }
    MEMBER_BYTES.check(length.into()).map_err(|error| Unread::Wrong(error.context("its answer")))?;
    let mut archive = Vec::new();
    match output.take(length.into()).read_to_end(&mut archive) {
        Ok(read) if read == length as usize => Ok(archive),
        _ => Err(Unread::Ended),
    }
}

/// The error of an output that begins otherwise than an answer.
fn unlike(start: &[u8]) -> Error {
    match start.split_at_checked(3) {
        Some((b"SYN", [version, ..])) if version.is_ascii_digit() => {
            Error::new(format!("its answer has version {} of the messages", char::from(*version)))
                .help("this program speaks version 1")
        }
        _ => {
            let text = String::from_utf8_lossy(start);
            Error::new(format!("its output begins with {text:?}, and an answer with \"SYN1\""))
                .help("standard output carries the answers alone: print to standard error")
        }
    }
}
