// GGX, as in ggx.rs.

const MIN_ALPHA: f32 = 1e-3;

struct Ggx {
    wo: vec3<f32>,
    alpha: f32,
    alpha2: f32,
    stretch: f32,
    bound: f32,
    per_density: f32,
}

fn ggx_stretch(alpha2: f32, mu: f32) -> f32 {
    return sqrt(alpha2 + (1.0 - alpha2) * mu * mu);
}

fn ggx_new(alpha: f32, wo: vec3<f32>) -> Ggx {
    let alpha2 = alpha * alpha;
    let stretch = ggx_stretch(alpha2, wo.z);
    let s = sqrt(wo.x * wo.x + wo.y * wo.y) + 1.0;
    let s2 = s * s;
    let bound = (1.0 - alpha2) * s2 / (s2 + alpha2 * wo.z * wo.z);
    let per_density = 1.0 / max((bound * wo.z + stretch) * 2.0, 1e-6);
    return Ggx(wo, alpha, alpha2, stretch, bound, per_density);
}

fn ggx_density(g: Ggx, h: vec3<f32>) -> f32 {
    let d = h.x * h.x + h.y * h.y + g.alpha2 * h.z * h.z;
    return g.alpha2 / max(d * d * PI, 1e-30);
}

fn ggx_visibility(g: Ggx, mu_i: f32) -> f32 {
    return 0.5 / max(mu_i * g.stretch + g.wo.z * ggx_stretch(g.alpha2, mu_i), 1e-6);
}

// A reflected direction; may point below the horizon.
fn ggx_sample(g: Ggx, uv: vec2<f32>) -> vec3<f32> {
    let standard = normalize(vec3(g.wo.x * g.alpha, g.wo.y * g.alpha, g.wo.z));
    let bound = g.bound * standard.z;
    let z = (1.0 - uv.y) * (bound + 1.0) - bound;
    let r = sqrt(max(1.0 - z * z, 0.0));
    let turn = sin_cos_turns(uv.x);
    var h = vec3(r * turn.y + standard.x, r * turn.x + standard.y, z + standard.z);
    h = vec3(h.x * g.alpha, h.y * g.alpha, h.z);
    let square = dot(h, h);
    if square > 1e-30 {
        h *= 1.0 / sqrt(square);
    } else {
        h = vec3(0.0, 0.0, 1.0);
    }
    return h * (dot(g.wo, h) * 2.0) - g.wo;
}

fn ggx_pdf(g: Ggx, density: f32) -> f32 {
    return density * g.per_density;
}

fn schlick(cosine: f32) -> f32 {
    let m = 1.0 - cosine;
    let m2 = m * m;
    return m2 * m2 * m;
}
