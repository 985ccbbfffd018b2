//! The header of a PLY file.

use syntable_mesh::paint::full_intensity;
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};

/// Maximum length of a header, bytes.
const MAX_HEADER: usize = 1 << 20;

/// Encoding of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlyEncoding {
    /// Text, one row per line.
    Ascii,
    /// Binary, least significant byte first.
    LittleEndian,
    /// Binary, most significant byte first.
    BigEndian,
}

/// A type of number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlyScalar {
    /// `char`, `int8`
    I8,
    /// `uchar`, `uint8`
    U8,
    /// `short`, `int16`
    I16,
    /// `ushort`, `uint16`
    U16,
    /// `int`, `int32`
    I32,
    /// `uint`, `uint32`
    U32,
    /// `float`, `float32`
    F32,
    /// `double`, `float64`
    F64,
}

impl PlyScalar {
    fn parse(name: &str) -> Result<Self> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(Error::new(format!("`{}` is not a number type", shorten(name)))),
        })
    }

    /// Size in a binary body, bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number of full intensity in colors of this type. Bytes have 255; other types may hold bytes, 16-bit words or
    /// their own whole range, and floats also fractions.
    pub fn full_intensity(self, values: impl IntoIterator<Item = f64>) -> f64 {
        let full = full_intensity(values);
        match self {
            Self::F32 | Self::F64 => full,
            Self::I8 | Self::U8 => 255.0,
            _ if full <= 255.0 => 255.0,
            _ if full <= 65_535.0 => 65_535.0,
            _ if full <= 2_147_483_647.0 => 2_147_483_647.0,
            _ => 4_294_967_295.0,
        }
    }

    /// Whether negative numbers in colors of this type are bytes above 127 that were written as signed bytes. For wider
    /// integers, all of them must fit a signed byte; floats never qualify.
    pub fn wraps(self, mut values: impl Iterator<Item = f32>) -> bool {
        match self {
            Self::F32 | Self::F64 => false,
            Self::I8 | Self::U8 => true,
            _ => values.all(|x| !x.is_finite() || is_signed_byte(x)),
        }
    }
}

/// Whether a number is an integer in [-128, 127].
pub fn is_signed_byte(x: f32) -> bool {
    (-128.0..=127.0).contains(&x) && x.fract() == 0.0
}

/// One property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// Type of the number, or of the items of a list.
    pub scalar: PlyScalar,
    /// Type of a list's length; `None` for a single number.
    pub list: Option<PlyScalar>,
}

/// An element: a table of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: usize,
    /// Columns.
    pub properties: Vec<Property>,
}

/// A parsed header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlyHeader {
    /// Encoding of the body.
    pub encoding: PlyEncoding,
    /// Tables in order.
    pub elements: Vec<Element>,
    /// Names after `comment TextureFile`.
    pub textures: Vec<String>,
    /// Byte offset of the body.
    pub body: usize,
    /// First line of a text body, from 1.
    pub body_line: usize,
}

impl PlyHeader {
    /// Parses the header of a file in memory.
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        if !(bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")) {
            return Err(Error::new("not a PLY file: the first line is not `ply`"));
        }
        let mut encoding = None;
        let mut header =
            Self { encoding: PlyEncoding::Ascii, elements: Vec::new(), textures: Vec::new(), body: 0, body_line: 0 };
        let mut at = 0;
        for number in 1.. {
            let rest = &bytes[at..];
            let Some(end) = rest.iter().take(MAX_HEADER.saturating_sub(at)).position(|&b| b == b'\n') else {
                return Err(Error::new("the header has no `end_header`").help("the file is cut short"));
            };
            let line = String::from_utf8_lossy(&rest[..end]);
            at += end + 1;
            let line = line.trim();
            if line == "end_header" {
                (header.body, header.body_line) = (at, number + 1);
                break;
            }
            header.statement(line, &mut encoding).map_err(|error| error.at_line(number))?;
        }
        header.encoding = encoding.ok_or_else(|| Error::new("the header states no format"))?;
        Ok(header)
    }

    fn statement(&mut self, line: &str, encoding: &mut Option<PlyEncoding>) -> Result<()> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            [] | ["ply"] | ["obj_info", ..] => {}
            ["comment", key, _, ..] if key.eq_ignore_ascii_case("TextureFile") => {
                let name = line.split_once(key).map_or("", |(_, name)| name.trim());
                self.textures.push(name.to_owned());
            }
            ["comment", ..] => {}
            ["format", name, version] => {
                *encoding = Some(match name {
                    "ascii" => PlyEncoding::Ascii,
                    "binary_little_endian" => PlyEncoding::LittleEndian,
                    "binary_big_endian" => PlyEncoding::BigEndian,
                    _ => return Err(Error::new(format!("`{}` is not a format", shorten(name)))),
                });
                if version != "1.0" {
                    return Err(Error::new(format!("version `{}` is not supported, only 1.0", shorten(version))));
                }
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| {
                    Error::new(format!("`{}` is not a number of rows of element `{}`", shorten(count), shorten(name)))
                })?;
                self.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", length, scalar, name] => {
                let length = PlyScalar::parse(length)?;
                if matches!(length, PlyScalar::F32 | PlyScalar::F64) {
                    return Err(Error::new(format!("the length of list `{}` is not an integer", shorten(name))));
                }
                self.property(Property {
                    name: name.to_owned(),
                    scalar: PlyScalar::parse(scalar)?,
                    list: Some(length),
                })?;
            }
            ["property", scalar, name] => {
                self.property(Property { name: name.to_owned(), scalar: PlyScalar::parse(scalar)?, list: None })?;
            }
            _ => {
                return Err(Error::new(format!("`{}` is not a header statement", shorten(line)))
                    .help("check that `end_header` ends the header"));
            }
        }
        Ok(())
    }

    fn property(&mut self, property: Property) -> Result<()> {
        let Some(element) = self.elements.last_mut() else {
            return Err(Error::new(format!("property `{}` comes before any element", shorten(&property.name))));
        };
        element.properties.push(property);
        Ok(())
    }
}
