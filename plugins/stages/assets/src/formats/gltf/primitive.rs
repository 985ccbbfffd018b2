//! Primitives: the arrays of one mesh part.

use super::accessor::{self, indices, is_float, is_normalized, vectors, width};
use super::buffers::GltfBuffers;
use super::draco;
use super::layers::unit;
use super::materials::GltfMaterials;
use gltf::json::accessor::Accessor;
use gltf::json::mesh::{Mode, Primitive as JsonPrimitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use syntable_mesh::paint::full_intensity;
use syntable_model::error::{Error, Result};

/// Tolerance for colors above 1 by rounding.
const ROUNDING: f64 = 1e-3;

/// Four joints of a skin and their weights, for each vertex.
type Influences = Vec<([f32; 4], [f32; 4])>;

/// Arrays in the mesh's own frame. Missing arrays are empty.
pub struct PrimitiveArrays {
    /// Positions `[V]`.
    pub positions: Vec<[f32; 3]>,
    /// Normals `[V]`.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates `[V]`, v upwards.
    pub uvs: Vec<[f32; 2]>,
    /// Linear colors `[V]`.
    pub colors: Vec<[f32; 3]>,
    /// Opacities `[V]` of the colors.
    pub alphas: Vec<f32>,
    /// Joints of a skin and their weights `[V]`, several sets; empty without a skin.
    pub influences: Vec<Influences>,
    /// Triangles `[T]`.
    pub triangles: Vec<[u32; 3]>,
    /// Material slot.
    pub slot: u16,
}

/// How a node shapes the mesh that it places.
#[derive(Clone, Copy)]
pub struct Deformation<'a> {
    /// Weights of the morph targets. Missing weights are zero.
    pub weights: &'a [f32],
    /// Whether a skin poses it.
    pub skinned: bool,
}

impl PrimitiveArrays {
    /// Reads a primitive; `None` for points and lines. `placed` is the number of triangles of the model so far.
    pub fn read(
        document: &Root,
        buffers: &mut GltfBuffers<'_>,
        primitive: &JsonPrimitive,
        materials: &mut GltfMaterials<'_>,
        shape: Deformation<'_>,
        placed: usize,
    ) -> Result<Option<Self>> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => return Ok(None),
            Checked::Invalid => return Err(Error::new("an unknown drawing mode")),
        };
        let (mut reader, mode, corners) = AttributeReader::open(document, buffers, primitive, mode, placed)?;
        let mut positions = reader.positions()?;
        let mut normals = reader.vectors_of::<3>(Semantic::Normals, "normals")?;
        let uvs = match materials.uv_set(primitive.material)? {
            Some(set) => reader.vectors_of::<2>(Semantic::TexCoords(set), "texture coordinates")?,
            None => Vec::new(),
        };
        // glTF has v downwards from the top of the image.
        let uvs: Vec<[f32; 2]> = uvs.into_iter().map(|[u, v]| [u, 1.0 - v]).collect();
        let (colors, alphas) = reader.colors(materials)?;
        reader.displace(shape.weights, &mut positions, &mut normals)?;
        let influences = if shape.skinned { reader.influences()? } else { Vec::new() };
        let triangles = assemble(mode, &corners)?;
        let slot = materials.slot(primitive.material, !uvs.is_empty(), triangles.len())?;
        Ok(Some(Self { positions, normals, uvs, colors, alphas, influences, triangles, slot }))
    }
}

/// Reads the attributes of the vertices that a primitive uses.
struct AttributeReader<'r, 'b> {
    document: &'r Root,
    buffers: &'r mut GltfBuffers<'b>,
    primitive: &'r JsonPrimitive,
    /// Number of vertices of each array.
    count: u64,
    position: Index<Accessor>,
    /// The vertices that the primitive uses, if it does not use all.
    used: Option<Vec<u32>>,
}

impl<'r, 'b> AttributeReader<'r, 'b> {
    /// The reader, and the corners of the triangles as indices of the vertices that it reads, with their mode.
    fn open(
        document: &'r Root,
        buffers: &'r mut GltfBuffers<'b>,
        primitive: &'r JsonPrimitive,
        mode: Mode,
        placed: usize,
    ) -> Result<(Self, Mode, Vec<u32>)> {
        let Some(&position) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            return Err(Error::new("no vertex positions"));
        };
        let unpacked = draco::unpack(document, buffers, primitive, placed)?;
        let count = accessor::count(document, buffers, position, 3)?;
        let (mode, corners) = match unpacked {
            Some(corners) => (Mode::Triangles, corners),
            None => (mode, corners(document, buffers, primitive, mode, count, placed)?),
        };
        if let Some(index) = corners.iter().find(|&&index| u64::from(index) >= count) {
            return Err(Error::new(format!("index {index}, but only {count} vertices")));
        }
        // If many primitives share arrays, each reads only the vertices that it uses.
        let (corners, used) = if (corners.len() as u64) < count { compact(corners) } else { (corners, None) };
        Ok((Self { document, buffers, primitive, count, position, used }, mode, corners))
    }

    fn attribute(&self, semantic: Semantic) -> Option<Index<Accessor>> {
        self.primitive.attributes.get(&Checked::Valid(semantic)).copied()
    }

    fn positions(&mut self) -> Result<Vec<[f32; 3]>> {
        let positions = vectors::<3>(self.document, self.buffers, self.position, self.used.as_deref(), "positions")?;
        if let Some((i, p)) = positions.iter().enumerate().find(|(_, p)| !p.iter().all(|x| x.is_finite())) {
            let i = self.used.as_ref().and_then(|used| used.get(i)).map_or(i, |&i| i as usize);
            return Err(Error::new(format!("non-finite vertex {i}: {p:?}")));
        }
        Ok(positions)
    }

    /// Reads an array with a vector per vertex.
    fn vectors<const N: usize>(&mut self, index: Index<Accessor>, what: &str) -> Result<Vec<[f32; N]>> {
        match self.buffers.count(index)? {
            length if length == self.count => {
                vectors::<N>(self.document, self.buffers, index, self.used.as_deref(), what)
            }
            length => Err(Error::new(format!("{length} {what} for {} vertices", self.count))),
        }
    }

    /// Reads an attribute; empty if the primitive lacks it.
    fn vectors_of<const N: usize>(&mut self, semantic: Semantic, what: &str) -> Result<Vec<[f32; N]>> {
        self.attribute(semantic).map_or(Ok(Vec::new()), |index| self.vectors(index, what))
    }

    /// Colors, linear in [0, 1], and opacities, which are empty if all are 1.
    fn colors(&mut self, materials: &mut GltfMaterials<'_>) -> Result<(Vec<[f32; 3]>, Vec<f32>)> {
        let colors = match self.attribute(Semantic::Colors(0)) {
            Some(index) => self.fractions(index, materials)?,
            None => Vec::new(),
        };
        if self.attribute(Semantic::Colors(1)).is_some() {
            materials.warn("COLOR_1 is ignored: COLOR_0 colors the mesh");
        }
        let is_clear = colors.iter().any(|color| color[3] < 1.0);
        let alphas = if is_clear { colors.iter().map(|color| unit(color[3])).collect() } else { Vec::new() };
        Ok((colors.into_iter().map(|[r, g, b, _]| [r, g, b].map(unit)).collect(), alphas))
    }

    /// Colors with opacities as fractions. The standard requires that: floats, or integers marked as normalized.
    fn fractions(&mut self, index: Index<Accessor>, materials: &mut GltfMaterials<'_>) -> Result<Vec<[f32; 4]>> {
        let has_alpha = width(self.document, index)? == 4;
        let mut colors: Vec<[f32; 4]> = if has_alpha {
            self.vectors::<4>(index, "colors")?
        } else {
            self.vectors::<3>(index, "colors")?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
        };
        let rgb = || colors.iter().flat_map(|color| &color[..3]).map(|&x| f64::from(x));
        let full = full_intensity(rgb());
        let is_float = is_float(self.document, index)?;
        // Floats with fractional parts are not bytes, however large: light above white.
        if is_float && rgb().any(|x| x > 0.0 && x.is_finite() && x.fract() != 0.0) {
            if rgb().any(|x| x > 1.0 + ROUNDING) {
                materials.warn("COLOR_0 has numbers above 1, which are clamped to 1");
            }
        } else if full > 1.0 || !(is_float || is_normalized(self.document, index)?) {
            let full = full.max(255.0);
            materials.warn(&format!("COLOR_0 is not normalized; its range is taken as 0 to {full}"));
            // Floats may hold bytes for colors and a fraction for opacity.
            let scales_alpha = has_alpha && !(is_float && colors.iter().all(|color| color[3] <= 1.0));
            for color in &mut colors {
                let channels = if scales_alpha { 4 } else { 3 };
                color[..channels].iter_mut().for_each(|x| *x = (f64::from(*x) / full) as f32);
            }
        }
        Ok(colors)
    }

    /// Adds the displacements of morph targets, each times its weight.
    fn displace(&mut self, weights: &[f32], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) -> Result<()> {
        let primitive = self.primitive;
        for (target, &weight) in primitive.targets.iter().flatten().zip(weights) {
            if weight == 0.0 {
                continue;
            }
            for (array, accessor, what) in [
                (&mut *positions, target.positions, "displacements"),
                (&mut *normals, target.normals, "displacements of normals"),
            ] {
                let Some(accessor) = accessor.filter(|_| !array.is_empty()) else { continue };
                for (value, by) in array.iter_mut().zip(self.vectors::<3>(accessor, what)?) {
                    *value = std::array::from_fn(|axis| value[axis] + weight * by[axis]);
                }
            }
        }
        Ok(())
    }

    /// Joints of a skin and their weights, set by set.
    fn influences(&mut self) -> Result<Vec<Influences>> {
        let mut influences = Vec::new();
        for set in 0.. {
            let sets = (self.attribute(Semantic::Joints(set)), self.attribute(Semantic::Weights(set)));
            let (Some(joints), Some(weights)) = sets else { break };
            let joints = self.vectors::<4>(joints, "joints")?;
            let weights = self.vectors::<4>(weights, "weights")?;
            influences.push(joints.into_iter().zip(weights).collect());
        }
        Ok(influences)
    }
}

/// The corners of a primitive whose indices are plain.
fn corners(
    document: &Root,
    buffers: &mut GltfBuffers<'_>,
    primitive: &JsonPrimitive,
    mode: Mode,
    count: u64,
    placed: usize,
) -> Result<Vec<u32>> {
    let length = match primitive.indices {
        Some(index) => accessor::count(document, buffers, index, 1)?,
        None => count,
    };
    // Indices are counted before they are read: several primitives may share one long accessor.
    let triangles = if mode == Mode::Triangles { length / 3 } else { length.saturating_sub(2) };
    buffers.budget().triangles(placed.saturating_add(usize::try_from(triangles).unwrap_or(usize::MAX)))?;
    match primitive.indices {
        Some(index) => indices(document, buffers, index),
        None => {
            Ok((0..u32::try_from(count).map_err(|_| Error::new(format!("{count} vertices are too many")))?).collect())
        }
    }
}

/// Corners by the numbers of the used vertices, and those vertices in order.
fn compact(corners: Vec<u32>) -> (Vec<u32>, Option<Vec<u32>>) {
    let mut used = corners.clone();
    used.sort_unstable();
    used.dedup();
    let number = |corner: u32| used.binary_search(&corner).unwrap_or(0) as u32;
    (corners.into_iter().map(number).collect(), Some(used))
}

fn assemble(mode: Mode, corners: &[u32]) -> Result<Vec<[u32; 3]>> {
    if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
        return Err(Error::new(format!("{} corners are not a multiple of three", corners.len())));
    }
    let triangles: Vec<[u32; 3]> = match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, c)| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[1], c[0], c[2]] })
            .collect(),
        Mode::TriangleFan => corners.windows(2).skip(1).map(|c| [corners[0], c[0], c[1]]).collect(),
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    };
    Ok(triangles)
}
