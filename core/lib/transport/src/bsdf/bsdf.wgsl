// The base lobes, as in mod.rs. `PLAIN_DIELECTRICS` says whether dielectrics are glTF's plain mix.

const SCHLICK_MEAN: f32 = 0.0476190476190476;

struct BsdfParameters {
    base_color: vec3<f32>,
    roughness: f32,
    metallic: f32,
    dielectric_f0: f32,
}

struct Interface {
    f0: f32,
    f90: f32,
    multiple: f32,
}

struct Bsdf {
    wo: vec3<f32>,
    ggx: Ggx,
    row: Cell,
    f0: vec3<f32>,
    f90: f32,
    multiple: vec3<f32>,
    diffuse: vec3<f32>,
    dielectric: Interface,
    specular_probability: f32,
}

struct Lobes {
    glossy: vec3<f32>,
    matte: vec3<f32>,
    pdf: f32,
}

struct BsdfSample {
    valid: bool,
    wi: vec3<f32>,
    weight: vec3<f32>,
    pdf: f32,
    specular: bool,
    transmitted: bool,
    reflected: bool,
}

fn interface_albedo(i: Interface, lobe: vec2<f32>) -> f32 {
    return i.f0 * lobe.x + i.f90 * lobe.y + i.multiple * max(1.0 - albedo_white(lobe), 0.0);
}

fn multiple_reflectance(f0: f32, f90: f32, mean_albedo: f32) -> f32 {
    let fresnel_mean = f0 + (f90 - f0) * SCHLICK_MEAN;
    return fresnel_mean * fresnel_mean * mean_albedo / max(1.0 - fresnel_mean * (1.0 - mean_albedo), 1e-6);
}

fn bsdf_new(p: BsdfParameters, wo: vec3<f32>) -> Bsdf {
    let row = table_cell(p.roughness);
    let own = albedo_at(row, wo.z);
    let mean = row_mean(row);
    let lost = max(1.0 - albedo_white(own), 0.0);
    let lost_mean = max(1.0 - albedo_white(mean), 1e-4);
    let white_mean = albedo_white(mean);

    let dielectric_f90 = min(p.dielectric_f0 * 50.0, 1.0);
    let dielectric = Interface(
        p.dielectric_f0,
        dielectric_f90,
        multiple_reflectance(p.dielectric_f0, dielectric_f90, white_mean),
    );
    let f0 = mix(vec3(p.dielectric_f0), p.base_color, p.metallic);
    let f90 = dielectric.f90 + (1.0 - dielectric.f90) * p.metallic;
    let metal = vec3(
        multiple_reflectance(p.base_color.x, 1.0, white_mean),
        multiple_reflectance(p.base_color.y, 1.0, white_mean),
        multiple_reflectance(p.base_color.z, 1.0, white_mean),
    );
    var multiple = mix(vec3(dielectric.multiple), metal, p.metallic);
    let through_mean = max(1.0 - interface_albedo(dielectric, mean), 1e-4);
    let body = p.base_color * ((1.0 - p.metallic) * max(1.0 - interface_albedo(dielectric, own), 0.0));

    let specular = luminance(f0 * own.x) + f90 * own.y;
    let rest = luminance(body) + luminance(multiple) * lost;
    var probability = min(max(specular / max(specular + rest, 1e-6), 0.05), 0.95);
    probability = select(probability, 0.0, specular <= 0.0);
    probability = select(probability, 1.0, rest <= 1e-4);
    var diffuse = body * (FRAC_1_PI / through_mean);
    if PLAIN_DIELECTRICS {
        multiple = vec3(0.0);
        diffuse = p.base_color * ((1.0 - p.metallic) * FRAC_1_PI);
    } else {
        multiple = multiple * (lost * (FRAC_1_PI / lost_mean));
    }
    let ggx = ggx_new(max(p.roughness * p.roughness, MIN_ALPHA), wo);
    return Bsdf(wo, ggx, row, f0, f90, multiple, diffuse, dielectric, probability);
}

// BSDF times the cosine of `wi`, which is unit length with z > 0, and the density of sampling it.
fn bsdf_lobes(b: Bsdf, wi: vec3<f32>) -> Lobes {
    var h = b.wo + wi;
    h *= 1.0 / sqrt(max(dot(h, h), 1e-20));
    let density = ggx_density(b.ggx, h);
    let rise = schlick(dot(b.wo, h));
    let fresnel = b.f0 + (vec3(b.f90) - b.f0) * rise;
    let specular = fresnel * (density * ggx_visibility(b.ggx, wi.z));
    let albedo = albedo_at(b.row, wi.z);
    let multiple = b.multiple * max(1.0 - albedo_white(albedo), 0.0);
    var reflected = interface_albedo(b.dielectric, albedo);
    if PLAIN_DIELECTRICS {
        reflected = b.dielectric.f0 + (b.dielectric.f90 - b.dielectric.f0) * rise;
    }
    let diffuse = b.diffuse * max(1.0 - reflected, 0.0);
    let pdf = b.specular_probability * ggx_pdf(b.ggx, density) + (1.0 - b.specular_probability) * wi.z * FRAC_1_PI;
    return Lobes((specular + multiple) * wi.z, diffuse * wi.z, pdf);
}

struct BsdfDirection {
    wi: vec3<f32>,
    specular: bool,
}

fn bsdf_direction(b: Bsdf, uv: vec2<f32>) -> BsdfDirection {
    let probability = b.specular_probability;
    if uv.x < probability {
        return BsdfDirection(ggx_sample(b.ggx, vec2(uv.x / max(probability, 1e-6), uv.y)), true);
    }
    let r2 = (uv.x - probability) / max(1.0 - probability, 1e-6);
    let turn = sin_cos_turns(uv.y);
    let r = sqrt(max(r2, 0.0));
    return BsdfDirection(vec3(r * turn.y, r * turn.x, sqrt(max(1.0 - r2, 0.0))), false);
}

fn is_sound(wi: vec3<f32>, pdf: f32) -> bool {
    return wi.z > 1e-6 && pdf > 0.0 && pdf < FAR;
}

fn bsdf_sample(b: Bsdf, uv: vec2<f32>) -> BsdfSample {
    let drawn = bsdf_direction(b, uv);
    let lobes = bsdf_lobes(b, drawn.wi);
    let weight = (lobes.glossy + lobes.matte) * (1.0 / lobes.pdf);
    return BsdfSample(is_sound(drawn.wi, lobes.pdf), drawn.wi, weight, lobes.pdf, drawn.specular, false, false);
}
