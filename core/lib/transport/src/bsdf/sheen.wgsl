// Sheen fibers, as in sheen.rs.

const SHEEN_MIN_ALPHA: f32 = 0.04;

struct Sheen {
    wo: vec3<f32>,
    per_alpha: f32,
    row: Cell,
    own: f32,
}

fn sheen_raw(row: Cell, mu: f32) -> f32 {
    let column = table_cell(mu);
    let entry = lobe_table(2u * ALBEDO_CELLS * ALBEDO_CELLS + ALBEDO_CELLS + row.number * ALBEDO_CELLS + column.number);
    return mix(mix(entry.x, entry.y, column.weight), mix(entry.z, entry.w, column.weight), row.weight);
}

fn sheen_row_albedo(row: Cell, mu: f32) -> f32 {
    return min(sheen_raw(row, mu), 1.0);
}

fn sheen_new(roughness: f32, wo: vec3<f32>) -> Sheen {
    let row = table_cell(roughness);
    return Sheen(wo, 1.0 / max(roughness * roughness, SHEEN_MIN_ALPHA), row, sheen_raw(row, wo.z));
}

fn sheen_lobe(wo: vec3<f32>, wi: vec3<f32>, per_alpha: f32) -> f32 {
    var h = wo + wi;
    h *= 1.0 / sqrt(max(dot(h, h), 1e-20));
    let sin2 = max(1.0 - h.z * h.z, 1e-12);
    let density = (per_alpha + 2.0) * pow(sin2, per_alpha * 0.5) * (0.5 * FRAC_1_PI);
    return density * (1.0 / max((wo.z + wi.z - wo.z * wi.z) * 4.0, 1e-6));
}

// BSDF times cosine, and the density of sampling a direction.
fn sheen_evaluate(s: Sheen, wi: vec3<f32>) -> vec2<f32> {
    let raw = sheen_lobe(s.wo, wi, s.per_alpha);
    let excess = max(max(s.own, sheen_raw(s.row, wi.z)), 1.0);
    return vec2(raw * wi.z * (1.0 / excess), 0.5 * FRAC_1_PI);
}

fn sheen_sample(uv: vec2<f32>) -> vec3<f32> {
    let turn = sin_cos_turns(uv.y);
    let r = sqrt(max(1.0 - uv.x * uv.x, 0.0));
    return vec3(r * turn.y, r * turn.x, max(uv.x, 1e-5));
}
