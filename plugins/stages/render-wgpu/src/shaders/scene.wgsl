// Bindings, and what all kernels read of a view. Tables are written by tables.rs.

override LAYERED: bool = true;
override CUTOUTS: bool = true;
override PANES: bool = true;
override GUIDES: bool = true;
override PLAIN_DIELECTRICS: bool = false;
override DEEP: bool = true;
// Whether windows with bodies of their own lie side by side; whether the opacity of pixels is counted.
override TILES: bool = false;
override OPACITY: bool = false;
// Whether paths gather guides alone, and no light.
override ONLY_GUIDES: bool = false;

struct View {
    // Left, top, width, height of the window, px from the corner of the image. With tiles the first two are those of the
    // smallest window around all of them, the last two those of what they lie side by side in.
    window: vec4<i32>,
    // Origin of the camera; angle of a pixel.
    origin: vec4<f32>,
    // Direction at the corner of the image; growth of a path's cone.
    corner: vec4<f32>,
    // Change of the direction with u, with v; focus distance of the lens, 0 without one; minimum roughness.
    along_u: vec4<f32>,
    along_v: vec4<f32>,
    // Radius of the aperture along rows and columns; maximum luminance of indirect light.
    right: vec4<f32>,
    down: vec4<f32>,
    // Rows of the rotation, camera from world.
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    // Where sections of the tables start.
    bodies: u32,
    materials: u32,
    layers: u32,
    textures: u32,
    lobes: u32,
    decode: u32,
    area_lights: u32,
    windows: u32,
    emitters: u32,
    distant_lights: u32,
    projection: u32,
    blocks: u32,
    warp: u32,
    // Counts.
    area_count: u32,
    emitter_count: u32,
    distant_count: u32,
    // Of the scene.
    objects: u32,
    foreground: u32,
    // Root of the top level, and of that of what camera rays meet.
    top_level: u32,
    seen: u32,
    // Largest absolute coordinate of the top level.
    reach: f32,
    // Of the sampler.
    sample_bits: u32,
    block_bits: u32,
    block_columns: u32,
    // Sum of WARPED, TENT, BLENDED_BY_COVERAGE, WITHOUT_BACKGROUND, WITHOUT_SHADOWS, LABELS_THROUGH_GLASS, HOLDS_OUT.
    flags: u32,
    // Of paths.
    max_bounces: u32,
    roulette_from: u32,
    // Number of paths that the state has room for; words of a pixel's coverage.
    capacity: u32,
    words: u32,
    // Where sections of the labels start, or NONE.
    depth_at: u32,
    instance_at: u32,
    normal_at: u32,
    albedo_at: u32,
    coverage_at: u32,
    before_at: u32,
    // Where the sums of pixels start in the output.
    sums_at: u32,
    // As those of the labels.
    object_depths_at: u32,
    // Width and height of the window, or of the smallest one around all tiles.
    around_width: u32,
    around_height: u32,
    // Where the tiles start, and where the queues have the number of each pixel's tile, or NONE.
    tiles: u32,
    tile_map: u32,
    // Where the geometry has the vectors of bodies by their number, for queries.
    body_nodes: u32,
}

const TILE_SIZE: u32 = 2u;

// A window with bodies of its own: place in the image less that among the tiles; the bodies that emit light; roots of the top
// levels of all that is there, and of what camera rays meet.
struct Tile {
    offset: vec2<i32>,
    emitters: u32,
    emitter_count: u32,
    all: u32,
    seen: u32,
}

// The tile of the pixel at hand, where there are tiles.
var<private> tile: Tile;

// Number of the tile of a pixel, or NONE.
fn tile_number(column: u32, row: u32) -> u32 {
    return queues[view.tile_map + row * u32(view.window.z) + column];
}

fn enter_tile(number: u32) {
    let at = view.tiles + number * TILE_SIZE;
    let a = tables[at];
    let b = tables[at + 1u];
    tile = Tile(bitcast<vec2<i32>>(a.xy), a.z, a.w, b.x, b.y);
}

// Place of a pixel in the image.
fn image_place(column: u32, row: u32) -> vec2<i32> {
    let place = vec2(i32(column), i32(row));
    if TILES {
        return place + tile.offset;
    }
    return place + view.window.xy;
}

struct Pass {
    // First entry of the list of pixels, their number; of labels, the first square of 8 x 8 pixels, their number.
    first_pixel: u32,
    pixels: u32,
    // First sample, their number.
    first_sample: u32,
    samples: u32,
    bounce: u32,
    // First word of the list of pixels in the queues; whether the kernel `choose` counted its pixels.
    list: u32,
    is_chosen: u32,
    unused: u32,
}

// Trees and their triangles, the top level first.
@group(0) @binding(0) var<storage, read> geometry: array<vec4<f32>>;
// Shading triangles, tangents, vertex colors.
@group(0) @binding(1) var<storage, read> shading: array<vec4<u32>>;
// Textures and environment maps.
@group(0) @binding(2) var<storage, read> images: array<u32>;
@group(0) @binding(3) var<storage, read> tables: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> paths: array<vec4<f32>>;
// Two queues of paths, the queue of shadow rays, the lists of pixels.
@group(0) @binding(5) var<storage, read_write> queues: array<u32>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> output: array<u32>;
@group(0) @binding(8) var<uniform> view: View;
@group(0) @binding(9) var<uniform> pass_: Pass;

fn table_f(at: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(tables[at]);
}

// One number of a list that starts at an entry of the tables.
fn table_word(start: u32, index: u32) -> u32 {
    return tables[start + index / 4u][index % 4u];
}

fn lobe_table(at: u32) -> vec4<f32> {
    return table_f(view.lobes + at);
}

struct Hit {
    t: f32,
    u: f32,
    v: f32,
    primitive: u32,
    instance: u32,
}

// Whether camera rays end without light at a body.
fn is_held_out(instance: u32) -> bool {
    return (view.flags & HOLDS_OUT) != 0u && instance >= view.foreground;
}

fn no_hit() -> Hit {
    return Hit(FAR, 0.0, 0.0, NONE, NONE);
}

// A body is BODY_SIZE entries: columns of its rotation with where its triangles, tangents and colors are; its position with its
// flags; its slots.

struct Body {
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    translation: vec3<f32>,
    triangles: u32,
    tangents: u32,
    colors: u32,
    first_material: u32,
    last_slot: u32,
}

fn body_at(instance: u32) -> Body {
    let at = view.bodies + instance * BODY_SIZE;
    let a = tables[at];
    let b = tables[at + 1u];
    let c = tables[at + 2u];
    let d = tables[at + 3u];
    let e = tables[at + 4u];
    return Body(
        bitcast<vec3<f32>>(a.xyz),
        bitcast<vec3<f32>>(b.xyz),
        bitcast<vec3<f32>>(c.xyz),
        bitcast<vec3<f32>>(d.xyz),
        a.w,
        b.w,
        c.w,
        e.x,
        e.y,
    );
}

fn direction_to_world(body: Body, v: vec3<f32>) -> vec3<f32> {
    return body.x * v.x + body.y * v.y + body.z * v.z;
}

fn point_to_body(body: Body, p: vec3<f32>) -> vec3<f32> {
    let d = p - body.translation;
    return vec3(dot(d, body.x), dot(d, body.y), dot(d, body.z));
}

struct Triangle {
    normal: vec3<f32>,
    plane: f32,
    normals: vec3<u32>,
    uv_a: vec2<f32>,
    uv_b: vec2<f32>,
    uv_c: vec2<f32>,
    uv_per_m: f32,
    slot: u32,
    smooth_: bool,
    mirrored: bool,
}

fn triangle_at(body: Body, primitive: u32) -> Triangle {
    let at = body.triangles + primitive * 4u;
    let a = bitcast<vec4<f32>>(shading[at]);
    let b = shading[at + 1u];
    let c = bitcast<vec4<f32>>(shading[at + 2u]);
    let d = shading[at + 3u];
    return Triangle(
        a.xyz,
        a.w,
        b.xyz,
        vec2(bitcast<f32>(b.w), c.x),
        c.yz,
        vec2(c.w, bitcast<f32>(d.x)),
        bitcast<f32>(d.y),
        d.z & 0xffffu,
        (d.z & 0x00ff0000u) != 0u,
        (d.z & 0xff000000u) != 0u,
    );
}
