//! Colors and opacities of vertices, corners and faces.

use crate::Model;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use syntable_model::color::srgb_to_linear;
use syntable_model::context::Log;
use syntable_model::error::Error;
use syntable_model::scene::{Alpha, Material, MeshData};

/// Maximum number of different face opacities. More are rounded to [`STEPS`], because each needs its own material.
const MAX_OPACITIES: usize = 32;
/// Number of steps of rounded opacities.
const STEPS: f32 = 16.0;

/// The number for full intensity in formats that do not state whether colors are fractions, bytes or words.
///
/// Numbers up to 1 are fractions. So are fractional numbers up to 2: rounding errors, or light above white. Others are
/// bytes up to 255 and 16-bit words up to 65535. Negative and non-finite numbers are ignored.
pub fn full_intensity(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut largest, mut whole) = (0.0_f64, true);
    for value in values.into_iter().filter(|value| value.is_finite() && *value > 0.0) {
        largest = largest.max(value);
        whole &= value.fract() == 0.0;
    }
    match largest {
        _ if largest <= 1.0 || (largest <= 2.0 && !whole) => 1.0,
        _ if largest <= 255.0 => 255.0,
        _ if largest <= 65_535.0 => 65_535.0,
        _ => largest,
    }
}

/// Converts a display color, sRGB-encoded with a given full intensity, to linear Rec. 709. A non-finite channel becomes
/// full intensity.
pub fn linear_of_display(color: [f64; 3], full: f64) -> [f32; 3] {
    color.map(|x| srgb_to_linear(if x.is_finite() { (x / full).clamp(0.0, 1.0) as f32 } else { 1.0 }))
}

/// Sets the linear color and the opacity of every corner, by triangle and number of the corner. Splits a vertex whose
/// corners differ; vertices follow the order in which triangles use them. Returns their opacities.
pub fn paint_corners(mesh: &mut MeshData, color: impl Fn(usize, usize) -> [f32; 4]) -> Vec<f32> {
    let mut painted = MeshData { slots: std::mem::take(&mut mesh.slots), ..MeshData::default() };
    let mut alphas = Vec::new();
    let mut known: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        painted.triangles.push(std::array::from_fn(|k| {
            let (index, color) = (triangle[k], color(t, k));
            *known.entry((index, color.map(f32::to_bits))).or_insert_with(|| {
                let i = index as usize;
                painted.positions.push(mesh.positions[i]);
                painted.normals.extend(mesh.normals.get(i));
                painted.uvs.extend(mesh.uvs.get(i));
                let [r, g, b, alpha] = color;
                painted.colors.push([r, g, b]);
                alphas.push(alpha);
                (painted.positions.len() - 1) as u32
            })
        }));
    }
    *mesh = painted;
    alphas
}

/// Applies the rule that a texture hides other colors, as viewers of OBJ and PLY do: faces with a texture lose the
/// colors of their vertices or corners. A warning without a file reports colors that are not white. Returns the
/// opacities of the vertices; empty if all are opaque.
///
/// `alphas` are the opacities of the vertices, or empty. `corners` are the linear colors and opacities by triangle and
/// corner; they apply only if the vertices have no colors. `textured` states which triangles have a texture. In glTF,
/// the texture multiplies vertex colors instead, and STL has no textures.
pub fn hide_colors_under_textures(
    mesh: &mut MeshData,
    alphas: Vec<f32>,
    corners: &[[[f32; 4]; 3]],
    textured: &[bool],
    log: &dyn Log,
) -> Vec<f32> {
    let by_vertex = !mesh.colors.is_empty();
    if (!by_vertex && corners.is_empty()) || (by_vertex && !textured.contains(&true)) {
        return alphas;
    }
    let (colors, triangles) = (std::mem::take(&mut mesh.colors), mesh.triangles.clone());
    let stated = |t: usize, k: usize| {
        let vertex = triangles[t][k] as usize;
        colors
            .get(vertex)
            .map_or_else(|| corners[t][k], |&[r, g, b]| [r, g, b, alphas.get(vertex).copied().unwrap_or(1.0)])
    };
    let hidden = (0..triangles.len()).any(|t| textured[t] && (0..3).any(|k| stated(t, k) != [1.0; 4]));
    if hidden {
        log.warn(&Error::new("a texture hides the colors of vertices or faces below it; these colors are ignored"));
    } else if by_vertex {
        mesh.colors = colors;
        return alphas;
    }
    if textured.iter().all(|&textured| textured) {
        return Vec::new();
    }
    paint_corners(mesh, |t, k| if textured[t] { [1.0; 4] } else { stated(t, k) })
}

/// Effect of a vertex's opacity on a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VertexAlpha {
    /// No effect.
    Ignored,
    /// Multiplies the alpha that a masked material compares with its cutoff.
    Masks,
    /// Blends the material.
    Blends,
}

/// Applies the opacities of vertices, in [0, 1], to the materials: exactly for faces of equal opacity, else as the mean
/// of the corners. Drops faces that become invisible. If all faces would become invisible, the materials stay
/// unchanged, because programs write 0 for an unknown opacity. `meaning` states the effect of opacity by slot. Warnings
/// name no file.
pub fn blend_by_vertex(model: &mut Model, alphas: &[f32], meaning: impl Fn(usize) -> VertexAlpha, log: &dyn Log) {
    let Model { mesh, materials } = model;
    let slots: Vec<u16> = (0..mesh.triangles.len()).map(|t| mesh.slots.get(t).copied().unwrap_or(0)).collect();
    let corners: Vec<[f32; 3]> = mesh
        .triangles
        .iter()
        .zip(&slots)
        .map(|(triangle, &slot)| match meaning(slot.into()) {
            VertexAlpha::Ignored => [1.0; 3],
            _ => triangle.map(|i| alphas.get(i as usize).copied().unwrap_or(1.0)),
        })
        .collect();
    if corners.as_flattened().iter().all(|&alpha| alpha >= 1.0) {
        return;
    }
    if corners.as_flattened().iter().all(|&alpha| alpha <= 0.0) {
        log.warn(&Error::new("all vertex colors have alpha 0 and would be invisible; they are treated as opaque"));
        return;
    }
    let varying = corners.iter().filter(|[a, b, c]| a != b || b != c).count();
    let mut opacities: Vec<f32> =
        corners.iter().map(|&[a, b, c]| if a == b && b == c { a } else { (a + b + c) / 3.0 }).collect();
    // Visibility is decided before rounding, so rounding does not change it.
    let visible: Vec<bool> = opacities
        .iter()
        .zip(&slots)
        .map(|(&alpha, &slot)| is_visible(&materials[usize::from(slot)], alpha, meaning(slot.into())))
        .collect();
    if !visible.contains(&true) {
        let message = "the alpha of the vertex colors would make all faces invisible, and is ignored";
        log.warn(&Error::new(message));
        return;
    }
    let distinct: BTreeSet<u32> = opacities.iter().map(|alpha| alpha.to_bits()).collect();
    if distinct.len() > MAX_OPACITIES {
        opacities.iter_mut().for_each(|alpha| *alpha = (*alpha * STEPS).round().max(1.0) / STEPS);
    }
    if varying > 0 {
        let message =
            format!("the alpha of vertex colors varies within {varying} faces; each face gets the mean of its corners");
        log.warn(&Error::new(message));
    }
    // New slot by old slot and opacity; `None` if the mesh has too many materials.
    let mut known: BTreeMap<(u16, u32), Option<u16>> = BTreeMap::new();
    let invisible = visible.iter().filter(|&&visible| !visible).count();
    let mut unchanged = 0;
    let triangles = std::mem::take(&mut mesh.triangles);
    mesh.slots.clear();
    for (((triangle, slot), alpha), visible) in triangles.into_iter().zip(slots).zip(opacities).zip(visible) {
        if !visible {
            continue;
        }
        let new = *known.entry((slot, alpha.to_bits())).or_insert_with(|| {
            let old = &materials[usize::from(slot)];
            let changed = with_opacity(old, alpha, meaning(slot.into()));
            if changed.digest == old.digest {
                return Some(slot);
            }
            let number = u16::try_from(materials.len()).ok()?;
            materials.push(changed);
            Some(number)
        });
        unchanged += usize::from(new.is_none());
        mesh.triangles.push(triangle);
        mesh.slots.push(new.unwrap_or(slot));
    }
    if unchanged > 0 {
        let message = format!(
            "the alpha of vertex colors is ignored for {unchanged} faces, because the mesh has 65536 materials"
        );
        log.warn(&Error::new(message));
    }
    if invisible > 0 {
        log.warn(&Error::new(format!(
            "the alpha of the vertex colors makes {invisible} faces invisible; they were dropped"
        )));
    }
}

/// Whether any part of a material is visible at a given vertex opacity.
fn is_visible(material: &Material, alpha: f32, meaning: VertexAlpha) -> bool {
    match (meaning, material.alpha) {
        _ if alpha >= 1.0 => true,
        // Texels have at most alpha 1.
        (VertexAlpha::Masks, Alpha::Mask { cutoff }) => alpha >= cutoff,
        (VertexAlpha::Masks | VertexAlpha::Ignored, _) => true,
        (VertexAlpha::Blends, _) => alpha > 0.0,
    }
}

/// A material with a vertex opacity that leaves it visible.
fn with_opacity(material: &Material, alpha: f32, meaning: VertexAlpha) -> Material {
    let mut changed = material.clone();
    changed.alpha = match (meaning, material.alpha) {
        _ if alpha >= 1.0 || meaning == VertexAlpha::Ignored => material.alpha,
        // A rounded opacity may be below the cutoff.
        (VertexAlpha::Masks, Alpha::Mask { cutoff }) if cutoff > 0.0 => {
            Alpha::Mask { cutoff: (cutoff / alpha).min(1.0) }
        }
        (VertexAlpha::Masks, other) => other,
        (_, Alpha::Blend { factor }) => Alpha::Blend { factor: factor * alpha },
        _ => Alpha::Blend { factor: alpha },
    };
    changed.with_digest()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::default_material;
    use syntable_model::context::Collected;

    #[test]
    fn the_range_of_colors_is_found() {
        for (values, full) in [
            (vec![], 1.0),
            (vec![0.0, 1.0], 1.0),
            (vec![0.2, 0.999_999, 1.000_001], 1.0),
            (vec![0.2, 1.7], 1.0),
            (vec![0.0, 2.0], 255.0),
            (vec![3.5, 254.9], 255.0),
            (vec![0.0, 256.0], 65_535.0),
            (vec![0.0, 70_000.0], 70_000.0),
            (vec![f64::NAN, 0.5, f64::INFINITY], 1.0),
            (vec![-1e-6, 2.0], 255.0),
            (vec![-300.5, 1.0], 1.0),
        ] {
            assert_eq!(full_intensity(values.iter().copied()), full, "{values:?}");
        }
        assert_eq!(linear_of_display([255.0, 0.0, f64::NAN], 255.0), [1.0, 0.0, 1.0]);
        // By the formula of the standard: ((0.5 + 0.055) / 1.055)^2.4.
        assert!((linear_of_display([0.5; 3], 1.0)[1] - 0.214_041).abs() < 1e-6);
    }

    fn model() -> Model {
        let mesh = MeshData {
            positions: (0..4).map(|i| [i as f32, 0.0, 0.0]).collect(),
            triangles: vec![[0, 1, 2], [1, 2, 3]],
            ..MeshData::default()
        };
        Model { mesh, materials: vec![default_material(true)] }
    }

    #[test]
    fn corners_of_one_color_share_their_vertex() {
        let Model { mut mesh, .. } = model();
        let alphas = paint_corners(&mut mesh, |t, k| if t == 0 || k == 2 { [1.0; 4] } else { [0.5; 4] });
        let all = |t: usize| mesh.triangles[t].map(|i| (mesh.positions[i as usize][0], mesh.colors[i as usize][0]));
        assert_eq!(all(0), [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]);
        assert_eq!(all(1), [(1.0, 0.5), (2.0, 0.5), (3.0, 1.0)]);
        assert_eq!((mesh.positions.len(), alphas), (6, vec![1.0, 1.0, 1.0, 0.5, 0.5, 1.0]));
    }

    #[test]
    fn a_texture_hides_other_colors() {
        let (red, white) = ([1.0, 0.0, 0.0], [1.0; 3]);
        let check = |colors: &[[f32; 3]], corners: &[[[f32; 4]; 3]], textured: [bool; 2], want: &[[f32; 3]], warns| {
            let (Model { mut mesh, .. }, log) = (model(), Collected::default());
            mesh.colors = colors.to_vec();
            let alphas = hide_colors_under_textures(&mut mesh, Vec::new(), corners, &textured, &log);
            let found: Vec<[f32; 3]> =
                mesh.triangles.as_flattened().iter().filter_map(|&i| mesh.colors.get(i as usize).copied()).collect();
            assert_eq!((found.as_slice(), log.warnings().len()), (want, usize::from(warns)), "{textured:?}");
            assert!(alphas.iter().all(|&alpha| alpha == 1.0));
        };
        let reds = [red; 4];
        check(&reds, &[], [false; 2], &[red; 6], false);
        check(&reds, &[], [true; 2], &[], true);
        check(&reds, &[], [true, false], &[white, white, white, red, red, red], true);
        // Only the corner of the second triangle that the first lacks is red: the texture of the first hides nothing.
        check(&[white, white, white, red], &[], [true, false], &[white, white, white, white, white, red], false);
        let corners = [[[1.0, 0.0, 0.0, 1.0]; 3], [[1.0; 4]; 3]];
        check(&[], &corners, [false; 2], &[red, red, red, white, white, white], false);
        check(&[], &corners, [true; 2], &[], true);
        check(&[], &corners, [true, false], &[white; 6], true);
        check(&[], &corners, [false, true], &[red, red, red, white, white, white], false);
        check(&[], &[], [true; 2], &[], false);
    }

    #[test]
    fn opacity_goes_into_materials() {
        let check = |alphas: [f32; 4], material: Alpha, meaning, want: &[Alpha], said: &[&str]| {
            let (mut model, log) = (model(), Collected::default());
            model.materials[0].alpha = material;
            model.materials[0] = model.materials[0].clone().with_digest();
            blend_by_vertex(&mut model, &alphas, |_| meaning, &log);
            let slots = (0..model.mesh.triangles.len()).map(|t| model.mesh.slots.get(t).map_or(0, |&slot| slot.into()));
            let got: Vec<Alpha> = slots.map(|slot: usize| model.materials[slot].alpha).collect();
            let near = |(a, b): (&Alpha, &Alpha)| match (*a, *b) {
                (Alpha::Mask { cutoff: a }, Alpha::Mask { cutoff: b }) => (a - b).abs() < 1e-6,
                (Alpha::Blend { factor: a }, Alpha::Blend { factor: b }) => (a - b).abs() < 1e-6,
                (a, b) => a == b,
            };
            assert!(got.len() == want.len() && got.iter().zip(want).all(near), "{alphas:?}: {got:?}, not {want:?}");
            let warnings: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
            assert_eq!(warnings.len(), said.len(), "{warnings:?}");
            assert!(warnings.iter().zip(said).all(|(warning, said)| warning.contains(said)), "{warnings:?}");
        };
        let (opaque, half) = (Alpha::Opaque, Alpha::Blend { factor: 0.5 });
        check([1.0; 4], opaque, VertexAlpha::Blends, &[opaque; 2], &[]);
        check([0.5; 4], opaque, VertexAlpha::Blends, &[half; 2], &[]);
        check([0.5; 4], opaque, VertexAlpha::Ignored, &[opaque; 2], &[]);
        check([0.5; 4], half, VertexAlpha::Blends, &[Alpha::Blend { factor: 0.25 }; 2], &[]);
        check([0.0; 4], opaque, VertexAlpha::Blends, &[opaque; 2], &["treated as opaque"]);
        // (0 + 0.75 + 0.75) / 3 is a half.
        check(
            [0.0, 0.75, 0.75, 0.75],
            opaque,
            VertexAlpha::Blends,
            &[half, Alpha::Blend { factor: 0.75 }],
            &["within 1 faces"],
        );
        check(
            [1.0, 0.0, 0.0, 0.0],
            half,
            VertexAlpha::Blends,
            &[Alpha::Blend { factor: 0.5 / 3.0 }],
            &["within 1", "1 faces invisible"],
        );
        let mask = |cutoff| Alpha::Mask { cutoff };
        check([0.8; 4], mask(0.4), VertexAlpha::Masks, &[mask(0.5); 2], &[]);
        check([0.3; 4], mask(0.5), VertexAlpha::Masks, &[mask(0.5); 2], &["all faces invisible"]);
        check(
            [1.0, 0.2, 0.2, 0.2],
            mask(0.4),
            VertexAlpha::Masks,
            &[mask(0.4 / (1.4 / 3.0))],
            &["within 1", "1 faces"],
        );
    }

    /// Faces with one opacity each, and the materials of the remaining faces.
    fn blended(alphas: &[f32], material: Alpha, meaning: VertexAlpha) -> Vec<Alpha> {
        let mesh = MeshData {
            positions: vec![[0.0; 3]; 3 * alphas.len()],
            triangles: (0..alphas.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..MeshData::default()
        };
        let mut model = Model { mesh, materials: vec![default_material(true)] };
        model.materials[0].alpha = material;
        model.materials[0] = model.materials[0].clone().with_digest();
        let by_corner: Vec<f32> = alphas.iter().flat_map(|&alpha| [alpha; 3]).collect();
        blend_by_vertex(&mut model, &by_corner, |_| meaning, &Collected::default());
        model.mesh.slots.iter().map(|&slot| model.materials[usize::from(slot)].alpha).collect()
    }

    #[test]
    fn rounded_opacities_leave_no_holes() {
        // Forty opacities; all but the first are visible.
        let alphas: Vec<f32> = (0..40).map(|i| i as f32 / 100.0).collect();
        let got = blended(&alphas, Alpha::Opaque, VertexAlpha::Blends);
        assert_eq!(got.len(), 39);
        for (alpha, got) in alphas[1..].iter().zip(got) {
            let Alpha::Blend { factor } = got else { panic!("{alpha}: {got:?}") };
            assert!(factor > 0.0 && (factor - alpha).abs() <= 1.0 / 16.0, "{alpha}: {factor}");
        }
        // The cutoff is compared with the opacities of the file: 0.25 to 0.39 are not below it.
        let got = blended(&alphas, Alpha::Mask { cutoff: 0.25 }, VertexAlpha::Masks);
        assert_eq!(got.len(), 15);
        for got in got {
            assert!(matches!(got, Alpha::Mask { cutoff } if (0.0..=1.0).contains(&cutoff)), "{got:?}");
        }
    }
}
