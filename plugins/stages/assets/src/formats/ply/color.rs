//! Colors of the rows of a PLY file: the columns that hold them, and the meaning of their numbers.

use super::header::{Element, PlyScalar, is_signed_byte};
use std::ops::Range;
use syntable_mesh::paint::linear_of_display;
use syntable_mesh::text::shorten;

/// Names of the channels that are read, in any case of letters.
const CHANNELS: [&[&str]; 3] =
    [&["red", "r", "diffuse_red"], &["green", "g", "diffuse_green"], &["blue", "b", "diffuse_blue"]];
/// Names of the opacity that is read, in any case of letters.
const ALPHA: &[&str] = &["alpha", "a", "diffuse_alpha"];
/// Number of properties that one note names.
const NAMED: usize = 6;

/// The columns of an element that state a color.
pub enum ColorColumns {
    /// A column for each of red, green and blue, and perhaps for alpha.
    Channels { rgb: [usize; 3], alpha: Option<usize> },
    /// One column of 32 bits, `rgb` or `rgba`, as the Point Cloud Library packs colors: 0xAARRGGBB.
    Packed(PackedColor),
}

/// A column that packs the channels of a color into 32 bits.
pub struct PackedColor {
    at: usize,
    /// Whether the highest byte is an opacity: in `rgba`, and not in `rgb`.
    has_alpha: bool,
    /// Type of the column.
    scalar: PlyScalar,
    is_text: bool,
}

impl ColorColumns {
    /// Finds the columns of an element. Notes name every other column that states a color by its name. `corners` is the
    /// column of a list that states the colors of corners instead.
    pub fn of(element: &Element, is_text: bool, corners: Option<usize>, notes: &mut Vec<String>) -> Option<Self> {
        let properties = &element.properties;
        let find = |names: &[&str]| {
            let is_named = |name: &str| names.iter().any(|known| known.eq_ignore_ascii_case(name));
            properties.iter().position(|p| p.list.is_none() && is_named(&p.name))
        };
        let found = CHANNELS.map(find);
        let packed = ["rgb", "rgba"].into_iter().find_map(|name| {
            let at = find(&[name]).filter(|&at| properties[at].scalar.size() >= 4)?;
            Some(PackedColor { at, has_alpha: name == "rgba", scalar: properties[at].scalar, is_text })
        });
        let columns = match (corners, found, packed) {
            (Some(_), ..) => None,
            (None, [Some(r), Some(g), Some(b)], _) => Some(Self::Channels { rgb: [r, g, b], alpha: find(ALPHA) }),
            (None, _, packed) => packed.map(Self::Packed),
        };
        let mut read: Vec<usize> = corners.into_iter().collect();
        match &columns {
            Some(Self::Channels { rgb, alpha }) => read.extend(rgb.iter().chain(alpha)),
            Some(Self::Packed(packed)) => read.push(packed.at),
            None => {}
        }
        let of = shorten(&element.name);
        let incomplete: Vec<usize> =
            if found.iter().all(Option::is_some) { Vec::new() } else { found.into_iter().flatten().collect() };
        if let Some(&at) = incomplete.first() {
            let name = shorten(&properties[at].name);
            notes.push(format!("`{name}` of element `{of}` is ignored, because a color needs red, green and blue"));
        }
        let unread: Vec<String> = (0..properties.len())
            .filter(|at| !read.contains(at) && !incomplete.contains(at) && names_color(&properties[*at].name))
            .map(|at| format!("`{}`", shorten(&properties[at].name)))
            .collect();
        if !unread.is_empty() {
            let more = if unread.len() > NAMED { ", …" } else { "" };
            let named = unread[..unread.len().min(NAMED)].join(", ");
            notes.push(format!("unsupported colors of element `{of}`: {named}{more}"));
        }
        columns
    }

    /// The type as which a column is read. The bits of a packed color in a binary file are read as an integer: many of
    /// them are NaN as a float, and a conversion would change them.
    pub fn read_as(columns: Option<&Self>, at: usize, stated: PlyScalar) -> PlyScalar {
        match columns {
            Some(Self::Packed(packed)) if packed.at == at && packed.is_binary_float() => PlyScalar::U32,
            _ => stated,
        }
    }

    /// Whether the columns state opacities.
    pub fn has_alpha(&self) -> bool {
        match self {
            Self::Channels { alpha, .. } => alpha.is_some(),
            Self::Packed(packed) => packed.has_alpha,
        }
    }

    /// Red, green, blue and alpha of a row in the range of the file.
    pub fn of_row(&self, values: &[f64]) -> [f32; 4] {
        match self {
            Self::Channels { rgb, alpha } => {
                let [r, g, b] = rgb.map(|at| values[at] as f32);
                [r, g, b, alpha.map_or(1.0, |at| values[at] as f32)]
            }
            Self::Packed(packed) => packed.bytes(values[packed.at]),
        }
    }

    /// Turns the colors of all rows, as [`of_row`](Self::of_row) gave them, into linear colors and opacities in [0, 1].
    pub fn decode(&self, element: &Element, colors: &mut [[f32; 4]], of: &str, notes: &mut Vec<String>) {
        let ranges = match self {
            Self::Channels { rgb, alpha } => {
                let mut range = |at: usize, channels| range(element.properties[at].scalar, colors, channels);
                [range(rgb[0], 0..3), alpha.map_or(1.0, |at| range(at, 3..4))]
            }
            Self::Packed(packed) => {
                packed.settle(colors);
                [255.0; 2]
            }
        };
        decode(colors.iter_mut(), ranges, of, notes);
    }
}

impl PackedColor {
    fn is_binary_float(&self) -> bool {
        self.scalar == PlyScalar::F32 && !self.is_text
    }

    /// The bytes of a number as read: red, green, blue and alpha.
    fn bytes(&self, value: f64) -> [f32; 4] {
        let is_whole = value.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&value);
        let word = match self.scalar {
            PlyScalar::F32 if self.is_text && !value.is_finite() => return [f32::NAN; 4],
            PlyScalar::F32 if self.is_text => (value as f32).to_bits(),
            PlyScalar::F64 if !value.is_finite() => return [f32::NAN; 4],
            PlyScalar::F64 if !is_whole => (value as f32).to_bits(),
            // Signed integers wrap.
            _ => value as i64 as u32,
        };
        let [alpha, r, g, b] = word.to_be_bytes().map(f32::from);
        [r, g, b, alpha]
    }

    /// Floats hold the bits of packed colors, or packed colors as numbers. In the second case, all are integers of 24
    /// bits. Bits without opacity are numbers below 1e-37. Without alpha, the highest byte is unused.
    fn settle(&self, colors: &mut [[f32; 4]]) {
        let value =
            |&[r, g, b, alpha]: &[f32; 4]| f32::from_bits(u32::from_be_bytes([alpha, r, g, b].map(|x| x as u8)));
        let is_number = |x: f32| x.fract() == 0.0 && (0.0..=16_777_215.0).contains(&x);
        if self.scalar == PlyScalar::F32
            && colors.iter().filter(|color| color[0].is_finite()).all(|it| is_number(value(it)))
        {
            for color in colors.iter_mut().filter(|color| color[0].is_finite()) {
                let [_, r, g, b] = (value(color) as u32).to_be_bytes().map(f32::from);
                *color = [r, g, b, 0.0];
            }
        }
        if !self.has_alpha {
            colors.iter_mut().for_each(|color| color[3] = 255.0);
        }
    }
}

/// Whether a property states a color, judged by its name.
fn names_color(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let channels = ["red", "green", "blue", "gray", "grey", "luminance"]; // typos: ignore
    let words = ["color", "colour", "rgb"]; // typos: ignore
    words.iter().any(|word| name.contains(word)) || name.split(['_', '.', '-']).any(|part| channels.contains(&part))
}

/// Converts colors as written to linear colors in [0, 1], and opacities to [0, 1]. `full` is the number of full
/// intensity of colors, `opaque` the number of full opacity.
pub fn decode<'a>(
    colors: impl Iterator<Item = &'a mut [f32; 4]>,
    [full, opaque]: [f64; 2],
    of: &str,
    notes: &mut Vec<String>,
) {
    let mut missing = 0;
    for color in colors {
        let [r, g, b, alpha] = color.map(f64::from);
        missing += usize::from(![r, g, b, alpha].iter().all(|x| x.is_finite()));
        let [r, g, b] = linear_of_display([r, g, b], full);
        *color = [r, g, b, if alpha.is_finite() { (alpha / opaque).clamp(0.0, 1.0) as f32 } else { 1.0 }];
    }
    if missing > 0 {
        notes.push(format!("{missing} colors of {of} are not finite; such channels become white"));
    }
}

/// The number of full intensity in some channels of colors, which have one type. Fixes wrapped signed bytes first.
pub fn range(scalar: PlyScalar, colors: &mut [[f32; 4]], channels: Range<usize>) -> f64 {
    let wraps = scalar.wraps(colors.iter().flat_map(|color| &color[channels.clone()]).copied());
    for x in colors.iter_mut().flat_map(|color| &mut color[channels.clone()]) {
        if wraps && is_signed_byte(*x) && *x < 0.0 {
            *x += 256.0;
        }
    }
    scalar.full_intensity(colors.iter().flat_map(|color| &color[channels.clone()]).map(|&x| f64::from(x)))
}
