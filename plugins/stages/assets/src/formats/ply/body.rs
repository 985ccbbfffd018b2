//! The body of a PLY file, row by row, number by number.

use super::header::{Element, PlyEncoding, PlyHeader, PlyScalar};
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};

/// Maximum length of a list that is ignored.
pub const LIST_LIMIT: usize = 1 << 20;

/// A position in the body.
pub struct PlyRows<'a> {
    encoding: PlyEncoding,
    bytes: &'a [u8],
    /// Next byte.
    at: usize,
    /// In text: the number of the next line, and the rest of the current one.
    line: usize,
    rest: &'a [u8],
    /// The first line with more numbers than the header declares, and the number of such lines.
    longer: Option<(usize, usize)>,
}

impl<'a> PlyRows<'a> {
    /// The start of the body.
    pub fn new(header: &PlyHeader, bytes: &'a [u8]) -> Self {
        Self { encoding: header.encoding, bytes, at: header.body, line: header.body_line, rest: &[], longer: None }
    }

    /// Whether the body is text.
    pub fn is_text(&self) -> bool {
        self.encoding == PlyEncoding::Ascii
    }

    /// Refuses an element whose rows exceed the rest of the file, before allocating memory for them.
    pub fn check_size(&self, element: &Element) -> Result<()> {
        let row: usize = match self.encoding {
            // Each number takes at least a digit and a separator; the last line may lack its end.
            PlyEncoding::Ascii => 2 * element.properties.len().max(1),
            _ => element
                .properties
                .iter()
                .map(|property| match property.list {
                    None => property.scalar.size(),
                    Some(length) => length.size(),
                })
                .sum(),
        };
        let (need, left) = (element.count as u128 * row as u128, self.bytes.len() - self.at);
        let slack = usize::from(self.encoding == PlyEncoding::Ascii);
        // Rows without properties take no bytes, but time.
        if need > (left + slack) as u128 || (row == 0 && element.count > left) {
            return Err(Error::new(format!(
                "{} rows of element `{}` need at least {need} bytes, but {left} are left",
                element.count,
                shorten(&element.name)
            ))
            .at_byte(self.at as u64)
            .help("the file is cut short, or its header is wrong"));
        }
        Ok(())
    }

    /// Adds the current line or byte to an error.
    pub fn place(&self, error: Error) -> Error {
        match self.encoding {
            PlyEncoding::Ascii => error.at_line(self.line.saturating_sub(1)),
            _ => error.at_byte(self.at as u64),
        }
    }

    /// Starts a row.
    pub fn begin(&mut self, element: &Element, row: usize) -> Result<()> {
        if self.encoding != PlyEncoding::Ascii {
            return Ok(());
        }
        loop {
            if self.at >= self.bytes.len() {
                let message = format!(
                    "the file ends before row {row} of {} of element `{}`",
                    element.count,
                    shorten(&element.name)
                );
                return Err(self.place(Error::new(message)));
            }
            let rest = &self.bytes[self.at..];
            let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            self.rest = rest[..end].trim_ascii();
            self.at += end + 1;
            self.line += 1;
            // A row without properties is an empty line; other empty lines are skipped.
            if !self.rest.is_empty() || element.properties.is_empty() {
                self.at = self.at.min(self.bytes.len());
                return Ok(());
            }
        }
    }

    /// Ends a row. Numbers that the header does not name are counted and ignored; anything else is refused.
    pub fn end(&mut self) -> Result<()> {
        if self.rest.is_empty() {
            return Ok(());
        }
        let mut words = self.rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let number = |word: &[u8]| std::str::from_utf8(word).is_ok_and(|word| word.parse::<f64>().is_ok());
        if let Some(word) = words.find(|word| !number(word)) {
            let word = String::from_utf8_lossy(word);
            return Err(self.place(Error::new(format!("excess `{}` at the end of the row", shorten(&word)))));
        }
        self.longer.get_or_insert((self.line.saturating_sub(1), 0)).1 += 1;
        Ok(())
    }

    /// The first line with more numbers than the header declares, and the number of such lines.
    pub fn longer(&self) -> Option<(usize, usize)> {
        self.longer
    }

    /// Reads a number.
    pub fn number(&mut self, scalar: PlyScalar) -> Result<f64> {
        if self.encoding == PlyEncoding::Ascii {
            let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
            let (word, rest) = self.rest.split_at(end);
            self.rest = rest.trim_ascii_start();
            let word = String::from_utf8_lossy(word);
            return word.parse().map_err(|_| {
                self.place(if word.is_empty() {
                    Error::new("the row has too few numbers")
                } else {
                    Error::new(format!("`{}` is not a number", shorten(&word)))
                })
            });
        }
        let big = self.encoding == PlyEncoding::BigEndian;
        macro_rules! number {
            ($type:ty) => {{
                let bytes = self.take()?;
                f64::from(if big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
            }};
        }
        Ok(match scalar {
            PlyScalar::I8 => number!(i8),
            PlyScalar::U8 => number!(u8),
            PlyScalar::I16 => number!(i16),
            PlyScalar::U16 => number!(u16),
            PlyScalar::I32 => number!(i32),
            PlyScalar::U32 => number!(u32),
            PlyScalar::F32 => number!(f32),
            PlyScalar::F64 => number!(f64),
        })
    }

    /// Reads a list of at most `most` items into a buffer. Its length is checked before the buffer grows, against the
    /// bytes left, too.
    pub fn list(&mut self, length: PlyScalar, scalar: PlyScalar, into: &mut Vec<f64>, most: usize) -> Result<()> {
        into.clear();
        let count = self.number(length)?;
        let (left, size) = match self.encoding {
            PlyEncoding::Ascii => (self.rest.len() + 1, 2),
            _ => (self.bytes.len() - self.at, scalar.size()),
        };
        if !(count >= 0.0 && count.fract() == 0.0 && count * size as f64 <= left as f64) {
            return Err(self.place(
                Error::new(format!("a list has {count} items, but only {left} bytes are left"))
                    .help("the file is cut short or damaged"),
            ));
        }
        if count > most as f64 {
            return Err(self.place(
                Error::new(format!("a list of {count} items exceeds the limit of {most}"))
                    .help("triangulate the mesh; for faces, the pool's `limits.triangles` raises the limit"),
            ));
        }
        for _ in 0..count as usize {
            into.push(self.number(scalar)?);
        }
        Ok(())
    }

    /// Skips an element.
    pub fn skip(&mut self, element: &Element) -> Result<()> {
        // Rows without numbers take no bytes.
        if self.encoding != PlyEncoding::Ascii && element.properties.is_empty() {
            return Ok(());
        }
        let mut items = Vec::new();
        for row in 0..element.count {
            self.begin(element, row)?;
            for property in &element.properties {
                match property.list {
                    None => {
                        self.number(property.scalar)?;
                    }
                    Some(length) => self.list(length, property.scalar, &mut items, LIST_LIMIT)?,
                }
            }
            self.end()?;
        }
        Ok(())
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let bytes = self.bytes.get(self.at..self.at + N).and_then(|bytes| bytes.try_into().ok());
        let Some(bytes) = bytes else {
            let left = self.bytes.len() - self.at;
            return Err(self.place(
                Error::new(format!("the file ends: {N} bytes are needed, {left} are left"))
                    .help("the file is cut short"),
            ));
        };
        self.at += N;
        Ok(bytes)
    }
}
