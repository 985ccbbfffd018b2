//! EXR files, read back by the `exr` crate and by OpenEXR itself.

use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, f16};
use std::path::Path;
use std::sync::OnceLock;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, NORMAL, RADIANCE};
use syntable_testing::takes::{Crowd, Take, dataset, take, write_scenes, writer};
use syntable_testing::tools::{own_script, python_with};
use syntable_write as _;

/// Float images of a plugin that the writers do not know.
const HEAT: Key<Plane<f32>> = Key::view("heat", "Temperature at the pixel center.");
const FLOW: Key<Plane<[f32; 2]>> = Key::view("flow", "Motion of the surface point.");
const LAYERS: Key<Plane<[f32; 4]>> = Key::view("layers", "Four numbers per pixel.");
const THICKNESS: Key<PerInstance<Value>> = Key::view("thickness", "Thickness of each object along the ray.");

/// A view with all of these products, filled with random bit patterns, including infinities, NaN and subnormal numbers.
fn foreign() -> Take {
    let mut take = take(0, 3, &[Crowd::Random]);
    let (view, mut products) = take.views.remove(0);
    let mut stream = Stream::root(4);
    let mut number = || f32::from_bits(stream.below(1 << 32) as u32);
    products.put(HEAT, Plane::from_fn(64, 48, |_, _| number())).expect("first");
    products.put(FLOW, Plane::from_fn(64, 48, |_, _| [number(), number()])).expect("first");
    products.put(LAYERS, Plane::from_fn(64, 48, |x, y| [number(), x as f32, y as f32, -0.0])).expect("first");
    let each = [3, 12].map(|id| (InstanceId(id), Product::encode(&Plane::from_fn(64, 48, |_, _| number()))));
    products.put(THICKNESS, each.into_iter().collect()).expect("first");
    take.views.push((view, products));
    take
}

use syntable_model::product::Product;

fn write(folder: &Path, kind: &str, options: &str) -> Take {
    let take = foreign();
    let writer = writer(kind, options).expect("good options");
    write_scenes(folder, kind, &*writer, &dataset(1, 1), [&take]).expect("written");
    take
}

/// Names and samples of a file's channels, in the order of the names.
fn channels(path: &Path) -> Vec<(String, FlatSamples)> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .expect("an EXR file");
    assert_eq!((image.layer_data.size.0, image.layer_data.size.1), (64, 48));
    let list = image.layer_data.channel_data.list;
    list.into_iter().map(|channel| (channel.name.to_string(), channel.sample_data)).collect()
}

/// The bits of one channel of a plane.
fn bits<const N: usize>(plane: &Plane<[f32; N]>, channel: usize) -> Vec<u32> {
    plane.data().iter().map(|pixel| pixel[channel].to_bits()).collect()
}

fn check(path: &Path, want: &[(&str, Vec<u32>)]) {
    let got = channels(path);
    let names: Vec<&str> = got.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, want.iter().map(|(name, _)| *name).collect::<Vec<_>>(), "{}", path.display());
    for ((name, samples), (_, want)) in got.iter().zip(want) {
        let FlatSamples::F32(samples) = samples else { panic!("{name} is not f32") };
        assert!(samples.iter().map(|x| x.to_bits()).eq(want.iter().copied()), "{} {name}", path.display());
    }
}

const INCLUDE: &str = "include = [\"radiance\", \"depth\", \"normal\", \"heat\", \"flow\", \"layers\", \"thickness\"]";

#[test]
fn every_float_image_is_kept_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = write(folder.path(), "exr", INCLUDE);
    let products = &take.views[0].1;
    let path = |product: &str, end: &str| folder.path().join(format!("exr/{product}/000000_0000{end}.exr"));
    let one = |plane: &Plane<f32>| plane.data().iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
    let radiance = products.get(RADIANCE).expect("made");
    check(&path("radiance", ""), &[("B", bits(radiance, 2)), ("G", bits(radiance, 1)), ("R", bits(radiance, 0))]);
    check(&path("depth", ""), &[("Z", one(products.get(DEPTH).expect("made")))]);
    let normal = products.get(NORMAL).expect("made");
    check(&path("normal", ""), &[("X", bits(normal, 0)), ("Y", bits(normal, 1)), ("Z", bits(normal, 2))]);
    check(&path("heat", ""), &[("Y", one(products.get(HEAT).expect("made")))]);
    let flow = products.get(FLOW).expect("made");
    check(&path("flow", ""), &[("X", bits(flow, 0)), ("Y", bits(flow, 1))]);
    let layers = products.get(LAYERS).expect("made");
    let order = [("A", 3), ("B", 2), ("G", 1), ("R", 0)];
    check(&path("layers", ""), &order.map(|(name, channel)| (name, bits(layers, channel))));
    for (id, value) in products.get(THICKNESS).expect("made").iter() {
        let Value::Tensor(tensor) = value else { panic!("an image") };
        let want = tensor.bytes.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().expect("four bytes")));
        check(&path("thickness", &format!("_{:04}", id.0)), &[("Y", want.collect())]);
    }
}

#[test]
fn layers_are_the_images_of_a_view() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = write(folder.path(), "exr", &format!("{INCLUDE}\nlayers = true"));
    let products = &take.views[0].1;
    let one = |plane: &Plane<f32>| plane.data().iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
    let radiance = products.get(RADIANCE).expect("made");
    let (normal, flow) = (products.get(NORMAL).expect("made"), products.get(FLOW).expect("made"));
    let layers = products.get(LAYERS).expect("made");
    let mut want = vec![
        ("B".to_owned(), bits(radiance, 2)),
        ("G".to_owned(), bits(radiance, 1)),
        ("R".to_owned(), bits(radiance, 0)),
        ("depth.Z".to_owned(), one(products.get(DEPTH).expect("made"))),
        ("flow.X".to_owned(), bits(flow, 0)),
        ("flow.Y".to_owned(), bits(flow, 1)),
        ("heat.Y".to_owned(), one(products.get(HEAT).expect("made"))),
    ];
    let rgba = [("A", 3), ("B", 2), ("G", 1), ("R", 0)];
    want.extend(rgba.map(|(name, channel)| (format!("layers.{name}"), bits(layers, channel))));
    want.extend([("X", 0), ("Y", 1), ("Z", 2)].map(|(name, i)| (format!("normal.{name}"), bits(normal, i))));
    for (id, value) in products.get(THICKNESS).expect("made").iter() {
        let Value::Tensor(tensor) = value else { panic!("an image") };
        let numbers = tensor.bytes.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().expect("four bytes")));
        want.push((format!("thickness_{:04}.Y", id.0), numbers.collect()));
    }
    let want: Vec<(&str, Vec<u32>)> = want.iter().map(|(name, bits)| (name.as_str(), bits.clone())).collect();
    let path = folder.path().join("exr/000000_0000.exr");
    check(&path, &want);
    assert_eq!(syntable_testing::takes::files(folder.path()).len(), 1, "one file per view");
    let header = exr::meta::MetaData::read_from_file(path, true).expect("an EXR file").headers.remove(0);
    let unit = |name: &str| format!("{:?}", header.own_attributes.other.get(name.as_bytes()));
    assert!(unit("depth.unit").contains('m') && unit("unit").contains("nit") && unit("heat.unit") == "None");
    assert!(header.shared_attributes.chromaticities.is_some());
}

#[test]
fn layers_have_one_size() {
    const SMALL: Key<Plane<f32>> = Key::view("small", "An image of another size.");
    let mut take = foreign();
    take.views[0].1.put(SMALL, Plane::from_fn(32, 48, |_, _| 0.5)).expect("first");
    let folder = tempfile::tempdir().expect("a folder");
    let writer = writer("exr", "include = [\"depth\", \"small\"]\nlayers = true").expect("good options");
    let error = write_scenes(folder.path(), "exr", &*writer, &dataset(1, 1), [&take]).expect_err("refused");
    assert!(error.is_permanent() && error.to_string().contains("layer `small` is 32 × 48, not 64 × 48"), "{error}");
}

#[test]
fn half_rounds_to_16_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = write(folder.path(), "exr", "include = [\"radiance\"]\nhalf = true");
    let radiance = take.views[0].1.get(RADIANCE).expect("made");
    let got = channels(&folder.path().join("exr/radiance/000000_0000.exr"));
    for ((name, samples), channel) in got.iter().zip([2, 1, 0]) {
        let FlatSamples::F16(samples) = samples else { panic!("{name} is not f16") };
        for (got, pixel) in samples.iter().zip(radiance.data()) {
            let want = pixel[channel];
            let close = if want.abs() >= 65_520.0 {
                f32::from(*got) == f32::INFINITY.copysign(want)
            } else {
                // 11 significant bits, or steps of 2^-24 near zero.
                (f32::from(*got) - want).abs() <= (want.abs() / 2048.0).max(2.0_f32.powi(-25))
            };
            assert!(close, "{name}: {got} for {want}");
        }
    }
    assert!(got[0].1.values_as_f32().all(f32::is_infinite), "10⁹ is beyond the range");
    assert_eq!(f32::from(f16::MAX), 65_504.0);
}

#[test]
fn the_header_states_color_space_and_unit() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "exr", INCLUDE);
    let meta = |product: &str| {
        let path = folder.path().join(format!("exr/{product}/000000_0000.exr"));
        exr::meta::MetaData::read_from_file(path, true).expect("an EXR file").headers.remove(0)
    };
    let radiance = meta("radiance");
    assert_eq!(radiance.own_attributes.white_luminance, Some(1.0));
    let primaries = radiance.shared_attributes.chromaticities.expect("stated");
    assert_eq!((primaries.red.0, primaries.white.1), (0.64, 0.329));
    let unit = |header: exr::meta::header::Header| header.own_attributes.other.get("unit".as_bytes()).cloned();
    assert!(format!("{:?}", unit(meta("depth"))).contains('m'));
    assert!(meta("depth").shared_attributes.chromaticities.is_none() && unit(meta("heat")).is_none());
}

#[test]
fn openexr_reads_the_same_values() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "exr", INCLUDE);
    write(folder.path(), "npy", INCLUDE);
    let layers = folder.path().join("layers");
    write(&layers, "exr", &format!("{INCLUDE}\nlayers = true"));
    python_with("numpy, OpenEXR", &HERE, &own_script("check_exr.py"), &[folder.path().to_str().expect("UTF-8")]);
}
