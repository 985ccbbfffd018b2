//! Layout that the program and the shaders share: sizes of entries, uniforms, counters, and how threads are grouped.

use bytemuck::{Pod, Zeroable};

/// Storage buffers of the bind group; WebGPU promises eight.
pub const STORAGE_BUFFERS: u32 = 8;

/// Bytes between two uniforms of a pass in their buffer.
pub const PASS_STRIDE: u64 = 256;

/// Index of an absent entry.
pub const NONE: u32 = u32::MAX;

/// Entries of a body in `scene.wgsl`.
pub const BODY_SIZE: u32 = 5;

/// Entries of a body that emits.
pub const EMITTER_SIZE: u32 = 2;

/// Where a body's meshes are.
#[derive(Clone, Copy, Debug)]
pub struct BodyPlace {
    /// Root of its tree.
    pub root: u32,
    /// First triangle of its tree.
    pub triangles: u32,
    /// Largest absolute coordinate of its mesh.
    pub reach: f32,
    /// Its shading triangles.
    pub shading: u32,
    /// Its tangents, or [`NONE`].
    pub tangents: u32,
    /// Its vertex colors, or [`NONE`].
    pub colors: u32,
}

/// Flags of a view in `scene.wgsl`.
pub const WARPED: u32 = 1;
pub const TENT: u32 = 2;
pub const BLENDED_BY_COVERAGE: u32 = 4;
pub const WITHOUT_BACKGROUND: u32 = 8;
pub const WITHOUT_SHADOWS: u32 = 16;
pub const LABELS_THROUGH_GLASS: u32 = 32;
pub const HOLDS_OUT: u32 = 64;

/// `View` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct View {
    pub window: [i32; 4],
    pub origin: [f32; 4],
    pub corner: [f32; 4],
    pub along_u: [f32; 4],
    pub along_v: [f32; 4],
    pub right: [f32; 4],
    pub down: [f32; 4],
    pub rows: [[f32; 4]; 3],
    pub bodies: u32,
    pub materials: u32,
    pub layers: u32,
    pub textures: u32,
    pub lobes: u32,
    pub decode: u32,
    pub area_lights: u32,
    pub windows: u32,
    pub emitters: u32,
    pub distant_lights: u32,
    pub projection: u32,
    pub blocks: u32,
    pub warp: u32,
    pub area_count: u32,
    pub emitter_count: u32,
    pub distant_count: u32,
    pub objects: u32,
    pub foreground: u32,
    pub top_level: u32,
    pub seen: u32,
    pub reach: f32,
    pub sample_bits: u32,
    pub block_bits: u32,
    pub block_columns: u32,
    pub flags: u32,
    pub max_bounces: u32,
    pub roulette_from: u32,
    pub capacity: u32,
    pub words: u32,
    pub depth_at: u32,
    pub instance_at: u32,
    pub normal_at: u32,
    pub albedo_at: u32,
    pub coverage_at: u32,
    pub before_at: u32,
    pub sums_at: u32,
    pub object_depths_at: u32,
    pub around_width: u32,
    pub around_height: u32,
    pub tiles: u32,
    pub tile_map: u32,
    pub body_nodes: u32,
    pub unused: [u32; 2],
}

/// Uniforms are read in vectors.
const _: () = assert!(size_of::<View>().is_multiple_of(16));

/// `Pass` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Pass {
    pub first_pixel: u32,
    pub pixels: u32,
    pub first_sample: u32,
    pub samples: u32,
    pub bounce: u32,
    pub list: u32,
    pub is_chosen: u32,
    pub unused: u32,
}

impl Pass {
    /// Maximum number of paths.
    pub fn paths(&self) -> u64 {
        u64::from(self.pixels) * u64::from(self.samples)
    }
}

/// Threads of a group of most kernels.
pub const GROUP: u64 = 64;

/// Bounces that have counters; recipes have 256 at most.
const BOUNCES_COUNTED: u32 = 512;

/// Layout of the counters of `path.wgsl`: paths that are left after each bounce come first, then shadow rays.
pub const SHADOW_COUNTERS: u32 = BOUNCES_COUNTED;

/// Rays of all passes, and shadow rays: lower and upper 32 bits.
pub const RAYS_COUNTED: u32 = 2 * BOUNCES_COUNTED;
pub const SHADOWS_COUNTED: u32 = RAYS_COUNTED + 2;

/// Pixels that were chosen for more samples of the guides.
pub const CHOSEN: u32 = RAYS_COUNTED + 4;

/// Numbers of workgroups, bounce after bounce: three words for paths that continue, three for their rays and the shadow
/// rays of the bounce.
pub const GROUPS_COUNTED: u32 = RAYS_COUNTED + 8;

/// Words of all counters.
pub const COUNTERS: u64 = (GROUPS_COUNTED + 6 * BOUNCES_COUNTED) as u64;

/// Workgroups along x in larger dispatches; the shaders derive the index of a thread from it.
pub const GROUPS_ALONG_X: u32 = 256;

/// Counters at the start of a view.
pub fn first_counters() -> Vec<u32> {
    let mut counters = vec![0; COUNTERS as usize];
    for groups in counters[GROUPS_COUNTED as usize..].chunks_exact_mut(3) {
        (groups[0], groups[2]) = (GROUPS_ALONG_X, 1);
    }
    counters
}

/// Counted rays and shadow rays.
pub fn rays_of(counters: &[u32]) -> [u64; 2] {
    [0, 2].map(|half| {
        let at = RAYS_COUNTED as usize + half;
        u64::from(counters[at]) | u64::from(counters[at + 1]) << 32
    })
}

/// Workgroups along x and y for a number of threads.
pub fn groups(threads: u64, group: u64) -> [u32; 2] {
    let along_x = u64::from(GROUPS_ALONG_X);
    let count = threads.div_ceil(group).max(1);
    [count.min(along_x) as u32, count.div_ceil(along_x) as u32]
}
