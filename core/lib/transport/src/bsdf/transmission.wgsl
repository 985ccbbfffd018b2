// Interfaces and thin sheets, as in transmission.rs.

struct Transmission {
    wo: vec3<f32>,
    alpha: f32,
    eta: f32,
    thin_walled: bool,
    tint: vec3<f32>,
}

struct TransmissionSample {
    valid: bool,
    wi: vec3<f32>,
    weight: vec3<f32>,
    reflected: bool,
}

// Fresnel's reflectance of unpolarized light at a dielectric, and the cosine beyond; 1 and 0 for total reflection.
fn fresnel_dielectric(cos_i: f32, eta: f32) -> vec2<f32> {
    let per_eta = 1.0 / eta;
    let sin2_t = (1.0 - cos_i * cos_i) * per_eta * per_eta;
    if sin2_t >= 1.0 {
        return vec2(1.0, 0.0);
    }
    let cos_t = sqrt(max(1.0 - sin2_t, 0.0));
    let parallel = (eta * cos_i - cos_t) / max(eta * cos_i + cos_t, 1e-12);
    let perpendicular = (cos_i - eta * cos_t) / max(cos_i + eta * cos_t, 1e-12);
    return vec2((parallel * parallel + perpendicular * perpendicular) * 0.5, cos_t);
}

fn of_two_faces(fresnel: f32) -> f32 {
    return fresnel * 2.0 / (fresnel + 1.0);
}

fn pane_transmittance(cosine: f32, ior: f32) -> f32 {
    return 1.0 - of_two_faces(fresnel_dielectric(cosine, ior).x);
}

fn transmission_new(wo: vec3<f32>, roughness: f32, eta: f32, thin_walled: bool, tint: vec3<f32>) -> Transmission {
    return Transmission(wo, max(roughness * roughness, MIN_ALPHA), eta, thin_walled, tint);
}

// A direction on either side; `random` decides between reflection and passage, each of at least the probability `least`.
fn transmission_sample(t: Transmission, uv: vec2<f32>, random: f32, least: f32) -> TransmissionSample {
    let wo = t.wo;
    let standard = normalize(vec3(wo.x * t.alpha, wo.y * t.alpha, wo.z));
    let z = (1.0 - uv.y) * (standard.z + 1.0) - standard.z;
    let r = sqrt(max(1.0 - z * z, 0.0));
    let turn = sin_cos_turns(uv.x);
    var h = vec3(r * turn.y + standard.x, r * turn.x + standard.y, z + standard.z);
    h = vec3(h.x * t.alpha, h.y * t.alpha, max(h.z, 1e-6));
    h *= 1.0 / sqrt(max(dot(h, h), 1e-30));
    let cos_o = max(dot(wo, h), 1e-6);
    let reflectance = fresnel_dielectric(cos_o, t.eta);
    let fresnel = select(reflectance.x, of_two_faces(reflectance.x), t.thin_walled);
    let total = fresnel >= 1.0;
    let probability = select(min(max(fresnel, least), 1.0 - least), 1.0, total);
    let reflects = random < probability;

    let mirrored = h * (cos_o * 2.0) - wo;
    var wi = mirrored;
    if !reflects {
        let per_eta = 1.0 / t.eta;
        let refracted = h * (cos_o * per_eta - reflectance.y) - wo * per_eta;
        wi = select(refracted, vec3(mirrored.xy, -mirrored.z), t.thin_walled);
    }
    let up = abs(wi.z);
    wi.z = select(-up, up, reflects);
    let passage = (1.0 - fresnel) * (1.0 / max(1.0 - probability, 1e-6));
    let weight = select(t.tint * passage, vec3(fresnel * (1.0 / probability)), reflects);
    return TransmissionSample(up > 1e-6, wi, weight, reflects && !total);
}
