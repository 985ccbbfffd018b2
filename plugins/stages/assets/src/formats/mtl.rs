//! Wavefront material libraries (MTL), with the metallic-roughness keys that exporters agree on.
//!
//! Supported keys are `Kd`, `Ke`, `Ns`, `Ni`, `d`, `Tr`, `Pr`, `Pm`, `map_Kd`, `map_Ke`, `map_Pr`, `map_Pm`, `norm`,
//! `bump` and `map_d`; supported texture options `-s`, `-o`, `-clamp`, `-bm`, `-imfchan` and `-colorspace`. Other keys
//! belong to other shading models; those that change a color are listed in [`MtlMaterial::unread`].
//!
//! `Kd` and `Ke` are linear Rec. 709, as Blender reads and writes them; images are sRGB-encoded.

use syntable_mesh::text::{TextLine, finite, lines, shorten};
use syntable_model::error::{Error, Result};

/// One `newmtl` block.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MtlMaterial {
    /// Its name.
    pub name: String,
    /// `Kd`, linear.
    pub diffuse: Option<[f32; 3]>,
    /// Line of `Kd`.
    pub diffuse_line: usize,
    /// `Ka` and its line, unless it is black.
    pub ambient: Option<(String, usize)>,
    /// `Ke`, linear.
    pub emission: Option<[f32; 3]>,
    /// `Ns`, the exponent of Phong's highlight.
    pub shininess: Option<f32>,
    /// `Ni`, the index of refraction.
    pub ior: Option<f32>,
    /// `d`, the opacity, and the line.
    pub opacity: Option<(f32, usize)>,
    /// `Tr`, which is one minus `d`, and its line. If both are given, `d` applies, because programs disagree on `Tr`.
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
    /// Statements that change the color in an unsupported way, and their lines.
    pub unread: Vec<(String, usize)>,
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
    /// `-imfchan`, as an index into RGBA, if it names a single channel.
    pub channel: Option<u8>,
    /// `-colorspace` names linear numbers.
    pub linear: bool,
    /// `-mm` changes the range of values, which is not read.
    pub rescaled: bool,
}

/// Parses a library. Errors carry the line.
pub fn parse(bytes: &[u8]) -> Result<Vec<MtlMaterial>> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    for line in lines(bytes) {
        statement(&line, &mut materials).map_err(|error| error.at_line(line.number))?;
    }
    Ok(materials)
}

fn statement(line: &TextLine<'_>, materials: &mut Vec<MtlMaterial>) -> Result<()> {
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
        "kd" | "ke" => match color(rest)? {
            Some(color) if key.eq_ignore_ascii_case("kd") => {
                (material.diffuse, material.diffuse_line) = (Some(color), line.number);
            }
            Some(color) => material.emission = Some(color),
            None => material.unread.push((shorten(text), line.number)),
        },
        "ka" => {
            let black = color(rest).ok().flatten().is_some_and(|color| color == [0.0; 3]);
            material.ambient = (!black).then(|| (shorten(text), line.number));
        }
        // Highlights are always white here, and transmitted light always has the base color.
        "ks" | "tf" => {
            let tinted = color(rest).ok().flatten().is_none_or(|[r, g, b]| r != g || g != b);
            if tinted {
                material.unread.push((shorten(text), line.number));
            }
        }
        "map_ka" | "map_ks" | "decal" | "refl" => material.unread.push((shorten(text), line.number)),
        "ps" | "pc" if number(rest).is_ok_and(|x| x > 0.0) => material.unread.push((shorten(text), line.number)),
        "ns" => material.shininess = Some(number(rest)?),
        "ni" => material.ior = Some(number(rest)?),
        "d" => material.opacity = Some((number(rest.trim_start_matches("-halo").trim())?, line.number)),
        "tr" => material.transparency = Some((number(rest)?, line.number)),
        "pr" => material.roughness = Some(number(rest)?),
        "pm" => material.metallic = Some(number(rest)?),
        "map_kd" => {
            let map = map(rest, line.number)?;
            if map.rescaled {
                material.unread.push((format!("-mm in map_Kd {}", shorten(&map.name)), line.number));
            }
            material.diffuse_map = Some(map);
        }
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

/// One gray number, or three of RGB or CIE XYZ; `None` for a `spectral` color, whose data are in another file.
fn color(text: &str) -> Result<Option<[f32; 3]>> {
    let (xyz, text) = match word(text) {
        ("spectral", _) => return Ok(None),
        ("xyz", rest) => (true, rest),
        _ => (false, text),
    };
    let words = text.split_whitespace().take_while(|token| !token.starts_with('#'));
    let numbers = words.map(|token| finite(token, "color")).collect::<Result<Vec<_>>>()?;
    let color = match numbers[..] {
        [gray] => [gray; 3],
        [r, g, b, ..] => [r, g, b],
        _ => return Err(Error::new(format!("`{}` is not a color", shorten(text)))),
    };
    Ok(Some(if xyz { rec709_of_xyz(color) } else { color }))
}

/// Linear Rec. 709 of CIE XYZ, by IEC 61966-2-1.
fn rec709_of_xyz([x, y, z]: [f32; 3]) -> [f32; 3] {
    [
        3.240_625_5 * x - 1.537_208 * y - 0.498_628_6 * z,
        -0.968_930_7 * x + 1.875_756_1 * y + 0.041_517_5 * z,
        0.055_710_1 * x - 0.204_021_1 * y + 1.056_995_9 * z,
    ]
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
        linear: false,
        rescaled: false,
    };
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, mut after) = word(rest);
        // Maximum number of arguments. Numeric options take all numbers that follow.
        let (words, numeric) = match option {
            "-s" | "-o" | "-t" => (3, true),
            "-mm" => (2, true),
            "-bm" | "-boost" | "-texres" => (1, true),
            "-clamp" | "-blendu" | "-blendv" | "-cc" | "-imfchan" | "-type" | "-colorspace" => (1, false),
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
            "-mm" => map.rescaled = pair(1.0)? != [0.0, 1.0],
            "-colorspace" => {
                let name = values.first().map(|name| name.to_ascii_lowercase()).unwrap_or_default();
                map.linear = ["linear", "raw", "non-color", "noncolor"].contains(&name.as_str());
            }
            "-imfchan" => map.channel = values.first().and_then(|&name| "rgbm".find(name)).map(|at| at as u8),
            _ => {}
        }
        rest = after;
    }
    map.name = rest.trim_matches('"').to_owned();
    if map.name.is_empty() {
        return Err(Error::new("the texture has no file name"));
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
                channel: Some(1),
                linear: false,
                rescaled: false
            }
        );
        assert_eq!(one("bump -bm 0.3 n.png").bump_map.expect("a map").strength, 0.3);
        assert_eq!(one("map_Kd -s 2 7").diffuse_map.expect("a map").name, "7");
        assert_eq!(one("map_Kd -odd.png").diffuse_map.expect("a map").name, "-odd.png");
        let linear = one("map_Kd -colorspace linear -mm 0.1 2 t.png").diffuse_map.expect("a map");
        assert_eq!((linear.name.as_str(), linear.linear, linear.rescaled), ("t.png", true, true));
        assert!(!one("map_Kd -colorspace sRGB t.png").diffuse_map.expect("a map").linear);
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
    fn colors_that_are_not_read_are_listed() {
        let material = one(
            "Ka 1 0 0\nKs 0.5 0.5 0.5\nKs 1 0.7 0.3 # gold\nTf 1 1 1\nTf 0 1 0\nKd spectral a.rfl 1\nmap_Ka a.png\nPc 0\nPc 1",
        );
        let lines: Vec<usize> = material.unread.iter().map(|(_, line)| *line).collect();
        assert_eq!((lines, material.diffuse), (vec![4, 6, 7, 8, 10], None));
        // The white of the display: D65.
        let white = one("Kd xyz 0.9505 1 1.089").diffuse.expect("a color");
        assert!(white.iter().all(|x| (x - 1.0).abs() < 2e-3), "{white:?}");
        assert_eq!(one("Kd 0.1 0.2 0.3 # mine").diffuse, Some([0.1, 0.2, 0.3]));
    }

    #[test]
    fn wrong_lines_are_named() {
        for (text, want) in [
            ("Kd 1 x 1", "`x`"),
            ("Kd 1 2", "not a color"),
            ("map_Kd", "has no file name"),
            ("\u{1}\u{2}", "not a material"),
        ] {
            let error = parse(format!("newmtl a\n\n{text}").as_bytes()).expect_err(text);
            assert!(error.to_string().contains(want), "{error}");
            assert_eq!(error.place(), Some(syntable_model::error::Place::Line(3)));
        }
    }
}
