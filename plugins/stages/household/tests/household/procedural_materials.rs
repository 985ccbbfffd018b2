//! Procedural materials: they tile, differ, and stay within the range of real surfaces.

use std::collections::BTreeSet;
use std::time::Instant;
use syntable_household::material::MaterialFamily;
use syntable_model::digest::Digest;
use syntable_model::random::Stream;
use syntable_model::scene::{Encoding, Material, Texture, Wrap};

fn textures(material: &Material) -> Vec<&Texture> {
    let color = material.base_color.texture.as_ref().map(|t| &*t.texture);
    let normal = material.normal.as_ref().map(|n| &*n.map.texture);
    color.into_iter().chain(normal).collect()
}

fn texel(texture: &Texture, x: usize, y: usize) -> [f64; 4] {
    let i = 4 * (y * texture.width as usize + x);
    std::array::from_fn(|k| f64::from(texture.texels[i + k]))
}

/// Mean difference between neighboring columns (or rows) x and x + 1, wrapped.
fn step(texture: &Texture, at: usize, column: bool) -> f64 {
    let n = texture.width as usize;
    let pairs = (0..n).map(|i| {
        let (a, b) = if column { ([at, i], [(at + 1) % n, i]) } else { ([i, at], [i, (at + 1) % n]) };
        let (a, b) = (texel(texture, a[0], a[1]), texel(texture, b[0], b[1]));
        (0..4).map(|k| (a[k] - b[k]).abs()).sum::<f64>()
    });
    pairs.sum::<f64>() / n as f64
}

#[test]
fn textures_tile() {
    for family in MaterialFamily::ALL {
        for variant in 0..2 {
            let material = family.bake(&Stream::root(3).at(variant), 128, "m");
            for texture in textures(&material) {
                assert_eq!((texture.width, texture.height, texture.wrap), (128, 128, [Wrap::Repeat; 2]));
                for column in [true, false] {
                    // Across the border no step is larger than the largest inside.
                    let inside = (0..127).map(|at| step(texture, at, column)).fold(0.0, f64::max);
                    let border = step(texture, 127, column);
                    assert!(
                        border <= 1.1 * inside + 2.0,
                        "{family:?}: {border} across, {inside} inside, column {column}"
                    );
                }
            }
        }
    }
}

#[test]
fn surfaces_are_plausible() {
    for family in MaterialFamily::ALL {
        let metal = matches!(family, MaterialFamily::Metal | MaterialFamily::BrushedMetal);
        for variant in 0..4 {
            let material = family.bake(&Stream::root(7).at(variant), 128, "m");
            assert_eq!(material.metallic.factor, if metal { 1.0 } else { 0.0 });
            assert!((0.05..=2.0).contains(&material.tile_m), "{family:?}: {}", material.tile_m);
            let color = &material.base_color.texture.as_ref().expect("a texture").texture;
            assert_eq!(color.encoding, Encoding::Srgb);
            let n = f64::from(color.width * color.height);
            let mean: [f64; 4] = (0..color.texels.len()).fold([0.0; 4], |mut sum, i| {
                sum[i % 4] += f64::from(color.texels[i]) / n / 255.0;
                sum
            });
            let brightest = mean[..3].iter().copied().fold(0.0, f64::max);
            assert!((0.05..0.97).contains(&brightest), "{family:?}: mean color {mean:?}");
            // Roughness is in the alpha channel of the same texture.
            assert_eq!(
                material.roughness.texture.as_ref().map(|(t, channel)| (t.texture.digest, *channel)),
                Some((color.digest, 3))
            );
            assert!((0.04..=1.0).contains(&mean[3]), "{family:?}: mean roughness {}", mean[3]);
            let normal = &material.normal.as_ref().expect("a normal map").map.texture;
            assert_eq!(normal.encoding, Encoding::Linear);
            for texel in normal.texels.chunks(4) {
                let [x, y, z] = std::array::from_fn(|k| f64::from(texel[k]) / 127.5 - 1.0);
                let length: f64 = x * x + y * y + z * z;
                assert!((length - 1.0).abs() < 0.03 && z > 0.1, "{family:?}: normal {x} {y} {z}");
            }
        }
    }
}

#[test]
fn clearcoat_and_sheen_are_where_they_belong() {
    for family in MaterialFamily::ALL {
        let baked: Vec<Material> = (0..24).map(|i| family.bake(&Stream::root(5).at(i), 64, "m")).collect();
        let coated = baked.iter().filter(|material| material.clearcoat.is_some()).count();
        let fibrous = baked.iter().filter(|material| material.sheen.is_some()).count();
        match family {
            MaterialFamily::Ceramic | MaterialFamily::Lacquer => assert_eq!((coated, fibrous), (24, 0), "{family:?}"),
            MaterialFamily::Timber
            | MaterialFamily::Wood
            | MaterialFamily::Leather
            | MaterialFamily::StitchedLeather => {
                assert!((1..24).contains(&coated) && fibrous == 0, "{family:?}: {coated}");
            }
            MaterialFamily::Fabric
            | MaterialFamily::Carpet
            | MaterialFamily::Velvet
            | MaterialFamily::Knit
            | MaterialFamily::Quilt
            | MaterialFamily::Tablecloth
            | MaterialFamily::Upholstery => {
                assert_eq!((coated, fibrous), (0, 24), "{family:?}");
                for sheen in baked.iter().filter_map(|material| material.sheen.as_ref()) {
                    assert!(sheen.color.factor.iter().all(|x| (0.0..=1.0).contains(x)), "{sheen:?}");
                    assert!(sheen.color.factor.iter().any(|x| *x > 0.01), "{sheen:?}");
                }
            }
            _ => assert_eq!((coated, fibrous), (0, 0), "{family:?}"),
        }
        for material in &baked {
            assert_eq!(material.clone().with_digest().digest, material.digest, "the digest covers everything");
        }
    }
}

#[test]
fn variants_differ_and_repeat() {
    let mut seen = BTreeSet::<Digest>::new();
    for family in MaterialFamily::ALL {
        for variant in 0..3 {
            let bake = || family.bake(&Stream::root(1).child(family.name()).at(variant), 64, "m");
            let material = bake();
            assert_eq!(bake().digest, material.digest);
            assert!(seen.insert(material.digest), "{family:?} {variant} is a copy");
        }
    }
}

/// The time in the documentation. The bound is loose, for busy machines.
#[test]
fn baking_is_quick() {
    for family in MaterialFamily::ALL {
        let best = (0..3)
            .map(|variant| {
                let start = Instant::now();
                family.bake(&Stream::root(variant), 512, "m");
                start.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min);
        println!("{family:?}: {:.0} ms for 512 × 512", best * 1e3);
        assert!(best < 0.5, "{family:?} takes {best} s");
    }
}
