// What clearcoat and sheen fibers take from the layers below them, as in coating.rs.

const CLEARCOAT_F0: f32 = 0.04;

struct CoatingParameters {
    clearcoat: f32,
    clearcoat_roughness: f32,
    sheen: f32,
    sheen_roughness: f32,
}

struct CoatingAttenuation {
    parameters: CoatingParameters,
    coat_row: Cell,
    coat: Interface,
    coat_own: f32,
    per_coat_mean: f32,
    sheen_row: Cell,
    sheen_own: f32,
}

fn coating_new(p: CoatingParameters, mu_o: f32) -> CoatingAttenuation {
    let coat_row = table_cell(p.clearcoat_roughness);
    let mean = row_mean(coat_row);
    let coat = Interface(CLEARCOAT_F0, 1.0, multiple_reflectance(CLEARCOAT_F0, 1.0, albedo_white(mean)));
    let sheen_row = table_cell(p.sheen_roughness);
    return CoatingAttenuation(
        p,
        coat_row,
        coat,
        interface_albedo(coat, albedo_at(coat_row, mu_o)) * p.clearcoat,
        1.0 / max(1.0 - interface_albedo(coat, mean) * p.clearcoat, 1e-3),
        sheen_row,
        sheen_row_albedo(sheen_row, mu_o) * p.sheen,
    );
}

// What is left of glossy (x) and of diffuse (y) light from `mu_i`.
fn coating_factors(a: CoatingAttenuation, mu_i: f32) -> vec2<f32> {
    let coat = interface_albedo(a.coat, albedo_at(a.coat_row, mu_i)) * a.parameters.clearcoat;
    let sheen = 1.0 - max(a.sheen_own, sheen_row_albedo(a.sheen_row, mu_i) * a.parameters.sheen);
    let matte = max(1.0 - a.coat_own, 0.0) * max(1.0 - coat, 0.0) * a.per_coat_mean;
    return vec2(max(1.0 - max(a.coat_own, coat), 0.0) * sheen, matte * sheen);
}

// Albedo of full clearcoat seen from a direction.
fn clearcoat_albedo(roughness: f32, mu: f32) -> f32 {
    return coating_new(CoatingParameters(1.0, roughness, 0.0, 0.0), mu).coat_own;
}

// Albedo of white sheen fibers seen from a direction.
fn sheen_albedo(roughness: f32, mu: f32) -> f32 {
    return sheen_row_albedo(table_cell(roughness), mu);
}
