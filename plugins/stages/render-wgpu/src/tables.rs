//! Tables of a scene and of a view, as the shaders read them: entries of four words, section after section.

use crate::arena::Place;
use crate::layout::{BODY_SIZE, BodyPlace, NONE};
use std::sync::Arc;
use syntable_model::scene::{ColorMatrix, Encoding, EnvironmentMap, Wrap};
use syntable_model::stage::Window;
use syntable_prepare::{
    AlphaMode, AreaLight, ColorInput, DistantLight, EmissiveBody, EnvironmentDistribution, LightTable, Mapping,
    Material, MaterialLayers, MipTexture, NO_WINDOW, NormalInput, PlacedEnvironment, PlacedMap, PreparedBody,
    ProjectedEnvironment, SampleOrder, ScalarInput, TextureBinding, UvAffine, decoding,
};
use syntable_simd::Vec3;
use syntable_simd::functions::FAR;
use syntable_transport::RayCamera;
use syntable_transport::bsdf::{sheen_table, table};

/// Entries, appended section by section.
#[derive(Clone, Debug, Default)]
pub struct Tables(Vec<[u32; 4]>);

/// A window with bodies of its own, among others.
#[derive(Clone, Copy, Debug)]
pub struct TilePlace {
    /// Column and row in the image minus column and row among the tiles.
    pub offset: [i32; 2],
    /// First of its emissive bodies, and their number.
    pub emitters: [u32; 2],
    /// Root of the top level of all bodies of the tile.
    pub all: u32,
    /// Root of the top level of the bodies that camera rays meet.
    pub seen: u32,
}

/// Places of environments among the images.
pub trait EnvironmentPlaces {
    /// Radiance of a map, row by row.
    fn radiance(&self, map: &EnvironmentMap) -> Place;
    /// Cumulative probabilities of the rows, then of the texels in each row.
    fn distribution(&self, distribution: &EnvironmentDistribution) -> Place;
}

fn words(v: Vec3, w: u32) -> [u32; 4] {
    [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), w]
}

fn floats(v: [f32; 4]) -> [u32; 4] {
    v.map(f32::to_bits)
}

impl Tables {
    /// The entries.
    pub fn entries(&self) -> &[[u32; 4]] {
        &self.0
    }

    /// Number of entries.
    fn len(&self) -> u32 {
        self.0.len() as u32
    }

    /// Appends numbers, four per entry; returns where they start.
    fn list(&mut self, numbers: impl IntoIterator<Item = u32>) -> u32 {
        let start = self.len();
        let numbers: Vec<u32> = numbers.into_iter().collect();
        for chunk in numbers.chunks(4) {
            let mut entry = [0; 4];
            entry[..chunk.len()].copy_from_slice(chunk);
            self.0.push(entry);
        }
        start
    }

    /// Appends the tables of albedos, and the decoding of sRGB; returns where each starts.
    pub fn constants(&mut self) -> [u32; 2] {
        let lobes = self.len();
        let halves = |cell: &[f32; 8]| {
            let [a, b, c, d, e, f, g, h] = *cell;
            [floats([a, b, c, d]), floats([e, f, g, h])]
        };
        self.0.extend(table().directional().iter().flat_map(halves));
        self.0.extend(table().mean().iter().map(|cell| halves(cell)[0]));
        self.0.extend(sheen_table().iter().map(|cell| halves(cell)[0]));
        [lobes, self.list(decoding(Encoding::Srgb).iter().map(|x| x.to_bits()))]
    }

    /// Appends bodies; returns where they start.
    pub fn bodies<'a>(&mut self, bodies: impl Iterator<Item = (&'a PreparedBody, BodyPlace)>) -> u32 {
        let start = self.len();
        for (body, place) in bodies {
            let [x, y, z] = body.rotation;
            let before = self.len();
            self.0.push(words(x, place.shading));
            self.0.push(words(y, place.tangents));
            self.0.push(words(z, place.colors));
            self.0.push(words(body.translation, body.flags));
            self.0.push([body.first_material, body.last_slot, 0, 0]);
            debug_assert_eq!(self.len() - before, BODY_SIZE);
        }
        start
    }

    fn input(&mut self, factor: Vec3, binding: &TextureBinding, channel: u32) {
        let UvAffine { m: [[a, b], [c, d]], offset: [u, v], .. } = binding.transform;
        self.0.push(words(factor, binding.texture));
        self.0.push(floats([a, b, c, d]));
        self.0.push([u.to_bits(), v.to_bits(), binding.level_bias.to_bits(), channel]);
    }

    fn color(&mut self, input: &ColorInput) {
        self.input(input.factor, &input.texture, 0);
    }

    fn scalar(&mut self, input: &ScalarInput) {
        self.input(Vec3::from([input.factor, 0.0, 0.0]), &input.texture, input.channel);
    }

    fn normal(&mut self, input: &NormalInput) {
        self.input(Vec3::from([input.strength, 0.0, 0.0]), &input.texture, 0);
    }

    /// Appends materials; returns where they start.
    pub fn materials(&mut self, materials: &[Material]) -> u32 {
        let start = self.len();
        for material in materials {
            self.color(&material.base_color);
            self.scalar(&material.roughness);
            self.scalar(&material.metallic);
            self.normal(&material.normal);
            self.color(&material.emission);
            let (alpha, value) = match material.alpha {
                AlphaMode::Opaque => (0, 0.0),
                AlphaMode::Mask(cutoff) => (1, cutoff),
                AlphaMode::Blend(factor) => (2, factor),
            };
            self.0.push([material.dielectric_f0.to_bits(), material.layers, alpha, value.to_bits()]);
            let (boxed, per_m, affine) = match material.mapping {
                Mapping::Uv(affine) => (0, 0.0, affine),
                Mapping::Box { per_m, transform } => (1, per_m, transform),
            };
            let height = material.projection_height;
            let projects = u32::from(height.is_some());
            self.0.push([boxed, per_m.to_bits(), height.unwrap_or(0.0).to_bits(), projects]);
            let UvAffine { m: [[a, b], [c, d]], offset: [u, v], log2_scale } = affine;
            self.0.push(floats([a, b, c, d]));
            let flags = u32::from(material.is_untextured()) + 2 * u32::from(material.recolor.is_some());
            self.0.push([u.to_bits(), v.to_bits(), log2_scale.to_bits(), flags]);
            let ColorMatrix(rows) = material.recolor.unwrap_or_default();
            self.0.extend(rows.map(|[r, g, b]| floats([r, g, b, 0.0])));
        }
        start
    }

    /// Appends layers of materials; returns where they start.
    pub fn layers(&mut self, layers: &[MaterialLayers]) -> u32 {
        let start = self.len();
        for layers in layers {
            self.scalar(&layers.clearcoat);
            self.scalar(&layers.clearcoat_roughness);
            self.normal(&layers.clearcoat_normal);
            self.color(&layers.sheen_color);
            self.scalar(&layers.sheen_roughness);
            self.scalar(&layers.transmission);
            self.0.push(words(layers.absorption, layers.ior.to_bits()));
            self.0.push([layers.has_volume, 0, 0, 0]);
        }
        start
    }

    /// Appends headers of textures, whose levels lie one after the other from a place on; returns where the headers
    /// start.
    pub fn textures<'a>(&mut self, textures: impl Iterator<Item = (&'a Arc<MipTexture>, Place)>) -> u32 {
        let mut headers = Vec::new();
        for (texture, place) in textures {
            let wrap = texture.wrap().map(|wrap| match wrap {
                Wrap::Repeat => 0,
                Wrap::Mirror => 1,
                Wrap::Clamp => 2,
            });
            let srgb = u32::from(texture.encoding() == Encoding::Srgb);
            headers.push([self.len(), texture.levels().len() as u32, wrap[0] | wrap[1] << 16, srgb]);
            let mut at = place;
            for level in texture.levels() {
                self.0.push([level.width, level.height, at, 0]);
                at += level.width * level.height;
            }
        }
        let start = self.len();
        self.0.extend(headers);
        start
    }

    /// Appends an environment map, and its distribution if it is sampled.
    fn environment(
        &mut self,
        placed: &PlacedMap,
        sampled: Option<&PlacedEnvironment>,
        places: &impl EnvironmentPlaces,
    ) {
        let (width, height) = (placed.map.width(), placed.map.height());
        let rows = sampled.map_or(NONE, |sampled| places.distribution(&sampled.distribution));
        let luminance = sampled.map_or(0.0, |sampled| sampled.luminance);
        let (sin, cos) = placed.rotation;
        self.0.push([width, height, rows, rows.wrapping_add(height)]);
        self.0.push([places.radiance(&placed.map), sin.to_bits(), cos.to_bits(), luminance.to_bits()]);
        self.0.push(words(placed.scale, 0));
    }

    /// Appends lights with a shape, and the patterns of windows; returns where each starts.
    pub fn area_lights(&mut self, table: &LightTable, places: &impl EnvironmentPlaces) -> [u32; 2] {
        let mut patterns = Vec::new();
        for window in &table.windows {
            let [columns, rows] = [&window.spans[0], &window.spans[1]].map(|spans| {
                let start = self.len();
                self.0.extend(spans.iter().map(|&[low, high]| floats([low, high, 0.0, 0.0])));
                [start, spans.len() as u32]
            });
            patterns.push([columns[0], columns[1], rows[0], rows[1]]);
        }
        let windows = self.len();
        for (window, spans) in table.windows.iter().zip(patterns) {
            self.0.push(spans);
            self.0.push(words(window.frame_radiance, 0));
            self.environment(&window.view, None, places);
        }
        let start = self.len();
        let zero = Vec3::ZERO;
        for light in &table.area {
            let (sort, center, [x, y, normal], [a, b], radius, radiance, luminance, window) = match light {
                AreaLight::Sphere(s) => {
                    (0, s.center, [zero; 3], [0.0; 2], s.radius, s.radiance, s.luminance, NO_WINDOW)
                }
                AreaLight::Rect(r) => {
                    (1, r.center, [r.x, r.y, r.normal], r.half, 0.0, r.radiance, r.luminance, r.window)
                }
                AreaLight::Disk(d) => {
                    (2, d.center, [zero, zero, d.normal], [0.0; 2], d.radius, d.radiance, d.luminance, NO_WINDOW)
                }
            };
            self.0.push(words(center, 0));
            self.0.push(words(x, a.to_bits()));
            self.0.push(words(y, b.to_bits()));
            self.0.push(words(normal, radius.to_bits()));
            self.0.push(words(radiance, luminance.to_bits()));
            self.0.push([sort, window, 0, 0]);
        }
        [start, windows]
    }

    /// Appends emissive bodies; returns where they start.
    pub fn emitters(&mut self, emitters: &[EmissiveBody], triangles_of: impl Fn(&EmissiveBody) -> usize) -> u32 {
        let mut headers = Vec::new();
        for emitter in emitters {
            let densities = self.list((0..triangles_of(emitter) as u32).map(|i| emitter.density(i).to_bits()));
            self.0.push(floats([emitter.power(), 0.0, 0.0, 0.0]));
            let first = self.len();
            for (triangle, &sum) in emitter.triangles().iter().zip(emitter.cumulative()) {
                let [a, b, c] = triangle.corners;
                self.0.push(words(a, triangle.primitive));
                self.0.push(words(b, sum.to_bits()));
                self.0.push(words(c, emitter.density(triangle.primitive).to_bits()));
            }
            headers.push([first, emitter.triangles().len() as u32, densities, emitter.instance]);
            let (center, radius) = emitter.sphere();
            headers.push(words(center, radius.to_bits()));
        }
        let start = self.len();
        self.0.extend(headers);
        start
    }

    /// Appends tiles; returns where they start.
    pub fn tiles(&mut self, tiles: impl Iterator<Item = TilePlace>) -> u32 {
        let start = self.len();
        for TilePlace { offset: [x, y], emitters: [first, count], all, seen } in tiles {
            self.0.push([x as u32, y as u32, first, count]);
            self.0.push([all, seen, 0, 0]);
        }
        start
    }

    /// Appends distant lights; returns where they start.
    pub fn distant_lights(&mut self, lights: &[DistantLight], places: &impl EnvironmentPlaces) -> u32 {
        let start = self.len();
        for light in lights {
            match light {
                DistantLight::Cone(cone) => {
                    self.0.push([0; 4]);
                    self.0.push(words(cone.axis, cone.sin.to_bits()));
                    self.0.push(words(cone.radiance, cone.height.to_bits()));
                    self.0.push(floats([cone.illuminance, 0.0, 0.0, 0.0]));
                }
                DistantLight::Environment(light) => {
                    self.0.push([1, 0, 0, 0]);
                    self.environment(&light.placed, Some(light), places);
                }
            }
        }
        start
    }

    /// Appends the environment that is projected on surfaces; returns where it starts.
    pub fn projection(&mut self, projection: Option<&ProjectedEnvironment>, places: &impl EnvironmentPlaces) -> u32 {
        let Some(projection) = projection else { return NONE };
        let start = self.len();
        self.0.push(words(projection.per_nit(), projection.maps().len() as u32));
        for map in projection.maps() {
            self.environment(map, None, places);
        }
        start
    }

    /// Appends seeds of the blocks of pixels in a window; returns where they start and the number of blocks per row.
    pub fn blocks(&mut self, order: &SampleOrder, window: Window) -> [u32; 2] {
        let bits = order.block_bits();
        let [left, top, right, bottom] =
            [window.x, window.y, window.right() - 1, window.bottom() - 1].map(|edge| (edge as u32) >> bits);
        // Block numbers left of the image wrap around from the highest number.
        let numbers = |from: u32, to: u32| {
            let count = to.wrapping_sub(from) & (u32::MAX >> bits);
            (0..=count).map(move |i| from.wrapping_add(i) & (u32::MAX >> bits))
        };
        let columns: Vec<u32> = numbers(left, right).collect();
        let seeds: Vec<u32> = numbers(top, bottom)
            .flat_map(|row| columns.iter().map(move |&column| order.pixel(column << bits, row << bits).0))
            .collect();
        [self.list(seeds), columns.len() as u32]
    }

    /// Appends directions of a distorting camera at the corners and centers of the window's pixels; returns where they
    /// start.
    pub fn warp(&mut self, camera: &RayCamera, window: Window) -> u32 {
        let Some(corners) = camera.warped_corners() else { return NONE };
        let known = |[x, y]: [f32; 2]| if x.is_finite() && y.is_finite() { [x, y] } else { [FAR; 2] };
        let rows = window.y..window.bottom();
        let centers = rows.flat_map(|y| (window.x..window.right()).map(move |x| (x, y)));
        let centers = centers.map(|(x, y)| camera.warped_center(x, y));
        self.list(corners.iter().copied().chain(centers).flat_map(|direction| known(direction).map(f32::to_bits)))
    }
}
