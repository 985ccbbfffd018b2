//! A part of a file in memory, which moves towards the end of the file.

use std::cell::RefCell;
use std::io::{self, Read};
use syntable_model::mirror::DatasetFile;

/// Least number of bytes that are read at once.
const PART: usize = 1 << 18;

/// The bytes of a file that were read and not yet consumed.
pub(crate) struct Window {
    file: DatasetFile,
    bytes: Vec<u8>,
    /// Number of consumed bytes in `bytes`.
    consumed: usize,
    /// Offset in the file of the first byte that is not consumed.
    at: u64,
    is_at_end: bool,
}

impl Window {
    /// The start of a file.
    pub fn new(file: DatasetFile) -> Self {
        Self { file, bytes: Vec::new(), consumed: 0, at: 0, is_at_end: false }
    }

    /// Offset in the file of the first byte that is not consumed.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Whether the window reaches to the end of the file.
    pub fn is_at_end(&self) -> bool {
        self.is_at_end
    }

    /// The bytes that are not consumed.
    pub fn rest(&self) -> &[u8] {
        &self.bytes[self.consumed..]
    }

    /// The first of these bytes.
    pub fn up_to(&self, most: usize) -> &[u8] {
        let rest = self.rest();
        &rest[..rest.len().min(most)]
    }

    /// Reads until the window has a number of bytes that are not consumed, or the file ends.
    pub fn fill(&mut self, count: usize) -> io::Result<()> {
        if self.rest().len() >= count || self.is_at_end {
            return Ok(());
        }
        self.bytes.drain(..std::mem::take(&mut self.consumed));
        let wanted = count.max(PART) - self.bytes.len();
        let read = (&mut self.file).take(wanted as u64).read_to_end(&mut self.bytes)?;
        self.is_at_end = read < wanted;
        Ok(())
    }

    /// Consumes bytes of the window.
    pub fn consume(&mut self, count: usize) {
        self.consumed += count;
        self.at += count as u64;
    }

    /// The next byte of JSON, after white space, which is consumed; none at the end of the file.
    pub fn next_byte(&mut self) -> io::Result<Option<u8>> {
        loop {
            let is_space = |byte: &u8| matches!(byte, b' ' | b'\n' | b'\t' | b'\r');
            let spaces = self.rest().iter().take_while(|byte| is_space(byte)).count();
            self.consume(spaces);
            match self.rest().first() {
                Some(byte) => return Ok(Some(*byte)),
                None if self.is_at_end => return Ok(None),
                None => self.fill(1)?,
            }
        }
    }
}

/// Consumes the bytes that a parser reads.
pub(crate) struct WindowReader<'w>(pub &'w RefCell<Window>);

impl Read for WindowReader<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut window = self.0.borrow_mut();
        window.fill(1)?;
        let count = window.up_to(bytes.len()).read(bytes)?;
        window.consume(count);
        Ok(count)
    }
}
