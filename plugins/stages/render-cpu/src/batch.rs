//! The paths that are traced together, in rows by field, so that lanes load and store whole registers.

use syntable_bvh::Hit;
use syntable_simd::Vec3;
use syntable_simd::{Int, Real, max};
use syntable_transport::bsdf::{BsdfParameters, CoatingParameters, LayerInputs, Layered, Lobe};
use syntable_transport::layer::LayerSample;
use syntable_transport::path::GLOSS;
use syntable_transport::surface::Surface;

/// Paths in a batch; a multiple of every number of lanes. Large, so that few lanes are idle when most paths have ended;
/// small, so that the rows stay in the nearest caches.
pub(crate) const BATCH: usize = 256;

/// One number of every path.
pub(crate) type Row = [f32; BATCH];

/// One integer of every path.
pub(crate) type IntRow = [u32; BATCH];

/// Three numbers of every path.
pub(crate) type Rows = [Row; 3];

/// State of paths between bounces.
pub(crate) struct Paths {
    pub origin: Rows,
    pub direction: Rows,
    pub throughput: Rows,
    /// Shading normal of the last scattering.
    pub normal: Rows,
    /// Density of the last scattered direction, per steradian; infinite for camera rays.
    pub pdf: Row,
    /// Minimum distance of the next surface from the origin: beyond the last pane, which does not bend the path.
    pub near: Row,
    /// Width of the path's footprint, meters, and its growth, meters per meter.
    pub width: Row,
    pub spread: Row,
    /// Minimum roughness of later surfaces.
    pub regularize: Row,
    /// Numbers of the sampler.
    pub seed: IntRow,
    pub index: IntRow,
    /// Place of the path's light in the batch's sums.
    pub slot: IntRow,
}

/// First hits.
pub(crate) struct Hits {
    /// Infinite if the ray hits nothing.
    pub t: Row,
    pub u: Row,
    pub v: Row,
    pub primitive: IntRow,
    pub instance: IntRow,
}

/// Surfaces at the hits.
pub(crate) struct Surfaces {
    pub position: Rows,
    pub face: Rows,
    pub normal: Rows,
    /// Above zero if `normal` differs from `face`.
    pub perturbed: Row,
    pub base_color: Rows,
    pub roughness: Row,
    pub metallic: Row,
    pub dielectric_f0: Row,
    /// Values for layered materials only; written if the scene has any.
    pub layers: LayerRows,
}

/// Values of layered materials.
pub(crate) struct LayerRows {
    /// Index of the lobe.
    pub lobe: Row,
    pub clearcoat: Row,
    pub clearcoat_roughness: Row,
    pub sheen: Row,
    pub sheen_roughness: Row,
    /// Relative index of refraction: beyond the surface over this side.
    pub eta: Row,
    /// Above zero at panes.
    pub pane: Row,
}

/// Shadow rays, and their contributions if nothing occludes them.
pub(crate) struct Shadows {
    pub origin: Rows,
    pub direction: Rows,
    pub distance: Row,
    pub contribution: Rows,
    /// Weight of emitter sampling in it.
    pub weight: Row,
    /// Part of the contribution that the first surface mirrors without coloring it; written at the first bounce, for
    /// guides.
    pub specular: Rows,
    pub slot: IntRow,
    /// For surfaces with partial coverage; written if the scene has any.
    pub alpha_seed: IntRow,
}

/// Guides for denoisers, by slot: values of the first surface that is not a mirror.
pub(crate) struct Guides {
    pub albedo: [[f32; 3]; BATCH],
    /// World frame.
    pub normal: [[f32; 3]; BATCH],
    /// Color of the mirrors so far.
    tint: [Vec3; BATCH],
    pending: [bool; BATCH],
    /// Bounce of the last surface that counts.
    bounce: [u32; BATCH],
    /// Whether glass on the way reflected the path, although it could have transmitted it.
    reflected: [bool; BATCH],
    /// Light of emitters that the first surface mirrors without coloring it.
    pub direct_specular: [[f32; 3]; BATCH],
    /// Fraction of all other light that the first surface mirrors without coloring it.
    specular_fraction: [[f32; 3]; BATCH],
    /// Light found so far, including direct light of the first surface.
    pub first: [[f32; 3]; BATCH],
}

impl Guides {
    /// Resets a path to white, the guide of lights and sky.
    #[inline(always)]
    pub fn clear(&mut self, slot: usize) {
        self.albedo[slot] = [1.0; 3];
        self.normal[slot] = [0.0; 3];
        self.tint[slot] = Vec3::ONE;
        self.pending[slot] = true;
        self.bounce[slot] = 0;
        self.reflected[slot] = false;
        self.direct_specular[slot] = [0.0; 3];
        self.specular_fraction[slot] = [0.0; 3];
        self.first[slot] = [0.0; 3];
    }

    /// Stores the fraction of the light that the first surface mirrors without coloring it, for the lanes whose bits
    /// are set.
    #[inline(always)]
    pub fn scatter<T: Real>(&mut self, fraction: Vec3<T>, slots: T::Int, mut lanes: u32) {
        let (mut rows, mut slot) = ([[0.0; 8]; 3], [0; 8]);
        fraction.x.store(&mut rows[0]);
        fraction.y.store(&mut rows[1]);
        fraction.z.store(&mut rows[2]);
        slots.store(&mut slot);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            self.specular_fraction[slot[lane] as usize % BATCH] = rows.map(|row| row[lane]);
        }
    }

    /// Records that glass reflected the paths of the lanes whose bits are set, at surfaces that count.
    #[inline(always)]
    pub fn reflect<I: Int>(&mut self, slots: I, mut lanes: u32, bounce: u32) {
        let mut slot = [0; 8];
        slots.store(&mut slot);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            let slot = slot[lane] as usize % BATCH;
            self.reflected[slot] |= self.bounce[slot] == bounce;
        }
    }

    /// Whether the path has guides. A path that glass reflected has none: it shows another image than the surface
    /// behind the glass.
    #[inline(always)]
    pub fn count(&self, slot: usize) -> bool {
        !self.reflected[slot]
    }

    /// Part of a path's light that was mirrored without being colored: by the first surface, or by glass on the way.
    /// Surfaces seen in a metal or through glass count as colored, as for the other guides.
    #[inline(always)]
    pub fn specular(&self, slot: usize, light: [f32; 3]) -> [f32; 3] {
        if self.reflected[slot] {
            return light;
        }
        std::array::from_fn(|c| {
            let specular =
                self.direct_specular[slot][c] + (light[c] - self.first[slot][c]) * self.specular_fraction[slot][c];
            specular.clamp(0.0, light[c].max(0.0))
        })
    }

    /// Adds a surface on the path; `last` if no later surface counts.
    #[inline(always)]
    pub fn add_surface(&mut self, slot: usize, surface: &Surface, bounce: u32, last: bool) {
        if !self.pending[slot] {
            return;
        }
        self.bounce[slot] = bounce;
        // Light that crosses a body is colored at both of its surfaces.
        let color = if surface.layer.lobe == Lobe::Refraction { surface.albedo.map(f32::sqrt) } else { surface.albedo };
        // Gloss is separated at the first surface only: at later surfaces, a black base still has its gloss.
        let color = if bounce > 0 { color.map(|c| max(c, GLOSS)) } else { color };
        let albedo = color * surface.transmittance * self.tint[slot];
        if surface.is_mirror() && !last {
            self.tint[slot] = albedo;
        } else {
            self.pending[slot] = false;
            self.normal[slot] = surface.normal.array();
        }
        self.albedo[slot] = albedo.array();
    }
}

/// A batch and its working memory.
pub(crate) struct Batch {
    pub paths: Paths,
    pub hits: Hits,
    pub surfaces: Surfaces,
    pub shadows: Shadows,
    pub guides: Guides,
    /// Light found so far, by slot.
    pub radiance: [[f32; 3]; BATCH],
    /// Whether the camera ray met a body, by slot.
    pub met: [bool; BATCH],
    /// 0, 1, 2, …
    pub numbers: Row,
}

const ROW: Row = [0.0; BATCH];
const ROWS: Rows = [ROW; 3];
const INTS: IntRow = [0; BATCH];

impl Batch {
    pub fn new() -> Box<Self> {
        let mut numbers = ROW;
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = i as f32;
        }
        Box::new(Self {
            paths: Paths {
                origin: ROWS,
                direction: ROWS,
                throughput: ROWS,
                normal: ROWS,
                pdf: ROW,
                near: ROW,
                width: ROW,
                spread: ROW,
                regularize: ROW,
                seed: INTS,
                index: INTS,
                slot: INTS,
            },
            hits: Hits { t: ROW, u: ROW, v: ROW, primitive: INTS, instance: INTS },
            surfaces: Surfaces {
                position: ROWS,
                face: ROWS,
                normal: ROWS,
                perturbed: ROW,
                base_color: ROWS,
                roughness: ROW,
                metallic: ROW,
                dielectric_f0: ROW,
                layers: LayerRows {
                    lobe: ROW,
                    clearcoat: ROW,
                    clearcoat_roughness: ROW,
                    sheen: ROW,
                    sheen_roughness: ROW,
                    eta: ROW,
                    pane: ROW,
                },
            },
            shadows: Shadows {
                origin: ROWS,
                direction: ROWS,
                distance: ROW,
                contribution: ROWS,
                weight: ROW,
                specular: ROWS,
                slot: INTS,
                alpha_seed: INTS,
            },
            guides: Guides {
                albedo: [[0.0; 3]; BATCH],
                normal: [[0.0; 3]; BATCH],
                tint: [Vec3::ZERO; BATCH],
                pending: [false; BATCH],
                bounce: [0; BATCH],
                reflected: [false; BATCH],
                direct_specular: [[0.0; 3]; BATCH],
                specular_fraction: [[0.0; 3]; BATCH],
                first: [[0.0; 3]; BATCH],
            },
            radiance: [[0.0; 3]; BATCH],
            met: [false; BATCH],
            numbers,
        })
    }

    /// Ends the paths whose guides are known: their hits become infinite. True if any path continues.
    pub fn end_guided(&mut self, alive: usize) -> bool {
        let mut any = false;
        for (t, &slot) in self.hits.t.iter_mut().zip(&self.paths.slot).take(alive) {
            match self.guides.pending[slot as usize % BATCH] {
                true => any |= *t < f32::INFINITY,
                false => *t = f32::INFINITY,
            }
        }
        any
    }
}

/// The vectors of the paths from `at` on.
#[inline(always)]
pub(crate) fn load<T: Real>(rows: &Rows, at: usize) -> Vec3<T> {
    Vec3 { x: T::load(&rows[0][at..]), y: T::load(&rows[1][at..]), z: T::load(&rows[2][at..]) }
}

/// Stores vectors in the paths from `at` on.
#[inline(always)]
pub(crate) fn store<T: Real>(v: Vec3<T>, rows: &mut Rows, at: usize) {
    v.x.store(&mut rows[0][at..]);
    v.y.store(&mut rows[1][at..]);
    v.z.store(&mut rows[2][at..]);
}

/// Stores the vectors of chosen lanes in the paths from `at` on.
#[inline(always)]
pub(crate) fn compress<T: Real>(v: Vec3<T>, mask: T::Mask, rows: &mut Rows, at: usize) {
    v.x.compress(mask, &mut rows[0][at..]);
    v.y.compress(mask, &mut rows[1][at..]);
    v.z.compress(mask, &mut rows[2][at..]);
}

/// The vector of one path.
#[inline(always)]
pub(crate) fn get(rows: &Rows, i: usize) -> Vec3 {
    Vec3 { x: rows[0][i], y: rows[1][i], z: rows[2][i] }
}

/// Sets the vector of one path.
#[inline(always)]
pub(crate) fn set(rows: &mut Rows, i: usize, v: Vec3) {
    rows[0][i] = v.x;
    rows[1][i] = v.y;
    rows[2][i] = v.z;
}

impl Paths {
    /// Moves the chosen paths among those from `from` on to `to`, which must not be further.
    #[inline(always)]
    pub fn keep<T: Real>(&mut self, mask: T::Mask, from: usize, to: usize) {
        for rows in [&mut self.origin, &mut self.direction, &mut self.throughput, &mut self.normal] {
            compress(load::<T>(rows, from), mask, rows, to);
        }
        for row in [&mut self.pdf, &mut self.near, &mut self.width, &mut self.spread, &mut self.regularize] {
            T::load(&row[from..]).compress(mask, &mut row[to..]);
        }
        for row in [&mut self.seed, &mut self.index, &mut self.slot] {
            T::Int::load(&row[from..]).compress(mask, &mut row[to..]);
        }
    }
}

impl Hits {
    #[inline(always)]
    pub fn set(&mut self, i: usize, hit: Option<Hit>) {
        match hit {
            Some(hit) => {
                self.t[i] = hit.t;
                self.u[i] = hit.u;
                self.v[i] = hit.v;
                self.primitive[i] = hit.primitive;
                self.instance[i] = hit.instance;
            }
            None => self.t[i] = f32::INFINITY,
        }
    }

    #[inline(always)]
    pub fn get(&self, i: usize) -> Hit {
        let (primitive, instance) = (self.primitive[i], self.instance[i]);
        Hit { t: self.t[i], u: self.u[i], v: self.v[i], primitive, instance }
    }

    /// Like [`Paths::keep`].
    #[inline(always)]
    pub fn keep<T: Real>(&mut self, mask: T::Mask, from: usize, to: usize) {
        for row in [&mut self.t, &mut self.u, &mut self.v] {
            T::load(&row[from..]).compress(mask, &mut row[to..]);
        }
        for row in [&mut self.primitive, &mut self.instance] {
            T::Int::load(&row[from..]).compress(mask, &mut row[to..]);
        }
    }
}

impl Surfaces {
    #[inline(always)]
    pub fn set(&mut self, i: usize, surface: &Surface) {
        set(&mut self.position, i, surface.position);
        set(&mut self.face, i, surface.face);
        set(&mut self.normal, i, surface.normal);
        self.perturbed[i] = if surface.is_perturbed { 1.0 } else { 0.0 };
        let parameters = &surface.layer.parameters;
        set(&mut self.base_color, i, parameters.base_color);
        self.roughness[i] = parameters.roughness;
        self.metallic[i] = parameters.metallic;
        self.dielectric_f0[i] = parameters.dielectric_f0;
    }

    /// Scattering by the layers of the surfaces from `at` on.
    #[inline(always)]
    pub fn layered<T: Real>(&self, at: usize, parameters: &BsdfParameters<T>, wo: Vec3<T>) -> Layered<T> {
        let rows = &self.layers;
        let coating = CoatingParameters {
            clearcoat: T::load(&rows.clearcoat[at..]),
            clearcoat_roughness: T::load(&rows.clearcoat_roughness[at..]),
            sheen: T::load(&rows.sheen[at..]),
            sheen_roughness: T::load(&rows.sheen_roughness[at..]),
        };
        let drawn = LayerInputs { lobe: T::load(&rows.lobe[at..]), coating, eta: T::load(&rows.eta[at..]) };
        Layered::new(&drawn, parameters, wo)
    }

    /// Sets the layers, which [`Self::set`] leaves out.
    #[inline(always)]
    pub fn set_layers(&mut self, i: usize, surface: &Surface) {
        let LayerSample { lobe, coating, ior, .. } = &surface.layer;
        let rows = &mut self.layers;
        rows.lobe[i] = *lobe as u32 as f32;
        rows.pane[i] = if surface.is_pane { 1.0 } else { 0.0 };
        rows.clearcoat[i] = coating.clearcoat;
        rows.clearcoat_roughness[i] = coating.clearcoat_roughness;
        rows.sheen[i] = coating.sheen;
        rows.sheen_roughness[i] = coating.sheen_roughness;
        rows.eta[i] = if surface.inside && *lobe == Lobe::Refraction { 1.0 / ior } else { *ior };
    }
}
