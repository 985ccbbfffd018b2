// The filter `guided` of plugins/stages/denoise: bindings, and what its kernels share. The numbers in capitals that are not said
// here come from that crate; kernels.rs writes them above this file.
//
// Compilers of shaders may take it that no number is NaN or infinite. What the path tracer writes is neither: it has FAR
// for what is infinite, and everything from there on counts as not finite. So ranges are tested, where the processor tests
// for finite numbers.

const NONE: u32 = 0xffffffffu;
const NO_SURFACE: f32 = -2.0;

// What a dispatch works on.
struct Work {
    width: u32,
    height: u32,
    // Squares of light along x and along y.
    columns: u32,
    rows: u32,
    // First words of the planes; NONE for variances that are not known.
    radiance: u32,
    specular: u32,
    specular_variance: u32,
    demodulated: u32,
    demodulated_variance: u32,
    albedo: u32,
    normal: u32,
    depth: u32,
    instance: u32,
    output: u32,
    // Of the part's filtered light: 1 if it ends in lights_in, else in lights_out.
    diffuse_ends_in: u32,
    specular_ends_in: u32,
    // Of a level: 0 for the diffuse part, 1 for the specular one; distance of taps, px.
    part: u32,
    step: u32,
    // E-folds for each squared difference of light, in variances; the same for means, 0 if they do not count.
    per_light: f32,
    per_pilot: f32,
    // Weights of taps by their distance along an axis.
    kernel: vec4<f32>,
    // Squared difference of normals that costs one e-fold for noise as strong as the light; from, to.
    normal_scale: f32,
    normal_least: f32,
    normal_most: f32,
    unused: f32,
}

// Light of a square: sums over its surfaces.
struct Cell {
    after: f32,
    count: f32,
    before: f32,
    // What its pixels are multiplied by. Of the entry behind the last square: what a dark pixel counts as, nits.
    factor: f32,
}

@group(0) @binding(0) var<storage, read> input: array<u32>;
@group(0) @binding(1) var<storage, read_write> output: array<f32>;
// Mean normal, 1 / depth.
@group(0) @binding(2) var<storage, read_write> shapes: array<vec4<f32>>;
// Luminance of the mean base color; id of the body, or NO_SURFACE.
@group(0) @binding(3) var<storage, read_write> bodies: array<vec2<f32>>;
// Change of 1 / depth along x, along y; 1 at the border of bodies; variance of the luminance before the filter.
@group(0) @binding(4) var<storage, read_write> places: array<vec4<f32>>;
// Light and variance of its luminance: a plane of the diffuse part, one of the specular part. Levels go back and forth. The
// noise kernel also writes a plane of pilots: mean and its variance of the diffuse part, of the specular part.
@group(0) @binding(5) var<storage, read_write> lights_in: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> lights_out: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(8) var<uniform> work: Work;

fn luminance(c: vec3<f32>) -> f32 {
    return dot(c, vec3(LUMINANCE_R, LUMINANCE_G, LUMINANCE_B));
}

fn pixels() -> u32 {
    return work.width * work.height;
}

fn is_inside(at: vec2<i32>) -> bool {
    return at.x >= 0 && at.y >= 0 && at.x < i32(work.width) && at.y < i32(work.height);
}

fn index(at: vec2<i32>) -> u32 {
    return u32(at.y) * work.width + u32(at.x);
}

fn number(at: u32) -> f32 {
    return bitcast<f32>(input[at]);
}

fn vector(plane: u32, pixel: u32) -> vec3<f32> {
    let at = plane + 3u * pixel;
    return vec3(number(at), number(at + 1u), number(at + 2u));
}

fn is_finite(c: vec3<f32>) -> bool {
    return all(abs(c) < vec3(FAR));
}

fn sane(light: vec3<f32>) -> vec3<f32> {
    return select(vec3(0.0), clamp(light, vec3(0.0), vec3(MOST_NITS)), abs(light) < vec3(FAR));
}

// Divisor of the diffuse part.
fn demodulator(pixel: u32) -> vec3<f32> {
    let albedo = vector(work.albedo, pixel);
    return DEMODULATION_EPSILON + select(vec3(1.0), clamp(albedo, vec3(0.0), vec3(1.0)), abs(albedo) < vec3(FAR));
}

fn specular_light(pixel: u32) -> vec3<f32> {
    return sane(vector(work.specular, pixel));
}

// At the border of bodies the color is taken from the mean of light and color.
fn diffuse_light(pixel: u32, border: bool) -> vec3<f32> {
    if border {
        return sane((vector(work.radiance, pixel) - vector(work.specular, pixel)) / demodulator(pixel));
    }
    return sane(vector(work.demodulated, pixel));
}

// The guides of the pixel that taps are compared with.
struct Guides {
    shape: vec4<f32>,
    color: f32,
    id: f32,
    slope: vec2<f32>,
    border: bool,
}

fn guides_of(pixel: u32) -> Guides {
    let body = bodies[pixel];
    let place = places[pixel];
    return Guides(shapes[pixel], body.x, body.y, place.xy, place.z > 0.0);
}

// E-folds of a tap: y, and x for what a squared difference of normals costs. From END on it is worth nothing.
fn guided_cost(here: Guides, there: u32, body: vec2<f32>, offset: vec2<f32>) -> vec2<f32> {
    let shape = shapes[there];
    let difference = here.shape.xyz - shape.xyz;
    let rotated = dot(difference, difference);
    if here.border {
        let color = here.color - body.x;
        return select(vec2(0.0, END), vec2(rotated * BORDER_NORMAL, color * color * BORDER_COLOR), body.y >= 0.0);
    }
    let off = abs(shape.w - (here.shape.w + dot(here.slope, offset)));
    return select(vec2(0.0, END), vec2(rotated, off / (PLANE * here.shape.w + 1e-9)), body.y == here.id);
}

// About exp(-x) for x >= 0, and 0 from END on.
fn falloff(x: vec2<f32>) -> vec2<f32> {
    let t = max(1.0 - x * (1.0 / END), vec2(0.0));
    let t2 = t * t;
    let t4 = t2 * t2;
    return t4 * t4;
}
