// Lights with a shape, as in sphere.rs, rect.rs and disk.rs. A light is six vectors of the light table:
// center, sort; x, half length; y, half length; normal, radius; radiance, luminance; window and two free numbers.

const SPHERE: u32 = 0u;
const RECT: u32 = 1u;
const DISK: u32 = 2u;

struct Shape {
    sort: u32,
    center: vec3<f32>,
    x: vec3<f32>,
    y: vec3<f32>,
    normal: vec3<f32>,
    half: vec2<f32>,
    radius: f32,
    radiance: vec3<f32>,
    luminance: f32,
    window: u32,
}

struct LightSample {
    direction: vec3<f32>,
    distance: f32,
    pdf: f32,
    valid: bool,
}

const RECT_FAR: f32 = 6.0;

fn rect_local(s: Shape, p: vec3<f32>) -> vec3<f32> {
    let d = p - s.center;
    return vec3(dot(d, s.x), dot(d, s.y), dot(d, s.normal));
}

fn rect_is_far(s: Shape, local: vec3<f32>) -> bool {
    return dot(local, local) > RECT_FAR * 4.0 * dot(s.half, s.half);
}

fn rect_area(s: Shape) -> f32 {
    return 4.0 * s.half.x * s.half.y;
}

struct SphericalRect {
    x: vec2<f32>,
    y: vec2<f32>,
    z: f32,
    b0: f32,
    b1: f32,
    k: f32,
    solid_angle: f32,
}

fn rect_spherical(s: Shape, local: vec3<f32>) -> SphericalRect {
    let x = vec2(-local.x - s.half.x, -local.x + s.half.x);
    let y = vec2(-local.y - s.half.y, -local.y + s.half.y);
    let z = -local.z;
    let z2 = z * z;
    let sx = x * (1.0 / sqrt(x * x + z2));
    let sy = y * (1.0 / sqrt(y * y + z2));
    let g0 = arc_cosine(sy.x * sx.y);
    let g1 = arc_cosine(-sx.y * sy.y);
    let g2 = arc_cosine(sy.y * sx.x);
    let g3 = arc_cosine(-sx.x * sy.x);
    let k = 2.0 * PI - g2 - g3;
    return SphericalRect(x, y, z, -sy.x, sy.y, k, max(g0 + g1 - k, 1e-6));
}

fn spherical_point(r: SphericalRect, uv: vec2<f32>) -> vec3<f32> {
    let turn = sin_cos_turns((uv.x * r.solid_angle + r.k) * (0.5 * FRAC_1_PI));
    let f = (turn.y * r.b0 - r.b1) / copysign(max(abs(turn.x), 1e-7), turn.x);
    let c = copysign(min(1.0 / sqrt(f * f + r.b0 * r.b0), 1.0), f);
    let x = min(max(-(c * r.z) / sqrt(max(1.0 - c * c, 1e-12)), r.x.x), r.x.y);
    let d2 = x * x + r.z * r.z;
    let h0 = r.y.x / sqrt(d2 + r.y.x * r.y.x);
    let h1 = r.y.y / sqrt(d2 + r.y.y * r.y.y);
    let h = h0 + uv.y * (h1 - h0);
    let h2 = h * h;
    let y = min(max(h * sqrt(d2 / max(1.0 - h2, 1e-6)), r.y.x), r.y.y);
    return vec3(x, select(r.y.y, y, h2 < 1.0 - 1e-6), r.z);
}

struct SphereCone {
    axis: vec3<f32>,
    distance2: f32,
    distance: f32,
    height: f32,
    inside: bool,
}

fn sphere_cone(s: Shape, p: vec3<f32>) -> SphereCone {
    let to_center = s.center - p;
    let distance2 = dot(to_center, to_center);
    let r2 = s.radius * s.radius;
    let inside = distance2 <= r2 * 1.0001;
    let distance = sqrt(distance2);
    let sin2 = r2 / max(distance2, 1e-30);
    let cosine = sqrt(max(1.0 - sin2, 0.0));
    if inside {
        return SphereCone(vec3(0.0, 0.0, 1.0), distance2, distance, 2.0, true);
    }
    return SphereCone(to_center * (1.0 / max(distance, 1e-20)), distance2, distance, sin2 / (cosine + 1.0), false);
}

// Distance to the lit surface; FAR if the ray misses it.
fn shape_intersect(s: Shape, origin: vec3<f32>, direction: vec3<f32>) -> f32 {
    if s.sort == SPHERE {
        let to_center = s.center - origin;
        let along = dot(to_center, direction);
        let across = to_center - direction * along;
        let half2 = s.radius * s.radius - dot(across, across);
        let half = sqrt(max(half2, 0.0));
        let near = along - half;
        let t = select(along + half, near, near > 0.0);
        return select(FAR, t, half2 >= 0.0 && t > 0.0);
    }
    let falling = -dot(direction, s.normal);
    if s.sort == RECT {
        let local = rect_local(s, origin);
        if !(falling > 0.0 && local.z > 0.0) {
            return FAR;
        }
        let t = local.z / falling;
        let x = abs(local.x + t * dot(direction, s.x));
        let y = abs(local.y + t * dot(direction, s.y));
        return select(FAR, t, x <= s.half.x && y <= s.half.y);
    }
    let height = dot(origin - s.center, s.normal);
    if !(falling > 0.0 && height > 0.0) {
        return FAR;
    }
    let t = height / falling;
    let at = origin + direction * t - s.center;
    return select(FAR, t, dot(at, at) <= s.radius * s.radius);
}

fn shape_sample(s: Shape, p: vec3<f32>, uv: vec2<f32>) -> LightSample {
    if s.sort == SPHERE {
        let cone = sphere_cone(s, p);
        let t = uv.x * cone.height;
        let cosine = 1.0 - t;
        let sin2 = max(t * (2.0 - t), 0.0);
        let turn = sin_cos_turns(uv.y);
        let sine = sqrt(sin2);
        let direction = basis_around(cone.axis) * vec3(sine * turn.y, sine * turn.x, cosine);
        let half2 = max(s.radius * s.radius - cone.distance2 * sin2, 0.0);
        var distance = cone.distance * cosine - sqrt(half2);
        if cone.inside {
            distance = shape_intersect(s, p, direction);
        }
        return LightSample(direction, distance, 1.0 / (cone.height * 2.0 * PI), true);
    }
    if s.sort == RECT {
        let local = rect_local(s, p);
        var to = vec3((uv.x * 2.0 - 1.0) * s.half.x - local.x, (uv.y * 2.0 - 1.0) * s.half.y - local.y, -local.z);
        let is_far = rect_is_far(s, local);
        var solid_angle = 1.0;
        if !is_far {
            let spherical = rect_spherical(s, local);
            to = spherical_point(spherical, uv);
            solid_angle = spherical.solid_angle;
        }
        let distance2 = dot(to, to);
        let distance = sqrt(distance2);
        let by_area = distance2 * distance / max(local.z * rect_area(s), 1e-30);
        let direction = s.x * to.x + s.y * to.y + s.normal * to.z;
        return LightSample(direction * (1.0 / distance), distance, select(1.0 / solid_angle, by_area, is_far), local.z > 0.0);
    }
    let turn = sin_cos_turns(uv.y);
    let r = sqrt(uv.x) * s.radius;
    let to = s.center + basis_around(s.normal) * vec3(r * turn.y, r * turn.x, 0.0) - p;
    let distance = length(to);
    let height = dot(p - s.center, s.normal);
    let pdf = distance * distance * distance / max(height * PI * s.radius * s.radius, 1e-30);
    return LightSample(to * (1.0 / max(distance, 1e-20)), distance, pdf, height > 0.0);
}

// Density of `shape_sample` for a direction that hits the light at a distance.
fn shape_pdf(s: Shape, p: vec3<f32>, distance: f32) -> f32 {
    if s.sort == SPHERE {
        return 1.0 / (sphere_cone(s, p).height * 2.0 * PI);
    }
    let cubed = distance * distance * distance;
    if s.sort == RECT {
        let local = rect_local(s, p);
        if local.z <= 0.0 {
            return 0.0;
        }
        if rect_is_far(s, local) {
            return cubed / max(local.z * rect_area(s), 1e-30);
        }
        return 1.0 / rect_spherical(s, local).solid_angle;
    }
    let height = dot(p - s.center, s.normal);
    return select(0.0, cubed / max(height * PI * s.radius * s.radius, 1e-30), height > 0.0);
}

// An upper estimate of the irradiance at a point, unshadowed, up to a factor.
fn shape_importance(s: Shape, p: vec3<f32>, n: vec3<f32>) -> f32 {
    let to = s.center - p;
    let distance2 = dot(to, to);
    let full = PI * s.luminance;
    if s.sort == SPHERE {
        if distance2 <= s.radius * s.radius * 1.0001 {
            return full;
        }
        let per_distance = 1.0 / sqrt(max(distance2, 1e-30));
        let sine = min(per_distance * s.radius, 1.0);
        return sine * sine * max(min(dot(n, to) * per_distance + sine, 1.0), 0.0) * full;
    }
    let height = -dot(to, s.normal);
    let squared = max(distance2, 1e-20);
    let per_distance = 1.0 / sqrt(squared);
    let reach = select(s.radius, sqrt(dot(s.half, s.half)), s.sort == RECT);
    let area = select(PI * s.radius * s.radius, rect_area(s), s.sort == RECT);
    let cosine = max(min((dot(n, to) + reach) * per_distance, 1.0), 0.0);
    let form_factor = min(height * (area * FRAC_1_PI) * per_distance / squared, 1.0);
    return max(form_factor, 0.0) * cosine * full;
}
