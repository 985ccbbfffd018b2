//! Wavefront material libraries (MTL), with the metallic-roughness keys that exporters agree on.
//!
//! Supported keys are `Kd`, `Ke`, `Ns`, `Ni`, `d`, `Tr`, `Pr`, `Pm`, `map_Kd`, `map_Ke`, `map_Pr`, `map_Pm`, `norm`, `bump` and `map_d`;
//! supported texture options `-s`, `-o`, `-clamp`, `-bm` and `-imfchan`. Other keys belong to other shading models and are
//! ignored.

use syntable_mesh::text::{Line, finite, lines, shorten};
use syntable_model::error::{Error, Result};

/// One `newmtl` block.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MtlMaterial {
    /// Its name.
    pub name: String,
    /// `Kd`, linear.
    pub diffuse: Option<[f32; 3]>,
    /// `Ke`, linear.
    pub emission: Option<[f32; 3]>,
    /// `Ns`, the exponent of Phong's highlight.
    pub shininess: Option<f32>,
    /// `Ni`, the index of refraction.
    pub ior: Option<f32>,
    /// `d`, the opacity, and the line.
    pub opacity: Option<(f32, usize)>,
    /// `Tr`, one minus that, and the line. If both are given, `d` counts: programs disagree on `Tr`.
    pub transparency: Option<(f32, usize)>,
    /// `Pr`, perceptual roughness.
    pub roughness: Option<f32>,
    /// `Pm`.
    pub metallic: Option<f32>,
    /// `map_Kd`.
    pub diffuse_map: Option<MtlMap>,
    /// `map_Ke`.
    pub emission_map: Option<MtlMap>,
    /// `map_Pr`.
    pub roughness_map: Option<MtlMap>,
    /// `map_Pm`.
    pub metallic_map: Option<MtlMap>,
    /// `norm`: a tangent-space normal map.
    pub normal_map: Option<MtlMap>,
    /// `bump`, `map_bump`: heights by the standard, but many programs write a normal map here.
    pub bump_map: Option<MtlMap>,
    /// `map_d`: opacity.
    pub opacity_map: Option<MtlMap>,
}

/// A texture statement.
#[derive(Debug, Clone, PartialEq)]
pub struct MtlMap {
    /// File name as written; it may have blanks.
    pub name: String,
    /// Line of the statement.
    pub line: usize,
    /// `-s u v`
    pub scale: [f32; 2],
    /// `-o u v`
    pub offset: [f32; 2],
    /// `-clamp on`
    pub clamp: bool,
    /// `-bm`
    pub strength: f32,
    /// `-imfchan`, as an index into RGBA, where it names one channel.
    pub channel: Option<u8>,
}

/// Parses a library. Errors carry the line.
pub fn parse(bytes: &[u8]) -> Result<Vec<MtlMaterial>> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    for line in lines(bytes) {
        statement(&line, &mut materials).map_err(|error| error.at_line(line.number))?;
    }
    Ok(materials)
}

fn statement(line: &Line<'_>, materials: &mut Vec<MtlMaterial>) -> Result<()> {
    let text = line.text.trim();
    let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let rest = rest.trim();
    if key.is_empty() || key.starts_with('#') {
        return Ok(());
    }
    if key == "newmtl" {
        materials.push(MtlMaterial { name: rest.to_owned(), ..MtlMaterial::default() });
        return Ok(());
    }
    if !key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') {
        return Err(Error::new(format!("`{}` is not a material statement", shorten(key))));
    }
    let Some(material) = materials.last_mut() else {
        return Ok(());
    };
    match key.to_ascii_lowercase().as_str() {
        "kd" => material.diffuse = color(rest)?,
        "ke" => material.emission = color(rest)?,
        "ns" => material.shininess = Some(number(rest)?),
        "ni" => material.ior = Some(number(rest)?),
        "d" => material.opacity = Some((number(rest.trim_start_matches("-halo").trim())?, line.number)),
        "tr" => material.transparency = Some((number(rest)?, line.number)),
        "pr" => material.roughness = Some(number(rest)?),
        "pm" => material.metallic = Some(number(rest)?),
        "map_kd" => material.diffuse_map = Some(map(rest, line.number)?),
        "map_ke" => material.emission_map = Some(map(rest, line.number)?),
        "map_pr" => material.roughness_map = Some(map(rest, line.number)?),
        "map_pm" => material.metallic_map = Some(map(rest, line.number)?),
        "norm" | "map_kn" => material.normal_map = Some(map(rest, line.number)?),
        "bump" | "map_bump" => material.bump_map = Some(map(rest, line.number)?),
        "map_d" => material.opacity_map = Some(map(rest, line.number)?),
        _ => {}
    }
    Ok(())
}

fn number(text: &str) -> Result<f32> {
    finite(text.split_whitespace().next().unwrap_or_default(), "number")
}

/// One gray number or three; `spectral` and `xyz` colors are ignored.
fn color(text: &str) -> Result<Option<[f32; 3]>> {
    if text.starts_with("spectral") || text.starts_with("xyz") {
        return Ok(None);
    }
    let numbers = text.split_whitespace().map(|token| finite(token, "color")).collect::<Result<Vec<_>>>()?;
    match numbers[..] {
        [gray] => Ok(Some([gray; 3])),
        [r, g, b, ..] => Ok(Some([r, g, b])),
        _ => Err(Error::new(format!("`{}` is not a color", shorten(text)))),
    }
}

fn map(text: &str, line: usize) -> Result<MtlMap> {
    let mut map = MtlMap {
        name: String::new(),
        line,
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
        strength: 1.0,
        channel: None,
    };
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, mut after) = word(rest);
        // Maximum number of arguments; numeric options take as many numbers as follow.
        let (words, numeric) = match option {
            "-s" | "-o" | "-t" => (3, true),
            "-mm" => (2, true),
            "-bm" | "-boost" | "-texres" => (1, true),
            "-clamp" | "-blendu" | "-blendv" | "-cc" | "-imfchan" | "-type" => (1, false),
            _ => break,
        };
        let mut values = Vec::new();
        while values.len() < words {
            let (value, next) = word(after);
            if next.is_empty() || (numeric && value.parse::<f32>().is_err()) {
                break;
            }
            values.push(value);
            after = next;
        }
        let pair = |missing: f32| -> Result<[f32; 2]> {
            let get = |i: usize| values.get(i).map_or(Ok(missing), |value| finite(value, "texture option"));
            Ok([get(0)?, get(1)?])
        };
        match option {
            "-s" => map.scale = pair(1.0)?,
            "-o" => map.offset = pair(0.0)?,
            "-bm" => map.strength = pair(1.0)?[0],
            "-clamp" => map.clamp = values == ["on"],
            "-imfchan" => map.channel = values.first().and_then(|&name| "rgbm".find(name)).map(|at| at as u8),
            _ => {}
        }
        rest = after;
    }
    map.name = rest.trim_matches('"').to_owned();
    if map.name.is_empty() {
        return Err(Error::new("a texture without a file name"));
    }
    Ok(map)
}

fn word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> MtlMaterial {
        parse(format!("newmtl a\n{text}").as_bytes()).expect(text).remove(0)
    }

    #[test]
    fn names_may_have_blanks_and_options_go_first() {
        let plain = one("map_Kd my täxture 1.png ").diffuse_map.expect("a map");
        assert_eq!((plain.name.as_str(), plain.line, plain.clamp), ("my täxture 1.png", 2, false));
        let all = one("map_Kd -s 2 3 1 -o 0.5 -clamp on -mm 0 1 -imfchan g a b.png").diffuse_map.expect("a map");
        assert_eq!(
            all,
            MtlMap {
                name: "a b.png".into(),
                line: 2,
                scale: [2.0, 3.0],
                offset: [0.5, 0.0],
                clamp: true,
                strength: 1.0,
                channel: Some(1)
            }
        );
        assert_eq!(one("bump -bm 0.3 n.png").bump_map.expect("a map").strength, 0.3);
        assert_eq!(one("map_Kd -s 2 7").diffuse_map.expect("a map").name, "7");
        assert_eq!(one("map_Kd -odd.png").diffuse_map.expect("a map").name, "-odd.png");
    }

    #[test]
    fn factors() {
        let material = one("Kd 0.1 0.2 0.3\nPr 0.4\nPm 1\nNs 60\nKe 2\nNi 1.45\nillum 2\nKs 0 0 0");
        assert_eq!(material.diffuse, Some([0.1, 0.2, 0.3]));
        assert_eq!((material.roughness, material.metallic, material.shininess), (Some(0.4), Some(1.0), Some(60.0)));
        assert_eq!((material.emission, material.ior), (Some([2.0; 3]), Some(1.45)));
        let clear = one("d -halo 0.3\nTr 0.6");
        assert_eq!((clear.opacity, clear.transparency), (Some((0.3, 2)), Some((0.6, 3))));
    }

    #[test]
    fn wrong_lines_are_named() {
        for (text, want) in [
            ("Kd 1 x 1", "`x`"),
            ("Kd 1 2", "not a color"),
            ("map_Kd", "without a file name"),
            ("\u{1}\u{2}", "not a material"),
        ] {
            let error = parse(format!("newmtl a\n\n{text}").as_bytes()).expect_err(text);
            assert!(error.to_string().contains(want), "{error}");
            assert_eq!(error.place(), Some(syntable_model::error::Place::Line(3)));
        }
    }
}
