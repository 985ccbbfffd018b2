//! Details of formats: conversion of arrays, colors, coordinates and materials.

use crate::common::source_of;
use crate::inputs::{base64, encode, load, write};
use image::{ImageFormat, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};
use syntable_model::context::Collected;
use syntable_model::scene::{Alpha, Encoding, Object, Scalar, Volume, Wrap};
use tempfile::TempDir;

/// A tetrahedron of 0.1 m with texture coordinates and colors, as arrays: y up, v down, as in glTF.
pub const POSITIONS: [[f32; 3]; 4] = [[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
const UVS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.25, 0.75]];
pub const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// Collects buffer views and accessors.
#[derive(Default)]
pub struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    pub fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    pub fn accessor(&mut self, mut accessor: Value, view: Option<usize>) -> usize {
        if let Some(view) = view {
            accessor["bufferView"] = view.into();
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    pub fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(json!({ "componentType": 5126, "count": rows.len(), "type": kind }), Some(view))
    }

    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().map(|&index| index as u8).collect();
        let view = self.view(&bytes, None);
        self.accessor(json!({ "componentType": 5121, "count": indices.len(), "type": "SCALAR" }), Some(view))
    }

    /// A document with one primitive, and more keys.
    pub fn document(self, primitive: &Value, more: Value) -> String {
        let uri = format!("data:application/octet-stream;base64,{}", base64(&self.bytes));
        let mut document = json!({
            "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [primitive] }],
            "buffers": [{ "byteLength": self.bytes.len(), "uri": uri }],
            "bufferViews": self.views, "accessors": self.accessors,
        });
        if let (Some(document), Value::Object(more)) = (document.as_object_mut(), more) {
            document.extend(more);
        }
        document.to_string()
    }
}

pub fn object(text: &str) -> Object {
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "x.gltf", text);
    load(folder.path(), "x")
}

/// Faces as positions in micrometers and texture coordinates in thousandths, sorted.
fn faces(object: &Object) -> Vec<Vec<[i32; 5]>> {
    let data = object.mesh.data();
    let corner = |&index: &u32| {
        let ([x, y, z], uv) = (data.positions[index as usize], data.uvs.get(index as usize).copied());
        let [u, v] = uv.unwrap_or_default();
        [x * 1e6, y * 1e6, z * 1e6, u * 1e3, v * 1e3].map(|x| x.round() as i32)
    };
    let mut faces: Vec<Vec<[i32; 5]>> = data
        .triangles
        .iter()
        .map(|triangle| {
            let mut face: Vec<_> = triangle.iter().map(corner).collect();
            let first = (0..3).min_by_key(|&i| face[i]).expect("three");
            face.rotate_left(first);
            face
        })
        .collect();
    faces.sort();
    faces
}

fn image() -> String {
    let png =
        encode(RgbImage::from_fn(4, 4, |x, y| image::Rgb([x as u8 * 60, y as u8 * 60, 7])).into(), ImageFormat::Png);
    format!("data:image/png;base64,{}", base64(&png))
}

fn textured() -> Value {
    json!({
        "images": [{ "uri": image() }], "textures": [{ "source": 0 }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
    })
}

#[test]
fn accessors_in_all_their_forms_give_the_same_mesh() {
    let plain = |change: &dyn Fn(&mut Builder) -> (usize, usize, usize)| {
        let mut builder = Builder::default();
        let (position, uv, index) = change(&mut builder);
        let attributes = json!({ "POSITION": position, "TEXCOORD_0": uv });
        faces(&object(
            &builder.document(&json!({ "attributes": attributes, "indices": index, "material": 0 }), textured()),
        ))
    };
    let want = plain(&|b| (b.floats(&POSITIONS), b.floats(&UVS), b.indices(FACES.as_flattened())));
    // By hand: (x, y, z) becomes (x, -z, y), and v is flipped.
    assert!(want.iter().flatten().any(|corner| *corner == [0, -100_000, 0, 250, 250]), "{want:?}");
    assert!(want.iter().flatten().any(|corner| *corner == [0, 0, 100_000, 0, 0]), "{want:?}");

    let interleaved = plain(&|b| {
        let rows: Vec<u8> = POSITIONS
            .iter()
            .zip(UVS)
            .flat_map(|(p, uv)| {
                [&p[..], &uv, &[f32::NAN]].concat().into_iter().flat_map(f32::to_le_bytes).collect::<Vec<_>>()
            })
            .collect();
        let view = b.view(&rows, Some(24));
        let p = b.accessor(json!({ "componentType": 5126, "count": 4, "type": "VEC3" }), Some(view));
        let uv = b.accessor(json!({ "componentType": 5126, "count": 4, "type": "VEC2", "byteOffset": 12 }), Some(view));
        (p, uv, b.indices(FACES.as_flattened()))
    });
    assert_eq!(interleaved, want, "interleaved");

    let normalized = plain(&|b| {
        let bytes: Vec<u8> = UVS.iter().flatten().flat_map(|x| ((x * 65_535.0).round() as u16).to_le_bytes()).collect();
        let view = b.view(&bytes, None);
        let uv = json!({ "componentType": 5123, "normalized": true, "count": 4, "type": "VEC2" });
        (b.floats(&POSITIONS), b.accessor(uv, Some(view)), b.indices(FACES.as_flattened()))
    });
    assert_eq!(normalized, want, "normalized");

    let sparse = plain(&|b| {
        let at = b.view(&[1, 2, 3], None);
        let values: Vec<u8> = POSITIONS[1..].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let values = b.view(&values, None);
        let p = json!({ "componentType": 5126, "count": 4, "type": "VEC3", "sparse": { "count": 3,
            "indices": { "bufferView": at, "componentType": 5121 }, "values": { "bufferView": values } } });
        (b.accessor(p, None), b.floats(&UVS), b.indices(FACES.as_flattened()))
    });
    assert_eq!(sparse, want, "sparse");

    let folder = TempDir::new().expect("temp folder");
    let mut text = String::from("mtllib x.mtl\nusemtl m\n");
    POSITIONS.iter().for_each(|[x, y, z]| text += &format!("v {x} {} {y}\n", -z));
    UVS.iter().for_each(|[u, v]| text += &format!("vt {u} {}\n", 1.0 - v));
    FACES.iter().for_each(|[a, b, c]| text += &format!("f {0}/{0} {1}/{1} {2}/{2}\n", a + 1, b + 1, c + 1));
    write(folder.path(), "x.obj", text);
    write(folder.path(), "x.mtl", "newmtl m\nKd 1 1 1\n");
    assert_eq!(faces(&load(folder.path(), "x")), want, "OBJ");
}

#[test]
fn strips_and_fans_are_triangles() {
    for (mode, indices) in [(4, FACES.as_flattened()), (5, &[0, 2, 1, 3, 0, 2][..]), (6, &[0, 2, 1, 3, 2][..])] {
        let mut builder = Builder::default();
        let (position, index) = (builder.floats(&POSITIONS), builder.indices(indices));
        let primitive = json!({ "attributes": { "POSITION": position }, "indices": index, "mode": mode });
        let folder = TempDir::new().expect("temp folder");
        write(folder.path(), "x.gltf", builder.document(&primitive, json!({})));
        let source = source_of("mesh_folder", folder.path(), "");
        let object = source.load("x", &Collected::default()).expect("loads").into_object().expect("an object");
        // All of the tetrahedron's faces that a mode can produce are among the right ones, and face outwards.
        let right: Vec<Vec<[i32; 5]>> = {
            let mut builder = Builder::default();
            let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
            let primitive = json!({ "attributes": { "POSITION": position }, "indices": index });
            faces(&self::object(&builder.document(&primitive, json!({}))))
        };
        let got = faces(&object);
        assert_eq!(got.len(), if mode == 6 { 3 } else { 4 }, "mode {mode}");
        assert!(got.iter().all(|face| right.contains(face)), "mode {mode}: {got:?}");
    }
}

#[test]
fn gltf_materials() {
    let mut builder = Builder::default();
    let (position, uv) = (builder.floats(&POSITIONS), builder.floats(&UVS));
    let index = builder.indices(FACES.as_flattened());
    let view = {
        let colors: Vec<u8> = [[255, 0, 51, 255]; 4].concat();
        builder.view(&colors, None)
    };
    let color = json!({ "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" });
    let color = builder.accessor(color, Some(view));
    let png = encode(RgbImage::new(2, 2).into(), ImageFormat::Png);
    let view_of_png = builder.view(&png, None);
    let primitive = json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv, "COLOR_0": color }, "indices": index, "material": 0 });
    let transform = json!({ "KHR_texture_transform": { "scale": [2, 3] } });
    let more = json!({
        "extensionsUsed": ["KHR_texture_transform", "KHR_texture_basisu", "KHR_materials_ior", "KHR_materials_emissive_strength"],
        "images": [{ "uri": image() }, { "bufferView": view_of_png, "mimeType": "image/png" }, { "uri": "never.ktx2", "mimeType": "image/ktx2" }],
        "samplers": [{ "wrapS": 33071, "wrapT": 33648 }],
        "textures": [{ "source": 0, "sampler": 0, "extensions": { "KHR_texture_basisu": { "source": 2 } } }, { "source": 1 }],
        "materials": [{
            "name": "skin", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 1, 0.5], "metallicFactor": 0.75, "roughnessFactor": 0.5,
                "baseColorTexture": { "index": 0, "extensions": transform }, "metallicRoughnessTexture": { "index": 1 },
            },
            "normalTexture": { "index": 1, "scale": 0.5, "extensions": transform },
            "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 0.5, 0],
            "extensions": { "KHR_materials_ior": { "ior": 1.33 }, "KHR_materials_emissive_strength": { "emissiveStrength": 40 } },
        }],
    });
    let object = object(&builder.document(&primitive, more));
    assert_eq!(object.mesh.data().colors[2], [1.0, 0.0, 0.2]);
    let material = &object.materials[0];
    assert_eq!((material.name.as_str(), material.ior), ("skin", 1.33));
    // Alpha is factor times texture: a cutoff of 1/4 with the factor 1/2 cuts the texture at 1/2.
    assert_eq!(material.alpha, Alpha::Mask { cutoff: 0.5 });
    assert_eq!(material.base_color.factor, [0.5, 0.25, 1.0]);
    let color = material.base_color.texture.as_ref().expect("a texture");
    assert_eq!((color.texture.wrap, color.texture.encoding), ([Wrap::Clamp, Wrap::Mirror], Encoding::Srgb));
    assert_eq!((color.transform.scale, color.transform.offset), ([2.0, 3.0], [0.0, -2.0]));
    for (scalar, factor, channel) in [(&material.roughness, 0.5, 1), (&material.metallic, 0.75, 2)] {
        let (texture, at) = scalar.texture.as_ref().expect("a texture");
        assert_eq!((scalar.factor, *at, texture.texture.encoding), (factor, channel, Encoding::Linear));
        assert_eq!((texture.texture.width, texture.texture.wrap), (2, [Wrap::Repeat; 2]));
    }
    let normal = material.normal.as_ref().expect("a normal map");
    assert_eq!((normal.strength, normal.map.transform.scale), (0.5, [2.0, 3.0]));
    assert_eq!(material.emission.factor, [40.0, 20.0, 0.0]);
}

/// A tetrahedron with texture coordinates, whose material has these extensions and alpha.
fn layered(extensions: &Value, more: Value) -> Object {
    let mut builder = Builder::default();
    let (position, uv) = (builder.floats(&POSITIONS), builder.floats(&UVS));
    let index = builder.indices(FACES.as_flattened());
    let primitive =
        json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "indices": index, "material": 0 });
    let mut material = json!({ "extensions": extensions });
    if let (Some(material), Value::Object(more)) = (material.as_object_mut(), more) {
        material.extend(more);
    }
    let used: Vec<&String> = extensions.as_object().expect("a table").keys().collect();
    object(&builder.document(
        &primitive,
        json!({
            "extensionsUsed": used, "images": [{ "uri": image() }], "textures": [{ "source": 0 }],
            "materials": [material],
        }),
    ))
}

#[test]
fn gltf_layers() {
    let half = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 3] } } });
    let object = layered(
        &json!({
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.5, "clearcoatTexture": { "index": 0 }, "clearcoatRoughnessFactor": 0.25,
                "clearcoatRoughnessTexture": half, "clearcoatNormalTexture": { "index": 0, "scale": 0.5 },
            },
            "KHR_materials_sheen": {
                "sheenColorFactor": [0.25, 0.5, 1], "sheenColorTexture": half, "sheenRoughnessFactor": 0.75,
                "sheenRoughnessTexture": { "index": 0 },
            },
            "KHR_materials_transmission": { "transmissionFactor": 0.875, "transmissionTexture": { "index": 0 } },
            "KHR_materials_volume": {
                "thicknessFactor": 0.1, "attenuationDistance": 0.02, "attenuationColor": [0.5, 0.25, 1],
            },
        }),
        json!({}),
    );
    let material = &object.materials[0];
    let check = |scalar: &Scalar, factor: f32, channel: u8, encoding: Encoding, scale: [f32; 2]| {
        let (texture, at) = scalar.texture.as_ref().expect("a texture");
        assert_eq!((scalar.factor, *at, texture.texture.encoding), (factor, channel, encoding));
        assert_eq!(texture.transform.scale, scale);
    };
    let coat = material.clearcoat.as_ref().expect("clearcoat");
    check(&coat.strength, 0.5, 0, Encoding::Linear, [1.0; 2]);
    check(&coat.roughness, 0.25, 1, Encoding::Linear, [2.0, 3.0]);
    assert_eq!(coat.normal.as_ref().expect("a normal map").strength, 0.5);
    let sheen = material.sheen.as_ref().expect("sheen");
    assert_eq!(sheen.color.factor, [0.25, 0.5, 1.0]);
    let color = sheen.color.texture.as_ref().expect("a texture");
    assert_eq!((color.texture.encoding, color.transform.scale), (Encoding::Srgb, [2.0, 3.0]));
    check(&sheen.roughness, 0.75, 3, Encoding::Srgb, [1.0; 2]);
    let glass = material.transmission.as_ref().expect("glass");
    check(&glass.fraction, 0.875, 0, Encoding::Linear, [1.0; 2]);
    assert_eq!(glass.volume, Some(Volume { attenuation_color: [0.5, 0.25, 1.0], attenuation_distance_m: 0.02 }));
    assert_eq!(material.alpha, Alpha::Opaque);
}

/// Base color and metalness with the same reflectance as a diffuse and a specular color; metalness is found by
/// bisection.
fn metallic_roughness(diffuse: [f64; 3], specular: [f64; 3]) -> ([f64; 3], f64) {
    let brightness = |c: [f64; 3]| c.iter().zip([0.299, 0.587, 0.114]).map(|(x, w)| w * x * x).sum::<f64>().sqrt();
    let kept = diffuse.map(|x| x * (1.0 - specular.iter().fold(0.0, |max: f64, &x| max.max(x))) / 0.96);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let m: f64 = (low + high) / 2.0;
        let reflected = 0.04 * (1.0 - m) + m * brightness(kept) / (1.0 - m);
        (low, high) = if reflected < brightness(specular) { (m, high) } else { (low, m) };
    }
    let m = if brightness(specular) < 0.04 { 0.0 } else { low };
    let base = |i: usize| {
        let [from_diffuse, from_specular] = [kept[i] / (1.0 - m), (specular[i] - 0.04 * (1.0 - m)) / m];
        if m == 0.0 { from_diffuse } else { from_diffuse + (from_specular - from_diffuse) * m * m }
    };
    ([0, 1, 2].map(base).map(|x| x.clamp(0.0, 1.0)), m)
}

#[test]
fn specular_and_glossiness_become_metalness_and_roughness() {
    let name = "KHR_materials_pbrSpecularGlossiness";
    let plain = layered(
        &json!({ name: {
            "diffuseFactor": [0.5, 0.1, 0.2, 0.75], "specularFactor": [0.2, 0.25, 0.1], "glossinessFactor": 0.7,
        } }),
        json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
    );
    let material = &plain.materials[0];
    let (base, metallic) = metallic_roughness([0.5, 0.1, 0.2], [0.2, 0.25, 0.1]);
    assert!(material.base_color.texture.is_none() && (0.1..0.9).contains(&metallic), "{metallic}");
    let is_near = |got: f32, want: f64| (f64::from(got) - want).abs() < 1e-5;
    assert!(material.base_color.factor.iter().zip(base).all(|(&got, want)| is_near(got, want)), "{material:?}");
    assert!(is_near(material.metallic.factor, metallic) && is_near(material.roughness.factor, 0.3), "{material:?}");
    assert_eq!(material.alpha, Alpha::Blend { factor: 0.75 });

    // Paint, plastic and metal, next to dark and bright reflections with half as many texels.
    let diffuse =
        RgbaImage::from_fn(4, 2, |x, y| Rgba([60 * x as u8, 200 - 50 * x as u8, 90 * y as u8, 255 - 40 * x as u8]));
    let gloss = RgbaImage::from_fn(2, 2, |x, y| {
        Rgba([20 + 150 * x as u8, 10 + 160 * x as u8, 120 * y as u8, 60 + 90 * y as u8])
    });
    let uri = |image: &RgbaImage| {
        let png = encode(image.clone().into(), ImageFormat::Png);
        json!({ "uri": format!("data:image/png;base64,{}", base64(&png)) })
    };
    let document = |older: Value| {
        let mut builder = Builder::default();
        let (position, uv) = (builder.floats(&POSITIONS), builder.floats(&UVS));
        let index = builder.indices(FACES.as_flattened());
        let primitive =
            json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "indices": index, "material": 0 });
        builder.document(
            &primitive,
            json!({
                "extensionsUsed": [name], "extensionsRequired": [name], "images": [uri(&diffuse), uri(&gloss)],
                "textures": [{ "source": 0 }, { "source": 1 }], "materials": [{ "extensions": { name: older } }],
            }),
        )
    };
    let factors = json!({ "diffuseFactor": [0.5, 1, 1, 1], "specularFactor": [1, 0.5, 1], "glossinessFactor": 0.5 });
    let with = |textures: Value| {
        let mut older = factors.clone();
        older.as_object_mut().expect("a table").extend(textures.as_object().expect("a table").clone());
        document(older)
    };
    let decode = |code: u8| {
        let x = f64::from(code) / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    let textures = [("diffuseTexture", 0), ("specularGlossinessTexture", 1)];
    for used in [&textures[..], &textures[..1], &textures[1..]] {
        let infos: serde_json::Map<String, Value> =
            used.iter().map(|&(key, index)| (key.to_owned(), json!({ "index": index }))).collect();
        let object = object(&with(Value::Object(infos)));
        let material = &object.materials[0];
        let [has_diffuse, has_gloss] = [0, 1].map(|index| used.iter().any(|&(_, used)| used == index));
        let color = &material.base_color.texture.as_ref().expect("converted").texture;
        let (metallic, channel) = material.metallic.texture.as_ref().expect("converted");
        assert_eq!((color.width, color.height), if has_diffuse { (4, 2) } else { (2, 2) });
        assert_eq!((color.encoding, metallic.texture.encoding, *channel), (Encoding::Srgb, Encoding::Linear, 2));
        assert_eq!((material.base_color.factor, material.metallic.factor), ([1.0; 3], 1.0));
        let mut range = [1.0_f64, 0.0];
        for (i, (texel, rest)) in color.texels.chunks(4).zip(metallic.texture.texels.chunks(4)).enumerate() {
            let (x, y) = (i as u32 % color.width, i as u32 / color.width);
            let white = Rgba([255; 4]);
            let own = if has_diffuse { *diffuse.get_pixel(x, y) } else { white };
            let shine = if has_gloss { *gloss.get_pixel(x * 2 / color.width, y) } else { white };
            let [r, g, b] = [0, 1, 2].map(|k| decode(own[k]));
            let [sr, sg, sb] = [0, 1, 2].map(|k| decode(shine[k]));
            let (base, m) = metallic_roughness([0.5 * r, g, b], [sr, 0.5 * sg, sb]);
            for k in 0..3 {
                let (below, above) = (decode(texel[k].saturating_sub(1)), decode(texel[k].saturating_add(1)));
                assert!((below..=above).contains(&base[k]), "{used:?} {x} {y}: {texel:?}, not {base:?}");
            }
            assert!((f64::from(rest[2]) / 255.0 - m).abs() < 0.003, "{used:?} {x} {y}: metalness {}, not {m}", rest[2]);
            assert_eq!(texel[3], own[3]);
            let rough = 1.0 - 0.5 * f64::from(shine[3]) / 255.0;
            match &material.roughness.texture {
                Some((_, channel)) => assert!(*channel == 1 && (f64::from(rest[1]) / 255.0 - rough).abs() < 0.003),
                None => assert!(!has_gloss && is_near(material.roughness.factor, rough)),
            }
            range = [range[0].min(m), range[1].max(m)];
        }
        assert!(range[1] - range[0] > 0.2 || !has_gloss, "{used:?}: {range:?}");
    }

    // Textures with different transforms cause a warning.
    let folder = TempDir::new().expect("temp folder");
    let turned = json!({ "index": 1, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } });
    write(
        folder.path(),
        "x.gltf",
        with(json!({ "diffuseTexture": { "index": 0 }, "specularGlossinessTexture": turned })),
    );
    let log = Collected::default();
    source_of("mesh_folder", folder.path(), "").load("x", &log).expect("sound");
    assert!(
        log.merged().iter().any(|warning| warning.to_string().contains("have different transforms")),
        "{:?}",
        log.merged()
    );
}

#[test]
fn thin_walls_and_layers_of_nothing() {
    let glass = json!({ "transmissionFactor": 1.0 });
    for (volume, want) in [
        (json!({ "thicknessFactor": 0.0, "attenuationDistance": 1.0 }), None),
        (json!({ "attenuationDistance": 1.0 }), None),
        (json!({ "thicknessFactor": 2.0 }), Some(f32::INFINITY)),
    ] {
        let with = layered(&json!({ "KHR_materials_transmission": glass, "KHR_materials_volume": volume }), json!({}));
        let got = with.materials[0].transmission.as_ref().expect("glass").volume;
        assert_eq!(got.map(|volume| volume.attenuation_distance_m), want, "{volume}");
    }
    let none = layered(
        &json!({
            "KHR_materials_clearcoat": { "clearcoatRoughnessFactor": 0.5 }, "KHR_materials_sheen": {},
            "KHR_materials_transmission": {}, "KHR_materials_volume": { "thicknessFactor": 1.0 },
        }),
        json!({}),
    );
    let material = &none.materials[0];
    assert!(material.clearcoat.is_none() && material.sheen.is_none() && material.transmission.is_none());
    assert_eq!(material.digest, layered(&json!({}), json!({})).materials[0].digest);
}

#[test]
fn blended_alpha() {
    let alpha = |factor: f32, texture: bool| {
        let mut base = json!({ "baseColorFactor": [1, 1, 1, factor] });
        if texture {
            base["baseColorTexture"] = json!({ "index": 0 });
        }
        layered(&json!({}), json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": base })).materials[0].alpha
    };
    assert_eq!(alpha(0.75, false), Alpha::Blend { factor: 0.75 });
    assert_eq!(alpha(0.75, true), Alpha::Blend { factor: 0.75 });
    // The image has no alpha, so the material is opaque.
    assert_eq!([alpha(1.0, false), alpha(1.0, true)], [Alpha::Opaque; 2]);
}

#[test]
fn wrong_extensions_are_named() {
    let folder = TempDir::new().expect("temp folder");
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    let primitive = json!({ "attributes": { "POSITION": position }, "indices": index, "material": 0 });
    let sheen = json!({ "sheenColorFactor": [1, 2] });
    let text =
        builder.document(&primitive, json!({ "materials": [{ "extensions": { "KHR_materials_sheen": sheen } }] }));
    write(folder.path(), "x.gltf", text);
    let source = source_of("mesh_folder", folder.path(), "");
    let error = source.load("x", &Collected::default()).expect_err("two numbers").to_string();
    assert!(error.contains("x.gltf: ") && error.contains("KHR_materials_sheen: invalid length 2"), "{error}");
}

#[test]
fn obj_transparency() {
    let load_with = |statements: &str| {
        let folder = TempDir::new().expect("temp folder");
        let faces = FACES.map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)).concat();
        let vertices = POSITIONS.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
        write(folder.path(), "x.obj", format!("mtllib x.mtl\nusemtl a\n{vertices}{faces}"));
        write(folder.path(), "x.mtl", format!("newmtl a\n{statements}\n"));
        let log = Collected::default();
        let asset = source_of("mesh_folder", folder.path(), "").load("x", &log).expect("loads");
        (asset.into_object().expect("an object").materials[0].alpha, log.warnings().len())
    };
    for (statements, alpha, warnings) in [
        ("d 1\nTr 0", Alpha::Opaque, 0),
        ("d 0.25", Alpha::Blend { factor: 0.25 }, 1),
        ("Tr 0.75", Alpha::Blend { factor: 0.25 }, 1),
        ("d 0.5", Alpha::Blend { factor: 0.5 }, 0),
        // Files of programs that write the opacity as `Tr`.
        ("d 1\nTr 1", Alpha::Opaque, 0),
        ("Tr 1", Alpha::Opaque, 1),
        ("d 0", Alpha::Opaque, 1),
    ] {
        assert_eq!(load_with(statements), (alpha, warnings), "{statements}");
    }
}

#[test]
fn a_texture_without_coordinates_becomes_its_mean() {
    let mut builder = Builder::default();
    let (position, index) = (builder.floats(&POSITIONS), builder.indices(FACES.as_flattened()));
    let primitive = json!({ "attributes": { "POSITION": position }, "indices": index, "material": 0 });
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "x.gltf", builder.document(&primitive, textured()));
    let log = Collected::default();
    let object =
        source_of("mesh_folder", folder.path(), "").load("x", &log).expect("loads").into_object().expect("one");
    assert!(log.warnings()[0].to_string().contains("4 faces have no texture coordinates"), "{:?}", log.warnings());
    let color = &object.materials[0].base_color;
    assert!(color.texture.is_none() && color.factor[0] > 0.05 && color.factor[2] < 0.01, "{color:?}");
}

#[test]
fn obj_materials_and_colors() {
    let folder = TempDir::new().expect("temp folder");
    let colored = |white: f32| {
        let gray = 0.5 * white;
        let vertex = |[x, y, z]: [f32; 3]| format!("v {x} {y} {z} {white} {gray} 0\n");
        let faces = FACES.map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
        let [f0, f1, f2, f3] = faces;
        POSITIONS.map(vertex).concat()
            + "mtllib x.mtl\n"
            + &f0
            + "usemtl rough\n"
            + &f1
            + "usemtl shiny\n"
            + &f2
            + "usemtl rough\n"
            + &f3
    };
    write(
        folder.path(),
        "x.mtl",
        "newmtl shiny\nKd 0.1 0.2 0.3\nNs 60\nKe 1 0 0\nNi 1.4\nnewmtl rough\nPr 0.9\nPm 0.5\n",
    );
    for white in [1.0, 255.0] {
        write(folder.path(), "x.obj", colored(white));
        let object = load(folder.path(), "x");
        // sRGB 0.5 is 0.214 in linear light.
        let [r, g, b] = object.mesh.data().colors[0];
        assert!((r - 1.0).abs() < 1e-6 && (g - 0.214_04).abs() < 1e-4 && b == 0.0, "{r} {g} {b}");
        assert_eq!(object.mesh.data().slots, [0, 1, 2, 1]);
        let names: Vec<&str> = object.materials.iter().map(|material| material.name.as_str()).collect();
        assert_eq!(names, ["default", "rough", "shiny"]);
        let shiny = &object.materials[2];
        assert_eq!(
            (shiny.base_color.factor, shiny.emission.factor, shiny.ior),
            ([0.1, 0.2, 0.3], [1.0, 0.0, 0.0], 1.4)
        );
        // Exponent 60: α² = 2/62, roughness = √α.
        assert!((shiny.roughness.factor - (2.0_f32 / 62.0).powf(0.25)).abs() < 1e-6);
        assert_eq!((object.materials[1].roughness.factor, object.materials[1].metallic.factor), (0.9, 0.5));
    }
}

#[test]
fn concave_faces_are_cut_right() {
    // A prism over an L: the volume shows whether the caps were triangulated inside the outline.
    let outline = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0.0, 0.2]];
    let mut text = String::new();
    for z in [0.0, 0.1] {
        outline.iter().for_each(|[x, y]| text += &format!("v {x} {y} {z}\n"));
    }
    text += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n";
    (0..6).for_each(|i| text += &format!("f {} {} {} {}\n", i + 1, (i + 1) % 6 + 1, (i + 1) % 6 + 7, i + 7));
    let folder = TempDir::new().expect("temp folder");
    write(folder.path(), "x.obj", text);
    let object = load(folder.path(), "x");
    assert!((object.mesh.signed_volume() - 0.003).abs() < 1e-8);
    // The area of both caps and of the six walls: triangles outside the outline would make it larger.
    assert!((object.mesh.area() - (2.0 * 0.03 + 0.8 * 0.1)).abs() < 1e-7, "{}", object.mesh.area());
}

#[test]
fn ply_texture_coordinates() {
    let folder = TempDir::new().expect("temp folder");
    let file = |vertex: &str, row: &dyn Fn(usize) -> String, face: &str, tail: &dyn Fn(usize) -> String| {
        let mut text = format!(
            "ply\nformat ascii 1.0\ncomment TextureFile my image.png\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{vertex}element face 4\nproperty list uchar uint vertex_index\n{face}end_header\n"
        );
        POSITIONS.iter().enumerate().for_each(|(i, [x, y, z])| text += &format!("{x} {y} {z} {}\n", row(i)));
        FACES.iter().enumerate().for_each(|(i, [a, b, c])| text += &format!("3 {a} {b} {c} {}\n", tail(i)));
        write(folder.path(), "x.ply", text);
        load(folder.path(), "x")
    };
    let png = encode(RgbImage::new(4, 4).into(), ImageFormat::Png);
    write(folder.path(), "my image.png", png);
    let per_vertex =
        "property float s\nproperty float t\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
    let object = file(per_vertex, &|i| format!("{} {} 255 255 255", UVS[i][0], UVS[i][1]), "", &|_| String::new());
    assert_eq!(object.mesh.data().uvs, UVS);
    assert!(object.materials[0].base_color.texture.is_some());

    // Coordinates by corner: the same where they agree, split where they do not.
    let per_face = "property list uchar float texcoord\n";
    let agreeing = |face: usize| {
        format!(
            "6 {}",
            FACES[face]
                .map(|i| UVS[i as usize])
                .as_flattened()
                .iter()
                .map(f32::to_string)
                .collect::<Vec<_>>()
                .join(" ")
        )
    };
    let object = file("", &|_| String::new(), per_face, &agreeing);
    assert_eq!(object.mesh.data().positions.len(), 4);
    let apart = |face: usize| format!("6 {}", [face as f32 * 0.1; 6].map(|x| x.to_string()).join(" "));
    let object = file("", &|_| String::new(), per_face, &apart);
    assert_eq!((object.mesh.data().positions.len(), object.mesh.data().uvs[5]), (12, [0.1, 0.1]));
    assert!((object.mesh.signed_volume() - 0.001 / 6.0).abs() < 1e-9);
}

#[test]
fn one_image_is_shared_by_all_slots() {
    let folder = TempDir::new().expect("temp folder");
    let vertices = POSITIONS.map(|[x, y, z]| format!("v {x} {y} {z}\nvt {x} {y}\n")).concat();
    let faces: String = FACES
        .iter()
        .zip(["m", "a", "a", "m"])
        .map(|([a, b, c], name)| format!("usemtl {name}\nf {0}/{0} {1}/{1} {2}/{2}\n", a + 1, b + 1, c + 1))
        .collect();
    write(folder.path(), "x.obj", format!("mtllib x.mtl\n{vertices}{faces}"));
    write(folder.path(), "x.mtl", "newmtl m\nmap_Kd p.png\nnewmtl a\nKd 1 0 0\nmap_Kd p.png\n");
    write(folder.path(), "p.png", encode(RgbImage::new(4, 4).into(), ImageFormat::Png));
    let object = load(folder.path(), "x");
    assert_eq!(object.materials.len(), 2, "{:?}", object.materials);
    let [a, b] =
        [0, 1].map(|slot| object.materials[slot].base_color.texture.as_ref().expect("a texture").texture.clone());
    assert!(std::sync::Arc::ptr_eq(&a, &b));
}

#[test]
fn metadata_gives_the_category() {
    let folder = TempDir::new().expect("temp folder");
    let mesh = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    for name in ["a", "b"] {
        write(&folder.path().join(name), "meshes/model.obj", mesh);
    }
    write(&folder.path().join("a"), "metadata.pbtxt", "name: \"a\"\ncategories {\n  first: \"Shoe\"\n}\n");
    let source = source_of("google_scanned_objects", folder.path(), "");
    let catalog = source.catalog(&Collected::default()).expect("a catalog");
    let categories: Vec<&str> = catalog.entries.iter().map(|entry| entry.category.as_str()).collect();
    assert_eq!(categories, ["Shoe", "google_scanned_objects"]);
    let object = source.load("a", &Collected::default()).expect("loads").into_object().expect("an object");
    assert_eq!((object.category.as_str(), object.license.as_str(), object.name.as_str()), ("Shoe", "CC-BY-4.0", "a"));
}
