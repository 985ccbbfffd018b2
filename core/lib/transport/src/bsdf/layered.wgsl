// Layered surfaces, as in layered.rs: a path scatters from one layer.

const LOBE_BASE: u32 = 0u;
const LOBE_SHEEN: u32 = 1u;
const LOBE_THIN_WALLED: u32 = 2u;
const LOBE_REFRACTION: u32 = 3u;

struct Layered {
    lobe: u32,
    coating: CoatingAttenuation,
    sheen: Sheen,
    transmission: Transmission,
    color: vec3<f32>,
}

fn is_transmission(lobe: u32) -> bool {
    return lobe >= LOBE_THIN_WALLED;
}

fn layered_new(lobe: u32, coating: CoatingParameters, eta: f32, p: BsdfParameters, wo: vec3<f32>) -> Layered {
    let thin_walled = lobe == LOBE_THIN_WALLED;
    let tint = select(sqrt(p.base_color), p.base_color, thin_walled);
    return Layered(
        lobe,
        coating_new(coating, wo.z),
        sheen_new(p.roughness, wo),
        transmission_new(wo, p.roughness, eta, thin_walled, tint),
        p.base_color,
    );
}

fn layered_lobes(l: Layered, b: Bsdf, wi: vec3<f32>) -> Lobes {
    if is_transmission(l.lobe) {
        return Lobes(vec3(0.0), vec3(0.0), bsdf_lobes(b, wi).pdf);
    }
    let left = coating_factors(l.coating, wi.z);
    if l.lobe == LOBE_SHEEN {
        let sheen = sheen_evaluate(l.sheen, wi);
        return Lobes(vec3(0.0), l.color * (sheen.x * left.x), sheen.y);
    }
    let lobes = bsdf_lobes(b, wi);
    return Lobes(lobes.glossy * left.x, lobes.matte * left.y, lobes.pdf);
}

// Samples a direction; `random` and `least` are as for `transmission_sample`.
fn layered_sample(l: Layered, b: Bsdf, uv: vec2<f32>, random: f32, least: f32) -> BsdfSample {
    if is_transmission(l.lobe) {
        let t = transmission_sample(l.transmission, uv, random, least);
        return BsdfSample(t.valid, t.wi, t.weight, FAR, true, t.wi.z < 0.0, t.reflected);
    }
    var drawn = bsdf_direction(b, uv);
    if l.lobe == LOBE_SHEEN {
        drawn = BsdfDirection(sheen_sample(uv), false);
    }
    let lobes = layered_lobes(l, b, drawn.wi);
    let weight = (lobes.glossy + lobes.matte) * (1.0 / lobes.pdf);
    return BsdfSample(is_sound(drawn.wi, lobes.pdf), drawn.wi, weight, lobes.pdf, drawn.specular, false, false);
}
