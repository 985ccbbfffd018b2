//! The surface of a model of BOP: colors of vertices, or one texture.

use super::record::MM;
use std::collections::HashMap;
use syntable_formats::encode::png::{PngImage, PngSamples};
use syntable_model::color::{linear_to_srgb, srgb_to_linear};
use syntable_model::prelude::*;
use syntable_model::product::ObjectModel;
use syntable_model::scene::{Color, Encoding, Material, MeshData, TextureRef, UvTransform, Wrap};

/// The surface of a model.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelSurface {
    /// Unknown.
    Plain,
    /// A color per vertex, sRGB.
    Colors(Vec<[u8; 3]>),
    /// A texture.
    Texture {
        /// Coordinates per vertex, v upwards.
        uvs: Vec<[f32; 2]>,
        /// The image, a PNG file.
        png: Vec<u8>,
    },
}

/// Vertices of a model in mm, its faces and its surface.
pub type ShownSurface = (Vec<[f32; 3]>, Vec<[u32; 3]>, ModelSurface);

/// The vertices that faces use, in the frame of the asset's file. A vertex is repeated for each material whose faces
/// use it.
pub fn shown(model: &ObjectModel) -> Result<ShownSurface> {
    let (data, materials) = (model.mesh.data(), model.materials.as_slice());
    let texture = match materials {
        [only] => texture_of(only, data),
        _ => None,
    };
    let has_colors = texture.is_none() && (!materials.is_empty() || !data.colors.is_empty());
    let paints: Vec<Paint> = materials.iter().map(|material| Paint::of(&material.base_color)).collect();
    let slot_of = |triangle: usize| if has_colors && materials.len() > 1 { model.mesh.slot(triangle) } else { 0 };
    let mut known: HashMap<(u32, usize), u32> = HashMap::new();
    let (mut vertices, mut colors, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    let origin = model.source.origin;
    let mut index_of = |vertex: u32, slot: usize| {
        *known.entry((vertex, slot)).or_insert_with(|| {
            let at = vertex as usize;
            let p = data.positions[at];
            vertices.push(std::array::from_fn(|i| ((f64::from(p[i]) - origin[i]) * MM) as f32));
            if has_colors {
                colors.push(color_of(paints.get(slot), data, at));
            }
            if let Some(texture) = texture {
                uvs.push(moved(data.uvs[at], &texture.transform));
            }
            vertices.len() as u32 - 1
        })
    };
    let faces =
        data.triangles.iter().enumerate().map(|(number, face)| face.map(|vertex| index_of(vertex, slot_of(number))));
    let faces = faces.collect();
    let surface = match (texture, materials) {
        (Some(texture), [only]) => {
            ModelSurface::Texture { uvs, png: image_of(texture, only.base_color.factor).encode()? }
        }
        _ if has_colors => ModelSurface::Colors(colors),
        _ => ModelSurface::Plain,
    };
    Ok((vertices, faces, surface))
}

/// The texture, if it alone determines the color of a material.
fn texture_of<'m>(material: &'m Material, data: &MeshData) -> Option<&'m TextureRef> {
    let texture = material.base_color.texture.as_ref()?;
    (!data.uvs.is_empty() && data.colors.is_empty()).then_some(texture)
}

/// The color of a material, prepared for lookups.
struct Paint<'m> {
    color: &'m Color,
    /// Mean of the texture, linear.
    mean: [f32; 3],
}

impl<'m> Paint<'m> {
    fn of(color: &'m Color) -> Self {
        let mean = color.texture.as_ref().map_or([1.0; 3], |texture| {
            let texels = texture.texture.texels.as_chunks::<4>().0;
            let mut sum = [0.0_f64; 3];
            for texel in texels {
                let linear = linear_of(texel, texture.texture.encoding);
                (0..3).for_each(|i| sum[i] += f64::from(linear[i]));
            }
            sum.map(|sum| (sum / texels.len().max(1) as f64) as f32)
        });
        Self { color, mean }
    }
}

/// The color of a vertex, sRGB: factor times color of the vertex times texture. Without coordinates, the mean of the
/// texture is used.
fn color_of(paint: Option<&Paint>, data: &MeshData, vertex: usize) -> [u8; 3] {
    let own = data.colors.get(vertex).copied().unwrap_or([1.0; 3]);
    let (factor, texel) = paint.map_or(([1.0; 3], [1.0; 3]), |paint| {
        let texel = match (&paint.color.texture, data.uvs.get(vertex)) {
            (Some(texture), Some(uv)) => sample(texture, *uv),
            _ => paint.mean,
        };
        (paint.color.factor, texel)
    });
    std::array::from_fn(|i| code(own[i] * factor[i] * texel[i]))
}

/// The sRGB code of a linear value.
fn code(linear: f32) -> u8 {
    (linear_to_srgb(linear.clamp(0.0, 1.0)) * 255.0).round() as u8
}

fn linear_of(texel: &[u8; 4], encoding: Encoding) -> [f32; 3] {
    let value = |i: usize| f32::from(texel[i]) / 255.0;
    match encoding {
        Encoding::Srgb => [0, 1, 2].map(|i| srgb_to_linear(value(i))),
        Encoding::Linear => [0, 1, 2].map(value),
    }
}

/// Texture coordinates after the transform of the texture.
fn moved([u, v]: [f32; 2], of: &UvTransform) -> [f32; 2] {
    if *of == UvTransform::default() {
        return [u, v];
    }
    let (x, y) = (u * of.scale[0], v * of.scale[1]);
    let (sin, cos) = (libm::sinf(of.rotation), libm::cosf(of.rotation));
    [x * cos - y * sin + of.offset[0], x * sin + y * cos + of.offset[1]]
}

/// The texel at texture coordinates, linear.
fn sample(of: &TextureRef, uv: [f32; 2]) -> [f32; 3] {
    let texture = &of.texture;
    let [u, v] = moved(uv, &of.transform);
    let place = |at: f32, size: u32, wrap: Wrap| {
        let at = match wrap {
            Wrap::Repeat => at - at.floor(),
            Wrap::Clamp => at.clamp(0.0, 1.0),
            Wrap::Mirror => 1.0 - ((at * 0.5 - (at * 0.5).floor()) * 2.0 - 1.0).abs(),
        };
        ((at * size as f32) as usize).min(size.saturating_sub(1) as usize)
    };
    let column = place(u, texture.width, texture.wrap[0]);
    let row = texture.height.saturating_sub(1) as usize - place(v, texture.height, texture.wrap[1]);
    let texels = texture.texels.as_chunks::<4>().0;
    texels.get(row * texture.width as usize + column).map_or([1.0; 3], |texel| linear_of(texel, texture.encoding))
}

/// The image of a texture times a factor, sRGB.
fn image_of(of: &TextureRef, factor: [f32; 3]) -> PngImage {
    let texture = &of.texture;
    let as_they_are = factor == [1.0; 3] && texture.encoding == Encoding::Srgb;
    let tables: [Vec<u8>; 3] = std::array::from_fn(|channel| {
        let entry = |value: u8| match as_they_are {
            true => value,
            false => code(linear_of(&[value; 4], texture.encoding)[0] * factor[channel]),
        };
        (0..=u8::MAX).map(entry).collect()
    });
    let texels = texture.texels.as_chunks::<4>().0;
    let rgb = texels.iter().flat_map(|texel| [0, 1, 2].map(|i| tables[i][usize::from(texel[i])])).collect();
    PngImage { width: texture.width, height: texture.height, samples: PngSamples::Rgb8(rgb) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use syntable_model::digest::Digest;
    use syntable_model::scene::{Mesh, SourceModel, Texture};

    /// Two triangles that share an edge, each with its own material.
    fn model(materials: Vec<Material>, data: MeshData) -> ObjectModel {
        let positions = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0]];
        let triangles = vec![[0, 1, 2], [1, 3, 2]];
        let mesh = Mesh::new(MeshData { positions, triangles, ..data }).expect("sound");
        let source = SourceModel { origin: [0.05, 0.0, -0.2].into(), ..SourceModel::default() };
        ObjectModel { mesh: Arc::new(mesh), materials: materials.into_iter().map(Arc::new).collect(), source }
    }

    fn colored(factor: [f32; 3]) -> Material {
        Material { base_color: Color::constant(factor), ..Material::plain("m", [1.0; 3], 0.5) }
    }

    /// Two columns and two rows: red, green, blue, white, from the top left.
    fn texture(encoding: Encoding) -> Arc<Texture> {
        let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]].concat();
        let wrap = [Wrap::Repeat; 2];
        Arc::new(Texture { width: 2, height: 2, texels, encoding, wrap, digest: Digest::of(b"t") })
    }

    fn textured() -> Material {
        Material { base_color: Color::texture(texture(Encoding::Srgb)), ..colored([1.0; 3]) }
    }

    #[test]
    fn vertices_have_the_colors_of_their_materials() {
        let (vertices, faces, surface) = shown(&model(vec![], MeshData::default())).expect("shown");
        assert_eq!((vertices.len(), faces, surface), (4, vec![[0, 1, 2], [1, 3, 2]], ModelSurface::Plain));
        assert_eq!(vertices[0], [-50.0, 0.0, 200.0], "in the frame of the file");
        // A linear value of one half has the sRGB code 188.
        let two = vec![colored([1.0, 0.0, 0.0]), colored([0.0, 0.5, 0.0])];
        let slots = MeshData { slots: vec![0, 1], ..MeshData::default() };
        let (vertices, faces, surface) = shown(&model(two, slots)).expect("shown");
        let (red, green) = ([255, 0, 0], [0, 188, 0]);
        assert_eq!(surface, ModelSurface::Colors(vec![red, red, red, green, green, green]));
        assert_eq!((vertices.len(), faces), (6, vec![[0, 1, 2], [3, 4, 5]]));
        // The color of a vertex is multiplied by the factor.
        let data = MeshData { colors: vec![[1.0, 0.5, 0.0]; 4], ..MeshData::default() };
        let (.., surface) = shown(&model(vec![colored([0.5, 1.0, 1.0])], data)).expect("shown");
        assert_eq!(surface, ModelSurface::Colors(vec![[188, 188, 0]; 4]));
    }

    #[test]
    fn a_texture_stays_one_or_gives_its_colors_to_vertices() {
        let uvs = vec![[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [-0.25, 1.75]];
        let data = || MeshData { uvs: uvs.clone(), ..MeshData::default() };
        let (.., surface) = shown(&model(vec![textured()], data())).expect("shown");
        let ModelSurface::Texture { uvs: own, png } = surface else { panic!("a texture: {surface:?}") };
        assert_eq!(own, uvs);
        let read = syntable_formats::decode::FileContent::new(png, "texture.png".into()).rgb().expect("a PNG file");
        assert_eq!(read.data(), [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]]);
        // A second material, and coordinates that repeat: v points upwards.
        let pair = vec![textured(), textured()];
        let slots = MeshData { slots: vec![0, 0], ..data() };
        let (.., surface) = shown(&model(pair, slots)).expect("shown");
        assert_eq!(surface, ModelSurface::Colors(vec![[0, 0, 255], [255; 3], [255, 0, 0], [0, 255, 0]]));
        // Without coordinates, the color is the mean: each channel is set in two of four texels.
        let (.., surface) = shown(&model(vec![textured()], MeshData::default())).expect("shown");
        assert_eq!(surface, ModelSurface::Colors(vec![[188; 3]; 4]));
    }
}
