//! PNG files of any picture.

use crate::files::image::{Picture, Rounding, Samples, depth_units};
use crate::files::{products, view, view_name};
use std::sync::LazyLock;
use syntable_model::prelude::*;
use syntable_model::product::{DType, Tensor};

/// PNG files: `{id}/{product}/{scene:06}_{view:04}.png`, and for a product of every instance
/// `{id}/{product}/{scene:06}_{view:04}_{instance:04}.png`.
///
/// `rgb` is 8-bit; `depth` and `depth_sensed` are 16-bit in units of `depth_scale_mm`, rounded, 0 where there is none;
/// `instance` is 16-bit ids; masks are 0 and 255. `normal` (x right, y up, z towards the viewer; 128 is zero) and
/// `albedo` (sRGB-encoded) are 8-bit previews: `npy` writes their values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Png {
    /// The products to write.
    pub include: Vec<ProductName>,
    /// What one step of a depth picture is, mm: 1 reaches 65.5 m, 0.1 reaches 6.55 m. Farther is 65535.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub depth_scale_mm: f64,
}

impl Default for Png {
    fn default() -> Self {
        Self { include: vec!["rgb".into()], depth_scale_mm: 1.0 }
    }
}

impl Config for Png {
    type Stage = dyn Writer;
    const KIND: &'static str = "png";
    const EXAMPLE: &'static str = "include = [\"rgb\", \"depth\", \"visible_mask\"]";
    fn build(self) -> Result<Box<dyn Writer>, Invalid> {
        products::check(&self.include)?;
        for (i, name) in self.include.iter().enumerate() {
            if name.as_str() == "radiance" || name.as_str().starts_with("coverage") {
                let message = format!("a PNG file cannot hold `{}`", name.as_str());
                return Err(Invalid::new(format!("include[{i}]"), message)
                    .help("the npy writer can; `rgb` is the developed picture"));
            }
        }
        if !(self.depth_scale_mm > 0.0 && self.depth_scale_mm.is_finite()) {
            return Err(Invalid::new("depth_scale_mm", format!("{} mm is no step", self.depth_scale_mm)));
        }
        Ok(Box::new(self))
    }
}

impl Writer for Png {
    fn reads(&self) -> Vec<String> {
        products::names(&self.include)
    }

    fn scene(&self, _: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(PngScene { config: self.clone(), output }))
    }
}

struct PngScene {
    config: Png,
    output: Output,
}

impl SceneWriter for PngScene {
    fn view(&mut self, site: &Site, frame: &Frame) -> Result<()> {
        let view = view_name(site.scene.id, view(site)?.id);
        for name in &self.config.include {
            let name = name.as_str();
            let stem = format!("{}/{name}/{view}", self.output.id());
            let write = |value: &Value, path: String| -> Result<()> {
                let picture = picture(name, value, self.config.depth_scale_mm)
                    .map_err(|error| error.context(format!("product `{name}`")))?;
                picture.write(&self.output, &path)
            };
            match frame.value(name)? {
                Value::PerInstance(values) => {
                    values.iter().try_for_each(|(id, value)| write(value, format!("{stem}_{:04}.png", id.0)))?;
                }
                value => write(&value, format!("{stem}.png"))?,
            }
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// The picture that shows a value.
fn picture(name: &str, value: &Value, depth_scale_mm: f64) -> Result<Picture> {
    match value {
        Value::Mask(mask) => Ok(Picture::mask(mask, 255)),
        Value::Tensor(tensor) => {
            let (&[height, width], channels) = match tensor.shape.split_first_chunk() {
                Some((size, [])) if tensor.axes == ["y", "x"] => (size, None),
                Some((size, [channels])) if tensor.axes == ["y", "x", "channel"] => (size, Some(*channels)),
                _ => return Err(no_picture(&format!("an array with axes {:?}", tensor.axes))),
            };
            let samples = samples(name, tensor, channels, depth_scale_mm)?;
            Ok(Picture { width: width as u32, height: height as u32, samples })
        }
        _ => Err(no_picture("it")),
    }
}

fn samples(name: &str, tensor: &Tensor, channels: Option<usize>, depth_scale_mm: f64) -> Result<Samples> {
    let bytes = &tensor.bytes;
    let floats = || bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")));
    Ok(match (tensor.dtype, channels) {
        (DType::Bool, None) => Samples::Gray8(bytes.iter().map(|&bit| if bit == 0 { 0 } else { 255 }).collect()),
        (DType::U8, None | Some(1)) => Samples::Gray8(bytes.clone()),
        (DType::U8, Some(3)) => Samples::Rgb8(bytes.clone()),
        (DType::U8, Some(4)) => Samples::Rgba8(bytes.clone()),
        (DType::U16, None | Some(1)) => {
            Samples::Gray16(bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect())
        }
        (DType::F32, None) if matches!(name, "depth" | "depth_sensed") => {
            Samples::Gray16(floats().map(|depth| depth_units(depth, depth_scale_mm, Rounding::Nearest)).collect())
        }
        (DType::F32, Some(3)) if name == "normal" => {
            let normals: Vec<f32> = floats().collect();
            Samples::Rgb8(normals.as_chunks().0.iter().flat_map(|&normal| normal_code(normal)).collect())
        }
        (DType::F32, Some(3)) if name == "albedo" => Samples::Rgb8(floats().map(srgb_code).collect()),
        (dtype, channels) => {
            return Err(no_picture(&format!("{dtype:?} in {} channels", channels.unwrap_or(1))));
        }
    })
}

fn no_picture(what: &str) -> Error {
    Error::new(format!("{what} cannot be shown as PNG")).help("write it with npy or jsonl")
}

/// A normal of the camera frame (x right, y down, z forward) as others draw them: y up, z towards the viewer.
fn normal_code([x, y, z]: [f32; 3]) -> [u8; 3] {
    if [x, y, z] == [0.0; 3] {
        return [0; 3];
    }
    // 127 + 1 either side of 128; the cast clamps.
    [x, -y, -z].map(|v| (v * 127.0 + 128.0).round() as u8)
}

/// 8-bit code of a linear value, sRGB-encoded (IEC 61966-2-1): the nearest, found among the levels between codes.
fn srgb_code(x: f32) -> u8 {
    static LEVELS: LazyLock<[f32; 255]> = LazyLock::new(|| {
        std::array::from_fn(|code| {
            let encoded = (code as f64 + 0.5) / 255.0;
            let linear = if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            linear as f32
        })
    });
    LEVELS.partition_point(|&level| level <= x) as u8
}

register!(Png);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_are_encoded() {
        // sRGB codes of 0.1 %, 18 % and 50 % by the standard: 3.3, 117.6, 187.5.
        assert_eq!([-1.0, 0.0, 0.001, 0.18, 0.5, 1.0, 9.0].map(srgb_code), [0, 0, 3, 118, 188, 255, 255]);
        assert_eq!(normal_code([0.0, 0.0, -1.0]), [128, 128, 255]);
        assert_eq!(normal_code([1.0, 0.0, 0.0]), [255, 128, 128]);
        assert_eq!(normal_code([0.0, 1.0, 0.0]), [128, 1, 128]);
        assert_eq!(normal_code([0.0; 3]), [0; 3]);
    }

    #[test]
    fn measured_depth_is_written_as_depth_is() {
        let bytes = [1.25_f32, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let tensor = Tensor { dtype: DType::F32, axes: vec!["y", "x"], shape: vec![1, 2], bytes };
        for name in ["depth", "depth_sensed"] {
            let samples = samples(name, &tensor, None, 0.25).expect("a picture");
            assert!(matches!(samples, Samples::Gray16(units) if units == [5000, 0]), "{name}");
        }
        assert!(samples("heat", &tensor, None, 0.25).is_err());
    }
}
