// The lights of a view, as in core/lib/transport's light module and core/lib/prepare's light.rs and emitter.rs.

const AREA_SIZE: u32 = 6u;
const WINDOW_SIZE: u32 = 5u;
const EMISSIVE_TRIANGLE_SIZE: u32 = 3u;
const DISTANT_SIZE: u32 = 4u;
const CONE: u32 = 0u;
const ENVIRONMENT: u32 = 1u;

struct Environment {
    width: u32,
    height: u32,
    rows: u32,
    texels: u32,
    radiance: u32,
    sine: f32,
    cosine: f32,
    luminance: f32,
    scale: vec3<f32>,
}

fn environment_at(at: u32) -> Environment {
    let a = tables[at];
    let b = tables[at + 1u];
    let f = bitcast<vec4<f32>>(b);
    return Environment(a.x, a.y, a.z, a.w, b.x, f.y, f.z, f.w, table_f(at + 2u).xyz);
}

fn image_f(at: u32) -> f32 {
    return bitcast<f32>(images[at]);
}

fn environment_coordinates(e: Environment, direction: vec3<f32>) -> vec2<f32> {
    let x = e.cosine * direction.x + e.sine * direction.y;
    let y = e.cosine * direction.y - e.sine * direction.x;
    return vec2(0.5 - atan2_turns(y, x), arc_cosine(direction.z) * FRAC_1_PI);
}

fn environment_texel(e: Environment, x: i32, y: i32) -> vec3<f32> {
    let width = i32(e.width);
    let column = u32((x % width + width) % width);
    let row = u32(clamp(y, 0, i32(e.height) - 1));
    let at = e.radiance + 3u * (row * e.width + column);
    return vec3(image_f(at), image_f(at + 1u), image_f(at + 2u));
}

fn environment_radiance_at(e: Environment, uv: vec2<f32>) -> vec3<f32> {
    let place = uv * vec2(f32(e.width), f32(e.height)) - 0.5;
    let whole = floor(place);
    let w = place - whole;
    let x = i32(whole.x);
    let y = i32(whole.y);
    let above = mix(environment_texel(e, x, y), environment_texel(e, x + 1, y), w.x);
    let below = mix(environment_texel(e, x, y + 1), environment_texel(e, x + 1, y + 1), w.x);
    return mix(above, below, w.y) * e.scale;
}

fn environment_radiance(e: Environment, direction: vec3<f32>) -> vec3<f32> {
    return environment_radiance_at(e, environment_coordinates(e, direction));
}

fn probability_of(start: u32, i: u32) -> f32 {
    if i == 0u {
        return image_f(start);
    }
    return image_f(start + i) - image_f(start + i - 1u);
}

fn per_steradian(density: f32, sin_theta: f32) -> f32 {
    return density / (2.0 * PI * PI * max(sin_theta, 1e-6));
}

fn environment_density(e: Environment, uv: vec2<f32>, sin_theta: f32) -> f32 {
    let y = min(u32(uv.y * f32(e.height)), e.height - 1u);
    let x = min(u32(uv.x * f32(e.width)), e.width - 1u);
    let density = probability_of(e.rows, y) * probability_of(e.texels + y * e.width, x) * f32(e.width * e.height);
    return per_steradian(density, sin_theta);
}

struct Selected {
    number: u32,
    place: f32,
    probability: f32,
}

// The entry of cumulative probabilities that a number selects, and the position in it.
fn select_entry(start: u32, count: u32, u: f32) -> Selected {
    var low = 0u;
    var high = count;
    while low < high {
        let middle = (low + high) / 2u;
        if image_f(start + middle) <= u {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let i = min(low, count - 1u);
    let width = probability_of(start, i);
    let before = image_f(start + i) - width;
    return Selected(i, clamp((u - before) / max(width, 1e-30), 0.0, 0.99999994), width);
}

struct Direction {
    direction: vec3<f32>,
    pdf: f32,
}

fn environment_sample(e: Environment, uv: vec2<f32>) -> Direction {
    let row = select_entry(e.rows, e.height, uv.y);
    let column = select_entry(e.texels + row.number * e.width, e.width, uv.x);
    let u = (f32(column.number) + column.place) / f32(e.width);
    let v = (f32(row.number) + row.place) / f32(e.height);
    let density = row.probability * column.probability * f32(e.width * e.height);
    let theta = sin_cos_turns(0.5 * v);
    let phi = sin_cos_turns(0.5 - u);
    let local = vec3(theta.x * phi.y, theta.x * phi.x, theta.y);
    let direction = vec3(
        e.cosine * local.x - e.sine * local.y,
        e.sine * local.x + e.cosine * local.y,
        local.z,
    );
    return Direction(direction, per_steradian(density, theta.x));
}

// The environment as albedo of a point that shows it, seen from a height above the origin. The section of the tables is
// albedo per nit with the number of maps, then the maps.
fn projected_albedo(height: f32, point: vec3<f32>) -> vec3<f32> {
    let header = tables[view.projection];
    let direction = normalized_or(point - vec3(0.0, 0.0, height), vec3(0.0, 0.0, -1.0));
    var radiance = vec3(0.0);
    for (var i = 0u; i < header.w; i++) {
        radiance += environment_radiance(environment_at(view.projection + 1u + 3u * i), direction);
    }
    return clamp(radiance * bitcast<vec3<f32>>(header.xyz), vec3(0.0), vec3(1.0));
}

fn shape_at(number: u32) -> Shape {
    let at = view.area_lights + number * AREA_SIZE;
    let a = table_f(at);
    let b = table_f(at + 1u);
    let c = table_f(at + 2u);
    let d = table_f(at + 3u);
    let e = table_f(at + 4u);
    let f = tables[at + 5u];
    return Shape(f.x, a.xyz, b.xyz, c.xyz, d.xyz, vec2(b.w, c.w), d.w, e.xyz, e.w, f.y);
}

fn in_spans(start: u32, count: u32, x: f32) -> bool {
    for (var i = 0u; i < count; i++) {
        let span = table_f(start + i);
        if span.x <= x && x <= span.y {
            return true;
        }
    }
    return false;
}

// Radiance of a light at a point of it, seen in a unit direction. A window is (columns, their number, rows, theirs), the
// radiance of its frame, and the environment behind it.
fn shape_radiance(s: Shape, point: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    if s.window == NONE {
        return s.radiance;
    }
    let at = view.windows + s.window * WINDOW_SIZE;
    let spans = tables[at];
    let from_center = point - s.center;
    if in_spans(spans.x, spans.y, dot(from_center, s.x)) && in_spans(spans.z, spans.w, dot(from_center, s.y)) {
        return environment_radiance(environment_at(at + 2u), direction);
    }
    return table_f(at + 1u).xyz;
}

fn emitters_at() -> u32 {
    if TILES {
        return tile.emitters;
    }
    return view.emitters;
}

fn emitter_count() -> u32 {
    if TILES {
        return tile.emitter_count;
    }
    return view.emitter_count;
}

fn light_count() -> u32 {
    return view.area_count + emitter_count() + view.distant_count;
}

// An emissive body is (first triangle, their number, its densities, its instance), (center, radius); its power is the first
// number of the entry before its triangles.
fn emitter_importance(number: u32, p: vec3<f32>, n: vec3<f32>) -> f32 {
    let at = emitters_at() + number * EMITTER_SIZE;
    let b = table_f(at + 1u);
    let power = table_f(tables[at].x - 1u).x;
    let to = b.xyz - p;
    let nearest = max(max(dot(to, to), 0.25 * b.w * b.w), 1e-12);
    let cosine = clamp(dot(n, to) / sqrt(nearest) + b.w / sqrt(nearest), 0.0, 1.0);
    return min(0.25 * power / nearest, PI * power / max(b.w * b.w, 1e-12)) * cosine;
}

// A distant light is its sort and three entries: of a cone (axis, sine), (radiance, height), (illuminance); of an
// environment, the environment.
fn distant_importance(number: u32, n: vec3<f32>) -> f32 {
    let at = view.distant_lights + number * DISTANT_SIZE;
    if tables[at].x == CONE {
        let a = table_f(at + 1u);
        return table_f(at + 3u).x * clamp(dot(n, a.xyz) + a.w, 0.0, 1.0);
    }
    return PI * bitcast<f32>(tables[at + 2u].w);
}

fn light_importance(number: u32, p: vec3<f32>, n: vec3<f32>) -> f32 {
    if light_count() == 1u {
        return 1.0;
    }
    if number < view.area_count {
        return shape_importance(shape_at(number), p, n);
    }
    let other = number - view.area_count;
    if other < emitter_count() {
        return emitter_importance(other, p, n);
    }
    return distant_importance(other - emitter_count(), n);
}

struct Distant {
    radiance: vec3<f32>,
    pdf: f32,
}

fn distant_radiance(number: u32, direction: vec3<f32>) -> Distant {
    let at = view.distant_lights + number * DISTANT_SIZE;
    if tables[at].x == CONE {
        let a = table_f(at + 1u);
        let b = table_f(at + 2u);
        let across = cross(a.xyz, direction);
        if dot(direction, a.xyz) > 0.0 && dot(across, across) <= a.w * a.w {
            return Distant(b.xyz, 1.0 / (2.0 * PI * b.w));
        }
        return Distant(vec3(0.0), 0.0);
    }
    let e = environment_at(at + 1u);
    let uv = environment_coordinates(e, direction);
    let sin_theta = sqrt(max(1.0 - direction.z * direction.z, 0.0));
    return Distant(environment_radiance_at(e, uv), environment_density(e, uv, sin_theta));
}

fn distant_sample(number: u32, uv: vec2<f32>) -> Direction {
    let at = view.distant_lights + number * DISTANT_SIZE;
    if tables[at].x == CONE {
        let a = table_f(at + 1u);
        let height = table_f(at + 2u).w;
        let t = uv.x * height;
        let sine = sqrt(max(t * (2.0 - t), 0.0));
        let turn = sin_cos_turns(uv.y);
        return Direction(basis_around(a.xyz) * vec3(sine * turn.y, sine * turn.x, 1.0 - t), 1.0 / (2.0 * PI * height));
    }
    return environment_sample(environment_at(at + 1u), uv);
}

struct Illumination {
    sample: LightSample,
    radiance: vec3<f32>,
}

// Samples a light for a point with unit normal `n`, in proportion to what it could give there unshadowed.
fn sample_lights(p: vec3<f32>, n: vec3<f32>, numbers: vec2<f32>) -> Illumination {
    var u = numbers.x;
    let v = numbers.y;
    var total = 0.0;
    var importance = 0.0;
    var chosen = NONE;
    let count = light_count();
    if count == 1u {
        total = 1.0;
        importance = 1.0;
        chosen = 0u;
    } else {
        for (var number = 0u; number < count; number++) {
            let own = light_importance(number, p, n);
            total += own;
            if own > 0.0 {
                let probability = own / total;
                if u < probability {
                    u = u / probability;
                    importance = own;
                    chosen = number;
                } else {
                    u = (u - probability) / (1.0 - probability);
                }
            }
        }
        u = min(u, 0.99999988);
    }
    var s = LightSample(n, 0.0, 1.0, false);
    var radiance = vec3(0.0);
    if chosen < view.area_count {
        let shape = shape_at(chosen);
        s = shape_sample(shape, p, vec2(u, v));
        if shape.window == NONE {
            radiance = shape.radiance;
        } else if s.valid && dot(n, s.direction) > 0.0 {
            radiance = shape_radiance(shape, p + s.direction * s.distance, s.direction);
        }
    } else if chosen < view.area_count + emitter_count() {
        let at = emitters_at() + (chosen - view.area_count) * EMITTER_SIZE;
        let header = tables[at];
        // The triangle that the first number selects by cumulative power.
        var low = 0u;
        var high = header.y;
        while low < high {
            let middle = (low + high) / 2u;
            if table_f(header.x + middle * EMISSIVE_TRIANGLE_SIZE + 1u).w <= u {
                low = middle + 1u;
            } else {
                high = middle;
            }
        }
        let i = min(low, header.y - 1u);
        let entry = header.x + i * EMISSIVE_TRIANGLE_SIZE;
        let a = tables[entry];
        let b = table_f(entry + 1u);
        let c = table_f(entry + 2u);
        var before = 0.0;
        if i > 0u {
            before = table_f(entry + 1u - EMISSIVE_TRIANGLE_SIZE).w;
        }
        let place = clamp((u - before) / max(b.w - before, 1e-30), 0.0, 1.0);
        let root = sqrt(place);
        let weights = vec2(root * (1.0 - v), root * v);
        let corner = bitcast<vec3<f32>>(a.xyz);
        let position = corner + (b.xyz - corner) * weights.x + (c.xyz - corner) * weights.y;
        let normal = normalized_or(cross(b.xyz - corner, c.xyz - corner), vec3(0.0));
        let to = position - p;
        let distance = length(to);
        let direction = normalized_or(to, vec3(0.0));
        let cosine = abs(dot(direction, normal));
        if cosine > 1e-6 && distance > 0.0 {
            s = LightSample(direction, distance, c.w * distance * distance / cosine, true);
            radiance = emission_at(Hit(distance, weights.x, weights.y, a.w, header.w), position);
        }
    } else if chosen != NONE {
        let number = chosen - view.area_count - emitter_count();
        let drawn = distant_sample(number, vec2(u, v));
        s = LightSample(drawn.direction, FAR, drawn.pdf, true);
        radiance = distant_radiance(number, drawn.direction).radiance;
    }
    s.pdf = s.pdf * (importance / max(total, 1.17549435e-38));
    s.valid = s.valid && s.pdf > 0.0 && s.pdf < FAR;
    return Illumination(s, radiance);
}

fn total_importance(p: vec3<f32>, n: vec3<f32>) -> f32 {
    var total = 0.0;
    for (var number = 0u; number < light_count(); number++) {
        total += light_importance(number, p, n);
    }
    return max(total, 1.17549435e-38);
}

fn selection_probability(p: vec3<f32>, n: vec3<f32>, number: u32) -> f32 {
    return light_importance(number, p, n) / total_importance(p, n);
}

// Density of sampling a point of a body that emits, from `p` with normal `n`; `cosine` is that of the ray with the triangle.
fn body_pdf(p: vec3<f32>, n: vec3<f32>, hit: Hit, cosine: f32) -> f32 {
    for (var i = 0u; i < emitter_count(); i++) {
        let header = tables[emitters_at() + i * EMITTER_SIZE];
        if header.w == hit.instance {
            let density = bitcast<f32>(table_word(header.z, hit.primitive));
            let probability = selection_probability(p, n, view.area_count + i);
            return probability * density * hit.t * hit.t / max(abs(cosine), 1e-6);
        }
    }
    return 0.0;
}

struct LightHit {
    number: u32,
    distance: f32,
}

// The first light that a ray hits closer than `to`; NONE if there is none.
fn intersect_lights(origin: vec3<f32>, direction: vec3<f32>, to: f32) -> LightHit {
    var first = LightHit(NONE, to);
    for (var number = 0u; number < view.area_count; number++) {
        let distance = shape_intersect(shape_at(number), origin, direction);
        if distance < first.distance {
            first = LightHit(number, distance);
        }
    }
    return first;
}

// Whether a light occludes what is at distance `to`, which may be a light itself.
fn lights_occlude(origin: vec3<f32>, direction: vec3<f32>, to: f32) -> bool {
    if view.area_count == 0u || light_count() <= 1u {
        return false;
    }
    return intersect_lights(origin, direction, to * (1.0 - TOUCHING)).number != NONE;
}
