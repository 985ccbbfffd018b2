//! Radiance HDR (RGBE), after Ward, "Real Pixels", Graphics Gems II: flat, old and new run-length coding.

use syntable_mesh::environment::MAX_SIDE;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::limits::Budget;
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};
use syntable_model::scene::EnvironmentMap;

/// First bytes of every Radiance HDR file.
const MAGIC: &[u8] = b"#?";

/// Decodes a file in memory.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<EnvironmentMap> {
    let mut input = HdrInput { bytes, at: 0 };
    let header = HdrHeader::read(&mut input, budget)?;
    let HdrHeader { width, height, .. } = header;
    let mut texels: Vec<[f32; 3]> = Vec::new();
    let mut row = Vec::with_capacity(width);
    for y in 0..height {
        row.clear();
        read_row(&mut input, width, &mut row).map_err(|why| {
            Error::new(format!("row {y} of {height} {why}"))
                .at_byte(input.at as u64)
                .help("the file is cut short or damaged")
        })?;
        texels.extend(row.iter().map(|&rgbe| radiance(rgbe).map(|x| x / header.exposure)));
    }
    // Rows and columns in image order: from the top left.
    if header.bottom_up {
        let rows: Vec<_> = texels.chunks(width).rev().flatten().copied().collect();
        texels = rows;
    }
    if header.right_to_left {
        texels.chunks_mut(width).for_each(<[_]>::reverse);
    }
    EnvironmentMap::new("", width as u32, height as u32, texels)
}

/// Shared exponent: the mantissas are in 1/256, a zero exponent is black.
fn radiance([r, g, b, e]: [u8; 4]) -> [f32; 3] {
    if e == 0 {
        return [0.0; 3];
    }
    let scale = 2.0_f64.powi(i32::from(e) - 128 - 8);
    [r, g, b].map(|mantissa| (f64::from(mantissa) * scale) as f32)
}

struct HdrHeader {
    width: usize,
    height: usize,
    bottom_up: bool,
    right_to_left: bool,
    exposure: f32,
}

impl HdrHeader {
    fn read(input: &mut HdrInput<'_>, budget: &Budget) -> Result<Self> {
        let mut exposure = 1.0_f32;
        for number in 1.. {
            let Some(line) = input.line() else {
                return Err(Error::new("the header has no end").help("the file is cut short or not a Radiance HDR"));
            };
            let line = line.trim_ascii();
            let wrong = |message: String| Err(Error::new(message).at_line(number));
            if let Some(format) = line.strip_prefix("FORMAT=") {
                if format != "32-bit_rle_rgbe" {
                    return wrong(format!("format `{}` is not supported, only 32-bit_rle_rgbe", shorten(format)));
                }
            } else if let Some(value) = line.strip_prefix("EXPOSURE=") {
                // Stored values were multiplied by every exposure of the header.
                match value.trim_ascii().parse::<f32>() {
                    Ok(factor) if factor.is_finite() && factor > 0.0 => exposure *= factor,
                    _ => return wrong(format!("exposure `{}` is not a number above zero", shorten(value))),
                }
            } else if line.is_empty() {
                break;
            }
        }
        if !exposure.is_normal() {
            return Err(Error::new(format!("the product of the exposures is {exposure}")));
        }
        let line = input.line().unwrap_or_default();
        let wrong = || {
            Error::new(format!("`{}` is not a resolution", shorten(line)))
                .help("expected two positive sizes such as `-Y 512 +X 1024`")
        };
        let tokens: Vec<&str> = line.split_ascii_whitespace().collect();
        let [vertical @ ("-Y" | "+Y"), height, horizontal @ ("-X" | "+X"), width] = tokens[..] else {
            return Err(wrong());
        };
        let height: usize = height.parse().map_err(|_| wrong())?;
        let width: usize = width.parse().map_err(|_| wrong())?;
        budget.image(width as u64, height as u64, MAX_SIDE)?;
        Ok(Self { width, height, bottom_up: vertical == "+Y", right_to_left: horizontal == "-X", exposure })
    }
}

struct HdrInput<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> HdrInput<'a> {
    /// A header line; `None` at the end of the file, or if it is not text.
    fn line(&mut self) -> Option<&'a str> {
        let rest = self.bytes.get(self.at..)?;
        let end = rest.iter().position(|&b| b == b'\n')?;
        self.at += end + 1;
        std::str::from_utf8(&rest[..end]).ok()
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], &'static str> {
        let bytes = self.bytes.get(self.at..self.at + N).ok_or("ends with the file")?;
        self.at += N;
        bytes.try_into().map_err(|_| "ends with the file")
    }
}

fn read_row(input: &mut HdrInput<'_>, width: usize, row: &mut Vec<[u8; 4]>) -> Result<(), &'static str> {
    let start: [u8; 4] = input.take()?;
    let coded = start[0] == 2 && start[1] == 2 && start[2] < 128;
    if !(8..32_768).contains(&width) || !coded {
        return read_old_row(input, start, width, row);
    }
    if usize::from(start[2]) << 8 | usize::from(start[3]) != width {
        return Err("has a different width than the header");
    }
    row.resize(width, [0; 4]);
    for channel in 0..4 {
        let mut x = 0;
        while x < width {
            let [count] = input.take()?;
            let (count, run) = if count > 128 { (count - 128, true) } else { (count, false) };
            let end = x + usize::from(count);
            if count == 0 || end > width {
                return Err("has a run that does not fit");
            }
            if run {
                let [value] = input.take()?;
                row[x..end].iter_mut().for_each(|texel| texel[channel] = value);
            } else {
                for texel in &mut row[x..end] {
                    [texel[channel]] = input.take()?;
                }
            }
            x = end;
        }
    }
    Ok(())
}

/// Flat texels. (1, 1, 1, n) repeats the last texel n times; further such texels add higher digits.
fn read_old_row(
    input: &mut HdrInput<'_>,
    start: [u8; 4],
    width: usize,
    row: &mut Vec<[u8; 4]>,
) -> Result<(), &'static str> {
    let mut next = start;
    let mut shift = 0;
    loop {
        if next[..3] == [1, 1, 1] {
            let count = usize::from(next[3]).checked_shl(shift).unwrap_or(usize::MAX);
            let last = *row.last().ok_or("begins with a repetition")?;
            if count > width - row.len() {
                return Err("has a run that does not fit");
            }
            row.resize(row.len() + count, last);
            shift = (shift + 8).min(32);
        } else {
            row.push(next);
            shift = 0;
        }
        if row.len() == width {
            return Ok(());
        }
        next = input.take()?;
    }
}

syntable_mesh::register_image_format!(
    ImageFormat::new("Radiance HDR", &["hdr"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Radiance(decode))
        .with_preference(10)
);

#[cfg(test)]
mod tests {
    use super::*;

    fn file(resolution: &str, body: &[u8]) -> Vec<u8> {
        [format!("#?RADIANCE\nGAMMA=1\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n").as_bytes(), body].concat()
    }

    fn check(resolution: &str, body: &[u8], want: Result<&[[f32; 3]], &str>) {
        match (decode(&file(resolution, body), &Budget::default()), want) {
            (Ok(got), Ok(want)) => assert_eq!(got.texels(), want, "{resolution}"),
            (Err(got), Err(want)) => assert!(got.to_string().contains(want), "{resolution}: {got}"),
            (got, want) => panic!("{resolution}: got {got:?}, want {want:?}"),
        }
    }

    #[test]
    fn flat_rows_in_all_directions() {
        let body = [[128, 64, 0, 129], [255, 0, 0, 128], [0, 0, 0, 0], [0, 1, 2, 136]].concat();
        let [a, b, c, d] = [[1.0, 0.5, 0.0], [255.0 / 256.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 2.0]];
        check("-Y 2 +X 2", &body, Ok(&[a, b, c, d]));
        check("+Y 2 +X 2", &body, Ok(&[c, d, a, b]));
        check("-Y 2 -X 2", &body, Ok(&[b, a, d, c]));
        check("-Y 3 +X 2", &body, Err("row 2 of 3 ends with the file"));
        check("-Y -3 +X 2", &body, Err("`-Y -3 +X 2` is not a resolution"));
        check("+X 2 -Y 2", &body, Err("is not a resolution"));
        check("-Y 0 +X 2", &body, Err("2 x 0 pixels is empty"));
        check("-Y 400000 +X 200000", &body, Err("more than the limit"));
    }

    #[test]
    fn run_lengths_old_and_new() {
        let old = [[128, 128, 128, 129], [1, 1, 1, 4], [0, 0, 0, 0]].concat();
        let gray = [1.0; 3];
        check("-Y 1 +X 6", &old, Ok(&[gray, gray, gray, gray, gray, [0.0; 3]]));
        let new = [2, 2, 0, 8, 136, 128, 8, 0, 0, 0, 0, 0, 0, 0, 128, 136, 0, 136, 129];
        let red = [1.0, 0.0, 0.0];
        let last = [1.0, 1.0, 0.0];
        check("-Y 1 +X 8", &new, Ok(&[red, red, red, red, red, red, red, last]));
        check("-Y 1 +X 8", &new[..10], Err("row 0 of 1 ends"));
        check("-Y 1 +X 9", &new, Err("different width"));
        check("-Y 1 +X 8", &[2, 2, 0, 8, 137, 1], Err("does not fit"));
        check("-Y 1 +X 4", &[1, 1, 1, 3], Err("begins with a repetition"));
    }

    #[test]
    fn headers_that_are_wrong() {
        let check = |text: &[u8], want: &str| {
            let error = decode(text, &Budget::default()).expect_err(want).to_string();
            assert!(error.contains(want), "{error}");
        };
        check(b"#?RADIANCE\n", "has no end");
        check(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234", "xyze` is not supported");
        check(b"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n1234", "exposure `0`");
        let bright = decode(b"#?RGBE\nEXPOSURE=2\nEXPOSURE= 2\n\n-Y 1 +X 1\n\x80\x80\x80\x81", &Budget::default())
            .expect("sound");
        assert_eq!(bright.texels(), [[0.25; 3]]);
    }
}
