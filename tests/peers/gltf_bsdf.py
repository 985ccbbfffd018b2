"""glTF's metallic-roughness surface as a BSDF of Mitsuba, so that whole recipes can be compared.

The model is the one that book/src/reference and the renderer's documentation state: GGX with height-correlated masking
and Schlick's Fresnel term; the light that Smith's model loses, after Kulla and Conty; Lambert's lobe weighted by what
the interface lets in and out; and soft terminators after Chiang, Li and Burley. It is written anew from the equations:
its albedos come from tables of its own, and its directions from another sampler.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

SIZE = 33
STRATA = 64
MIN_ALPHA = 1e-3
SCHLICK_MEAN = 1 / 21


def albedos() -> np.ndarray:
    """Directional albedo of the single-scattering lobe by roughness and cosine, `[roughness, cosine, 2]`: what
    multiplies the reflectance at normal incidence, and what is added to it.
    """
    grid = np.linspace(0, 1, SIZE)
    return np.array([[_albedo(max(r * r, MIN_ALPHA), max(mu, 1e-3)) for mu in grid] for r in grid])


def _albedo(alpha: float, mu: float) -> tuple[float, float]:
    """By visible normals (Heitz, JCGT 2018), stratified."""
    u, v = (np.mgrid[0:STRATA, 0:STRATA].reshape(2, -1) + 0.5) / STRATA
    across = np.sqrt(1 - mu * mu)
    view = np.array([alpha * across, 0, mu])
    view /= np.linalg.norm(view)
    first = np.array([0.0, 1.0, 0.0])
    second = np.cross(view, first)
    r, turn = np.sqrt(u), 2 * np.pi * v
    x, fraction = r * np.cos(turn), (1 + view[2]) / 2
    y = (1 - fraction) * np.sqrt(1 - x * x) + fraction * r * np.sin(turn)
    half = np.outer(x, first) + np.outer(y, second) + np.outer(np.sqrt(np.maximum(0, 1 - x * x - y * y)), view)
    half *= [alpha, alpha, 1]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cosine = half @ [across, 0, mu]
    out = 2 * cosine * half[:, 2] - mu
    hidden = lambda z: (np.sqrt(1 + alpha**2 * (1 / np.maximum(z, 1e-6) ** 2 - 1)) - 1) / 2
    weight = np.where(out > 0, (1 + hidden(mu)) / (1 + hidden(mu) + hidden(out)), 0)
    rise = (1 - cosine) ** 5
    return float(np.mean(weight * (1 - rise))), float(np.mean(weight * rise))


class Gltf(mi.BSDF):
    """One-sided; parameters `base_color`, `roughness` and `metallic` are textures, `ior` is a number."""

    _tables = None

    def __init__(self, props):
        super().__init__(props)
        self._base, self._rough, self._metal = map(props.get_texture, ("base_color", "roughness", "metallic"))
        self._f0 = ((props["ior"] - 1) / (props["ior"] + 1)) ** 2
        flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        self.m_components, self.m_flags = [flags], flags
        if Gltf._tables is None:
            table = albedos()
            cosines = np.linspace(0, 1, SIZE)[:, None]
            inner = 2 * cosines * table
            means = (inner[:, 1:] + inner[:, :-1]).mean(1) / 2
            Gltf._tables = [mi.Texture2f(mi.TensorXf(np.float32(table))), mi.Texture1f(mi.TensorXf(np.float32(means)))]

    def sample(self, ctx, si, sample1, sample2, active=True):
        found = dr.zeros(mi.BSDFSample3f)
        glossy = sample1 < 0.5
        normal, _ = self._microfacets(self._surface(si, active)[1]).sample(si.wi, sample2)
        found.wo = dr.select(glossy, mi.reflect(si.wi, normal), mi.warp.square_to_cosine_hemisphere(sample2))
        found.eta = 1.0
        found.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        found.sampled_component = mi.UInt32(0)
        value, found.pdf = self.eval_pdf(ctx, si, found.wo, active)
        active &= (mi.Frame3f.cos_theta(si.wi) > 0) & (found.pdf > 0)
        return found, dr.select(active, value / found.pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        base, rough, metal = self._surface(si, active)
        mu_o, mu_i = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        active &= (mu_o > 0) & (mu_i > 0)
        half = dr.normalize(si.wi + wo)
        cosine = dr.dot(si.wi, half)
        a2 = dr.square(dr.maximum(dr.square(rough), MIN_ALPHA))
        density = a2 / (dr.pi * dr.square(dr.square(half.z) * (a2 - 1) + 1))
        reach = lambda mu: dr.sqrt(a2 + (1 - a2) * dr.square(mu))
        visible = 0.5 / (mu_i * reach(mu_o) + mu_o * reach(mu_i))

        f90 = min(50 * self._f0, 1.0)
        own, other, mean = self._albedo(rough, mu_o), self._albedo(rough, mu_i), self._mean(rough)
        lost = (1 - own[0] - own[1]) * (1 - other[0] - other[1]) / dr.maximum(1 - mean[0] - mean[1], 1e-4)
        after = lambda f0, f90: self._after(f0 + (f90 - f0) * SCHLICK_MEAN, mean[0] + mean[1])
        f0, rim = dr.lerp(mi.Color3f(self._f0), base, metal), dr.lerp(f90, 1.0, metal)
        single = (f0 + (rim - f0) * (1 - cosine) ** 5) * density * visible
        more = dr.lerp(mi.Color3f(after(self._f0, f90)), after(base, 1.0), metal) * lost / dr.pi
        taken = lambda e: self._f0 * e[0] + f90 * e[1] + after(self._f0, f90) * (1 - e[0] - e[1])
        matte = base * (1 - metal) * (1 - taken(own)) * (1 - taken(other)) / (1 - taken(mean)) / dr.pi
        value = (single + more + matte) * mu_i * self._terminator(si, wo)

        glossy = self._microfacets(rough).pdf(si.wi, half) / (4 * cosine)
        pdf = 0.5 * glossy + 0.5 * mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def eval_diffuse_reflectance(self, si, active=True):
        return self._base.eval(si, active)

    @staticmethod
    def _terminator(si, wo):
        """Shadow-terminator factor of light from `wo` at a perturbed normal, where the face turns away from it."""
        normal, direction = si.sh_frame.n, si.to_world(wo)
        face = dr.mulsign(mi.Vector3f(si.n), dr.dot(si.n, normal))
        terminator = dr.dot(face, direction) / dr.maximum(dr.dot(normal, direction) * dr.dot(normal, face), 1e-6)
        g = dr.clip(terminator, 0, 1)
        return g * (1 + g - dr.square(g))

    @staticmethod
    def _after(fresnel, mean):
        """Fraction of the light that single scattering loses which leaves after further bounces."""
        return dr.square(fresnel) * mean / (1 - fresnel * (1 - mean))

    def _surface(self, si, active):
        return self._base.eval(si, active), self._rough.eval(si, active).x, self._metal.eval(si, active).x

    @staticmethod
    def _microfacets(rough):
        alpha = dr.maximum(dr.square(rough), MIN_ALPHA)
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)

    @staticmethod
    def _place(x):
        """From [0, 1] between the centers of the first and the last texel."""
        return (dr.clip(x, 0, 1) * (SIZE - 1) + 0.5) / SIZE

    @classmethod
    def _albedo(cls, rough, mu):
        return cls._tables[0].eval(mi.Point2f(cls._place(mu), cls._place(rough)))

    @classmethod
    def _mean(cls, rough):
        return cls._tables[1].eval(mi.Point1f(cls._place(rough)))


mi.register_bsdf("gltf", Gltf)
