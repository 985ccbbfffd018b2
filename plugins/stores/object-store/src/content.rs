//! The content of an object, read by ranges.

use crate::failure::io_error;
use crate::requests::{wait, whole};
use bytes::Bytes;
use futures_util::StreamExt;
use futures_util::stream::BoxStream;
use object_store::path::Path as Key;
use object_store::{GetOptions, GetRange, ObjectStore};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Bytes that one request reads after a seek.
const RANGE: u64 = 4 << 20;
/// Requests in a row that may fail before a read fails. Each was sent several times already.
const TRIES: u32 = 3;

/// An open object. All its bytes are of one version, or reading fails.
pub struct ObjectContent {
    store: Arc<dyn ObjectStore>,
    key: Key,
    size: u64,
    version: Option<String>,
    /// Where the next read begins.
    at: u64,
    /// The bytes that were read last, and where they begin.
    chunk: (u64, Bytes),
    /// The rest of an answer, and where it begins.
    answer: Option<(u64, BoxStream<'static, object_store::Result<Bytes>>)>,
}

impl ObjectContent {
    /// Opens an object at its beginning, with one request.
    pub fn open(store: Arc<dyn ObjectStore>, key: Key) -> object_store::Result<Self> {
        let answer = wait(whole(|| store.get_opts(&key, GetOptions::default())))?;
        let (size, version) = (answer.meta.size, answer.meta.e_tag.clone());
        let answer = Some((0, answer.into_stream()));
        Ok(Self { store, key, size, version, at: 0, chunk: (0, Bytes::new()), answer })
    }

    /// Its size, bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Its entity tag, if the store has one.
    pub fn version(&self) -> Option<&str> {
        self.version.as_deref()
    }

    /// Gets the bytes at the next read.
    fn fetch(&mut self) -> object_store::Result<()> {
        if let Some((at, mut answer)) = self.answer.take().filter(|(at, _)| *at == self.at) {
            // A connection that ended early is not the end: another request gets the rest.
            if let Some(Ok(bytes)) = wait(answer.next()) {
                self.answer = Some((at + bytes.len() as u64, answer));
                self.chunk = (at, bytes);
                return Ok(());
            }
        }
        let range = GetRange::Bounded(self.at..self.size.min(self.at + RANGE));
        let options = GetOptions { range: Some(range), if_match: self.version.clone(), ..GetOptions::default() };
        let bytes = wait(async { self.store.get_opts(&self.key, options).await?.bytes().await })?;
        self.chunk = (self.at, bytes);
        Ok(())
    }
}

impl Read for ObjectContent {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.at >= self.size || buffer.is_empty() {
            return Ok(0);
        }
        let mut tries = 0;
        loop {
            let (start, bytes) = &self.chunk;
            if self.at >= *start && self.at < start + bytes.len() as u64 {
                let rest = &bytes[(self.at - start) as usize..];
                let length = rest.len().min(buffer.len());
                buffer[..length].copy_from_slice(&rest[..length]);
                self.at += length as u64;
                return Ok(length);
            }
            match self.fetch() {
                Ok(()) if self.chunk.1.is_empty() => tries += 1,
                Ok(()) => {}
                Err(object_store::Error::Precondition { .. }) => {
                    return Err(io::Error::new(ErrorKind::InvalidData, "the object was replaced while it was read"));
                }
                Err(error) if tries + 1 >= TRIES => return Err(io_error(&error)),
                Err(_) => tries += 1,
            }
            if tries >= TRIES {
                return Err(io::Error::new(ErrorKind::UnexpectedEof, "the store sent fewer bytes than the object has"));
            }
        }
    }
}

impl Seek for ObjectContent {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.size.checked_add_signed(by),
        };
        self.at = at.ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "a seek before the first byte"))?;
        Ok(self.at)
    }
}
