//! Open Image Denoise, on machines that have it.

mod common;

use common::{Room, denoise};
use syntable_denoise as _;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DENOISER, RADIANCE, RADIANCE_NOISY};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_testing::workers::Threads;

fn denoiser(options: &str) -> Box<dyn Denoiser> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Denoise, "oidn").expect("registered");
    match entry.construct_str(options).unwrap_or_else(|error| panic!("{error:?}")).stage {
        Stage::Denoise(denoiser) => denoiser,
        _ => unreachable!("the slot is that of denoisers"),
    }
}

#[test]
fn a_missing_or_wrong_library_is_named_with_a_way_out() {
    let products = Room::new(8, 8).render(1, 1);
    for library in ["/nowhere/libOpenImageDenoise.so.2", file!()] {
        let denoiser = denoiser(&format!("library = {library:?}"));
        let before = denoiser.ready().expect_err("no library");
        let error = denoise(&*denoiser, &products, &Threads(1)).map(drop).expect_err("no library");
        assert_eq!(before, error, "known before anything is rendered");
        assert_eq!(error.file().expect("named").to_string_lossy(), library);
        assert!(error.help_text().expect("known").contains("pip install pyoidn"), "{error}");
    }
}

#[test]
fn it_denoises_with_the_library_of_the_user() {
    let Ok(library) = std::env::var("SYNTABLE_OIDN") else {
        return syntable_testing::tools::skip("the path of Open Image Denoise in SYNTABLE_OIDN");
    };
    let room = Room::new(97, 71);
    let (products, reference) = (room.render(4, 1), room.render(512, 2));
    let error = |image: &Plane<[f32; 3]>| {
        let pairs =
            image.data().iter().flatten().zip(reference.get(RADIANCE_NOISY).expect("put").data().iter().flatten());
        pairs.map(|(a, r)| f64::from((a - r).powi(2) / (r * r + 1.0))).sum::<f64>()
    };
    let options = format!("library = {library:?}\nquality = \"fast\"\nclean_guides = false");
    let stage = denoiser(&options);
    stage.ready().expect("the library is there");
    let first = denoise(&*stage, &products, &Threads(2)).expect("denoises");
    let second = denoise(&*stage, &products, &Threads(2)).expect("denoises again");
    let image = |products: &Products| products.get(RADIANCE).expect("provided").clone();
    assert_eq!(image(&first), image(&second), "the same image twice");
    let alone = denoise(&*denoiser(&options), &products, &Threads(1)).expect("denoises");
    assert_eq!(image(&first), image(&alone), "the same image on one thread");
    let (before, after) = (error(products.get(RADIANCE_NOISY).expect("put")), error(&image(&first)));
    assert!(after < 0.4 * before, "{before} became {after}");
    let Ok(Value::Record(report)) = first.value(DENOISER.name()) else { panic!("a record") };
    assert_eq!(report[0], ("name".to_owned(), "oidn".into()));
    let (name, Value::Text(version)) = &report[1] else { panic!("a version") };
    assert!(name == "version" && version.split('.').count() == 3, "{name} {version}");
}
