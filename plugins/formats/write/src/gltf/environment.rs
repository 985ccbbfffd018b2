//! Environment maps, which glTF cannot express: an HDR image next to the file, and a note in `extras`.

use serde_json::{Value as Json, json};
use syntable_model::scene::{EnvironmentLight, Light};

/// An HDR file: its name and its bytes.
pub type HdrFile = (String, Vec<u8>);

/// Notes and HDR files of the environment maps among some lights. The file names start with `stem`.
pub fn export(lights: &[Light], stem: &str) -> (Vec<Json>, Vec<HdrFile>) {
    let around =
        lights.iter().filter_map(|light| if let Light::Environment(light) = light { Some(light) } else { None });
    around
        .enumerate()
        .map(|(number, light)| {
            let end = if number == 0 { String::new() } else { format!("_{number}") };
            let file = format!("{stem}_environment{end}.hdr");
            let note = json!({
                "file": file, "rotation_rad": light.rotation, "name": light.map.name, "digest": light.map.digest,
                "scale_nits": light.scale, "license": light.map.license,
            });
            (note, (file, radiance_hdr(light)))
        })
        .unzip()
}

/// The map in nits as Radiance HDR (Ward, "Real Pixels", Graphics Gems II), without run-length encoding. The shared
/// exponent makes the largest mantissa at least 128, so that no texel looks like the marker of an encoded row.
fn radiance_hdr(light: &EnvironmentLight) -> Vec<u8> {
    let (width, height) = (light.map.width(), light.map.height());
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for texel in light.map.texels() {
        let nits: [f64; 3] = std::array::from_fn(|i| f64::from(texel[i]) * light.scale[i]);
        file.extend(rgbe(nits));
    }
    file
}

fn rgbe(color: [f64; 3]) -> [u8; 4] {
    let largest = color.into_iter().fold(0.0, f64::max);
    if largest < 1e-30 || !largest.is_finite() {
        return [0; 4];
    }
    // The exponent of the double: largest = f · 2^e with f in [1/2, 1).
    let exponent = ((largest.to_bits() >> 52) & 0x7ff) as i32 - 1022;
    let mantissa = |x: f64| (x.max(0.0) * 2.0_f64.powi(8 - exponent)) as u8;
    let [r, g, b] = color.map(mantissa);
    [r, g, b, (exponent + 128).clamp(1, 255) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use syntable_model::scene::EnvironmentMap;

    #[test]
    fn radiance_survives() {
        for color in [[1.0, 0.5, 0.0], [0.999, 1e-3, 0.2], [4e4, 3.1e4, 123.0], [2e-5, 1e-5, 3e-6]] {
            let [r, g, b, e] = rgbe(color);
            assert!(r >= 128, "{color:?}");
            let unit = 2.0_f64.powi(i32::from(e) - 136);
            for (got, want) in [r, g, b].map(|x| (f64::from(x) + 0.5) * unit).into_iter().zip(color) {
                assert!((got - want).abs() <= 0.5 * unit + 1e-12, "{got} {want}");
            }
        }
        assert_eq!((rgbe([0.0; 3]), rgbe([1.0; 3])), ([0; 4], [128, 128, 128, 129]));
        let map = EnvironmentMap::new("sky", 2, 1, vec![[1.0, 0.5, 0.25]; 2]).expect("sound");
        let light = Light::Environment(EnvironmentLight { map: Arc::new(map), scale: [2.0; 3], rotation: 0.5 });
        let (notes, files) = export(&[light], "000001");
        assert_eq!((&notes[0]["file"], &notes[0]["rotation_rad"]), (&json!("000001_environment.hdr"), &json!(0.5)));
        assert!(files[0].1.ends_with(b"-Y 1 +X 2\n\x80\x40\x20\x82\x80\x40\x20\x82"), "{:?}", files[0]);
    }
}
