/// The recipe of the crate with changes, and with additional products that no writer needs.
fn recipe(products: &[&str], changes: &[(&str, &str)]) -> syntable::Recipe {
    use syntable::recipe::{Overrides, Source, load};
    let registry = syntable::Registry::linked().expect("no clash");
    let source = Source { name: "recipe.toml".into(), path: None, text: RECIPE.into() };
    let changes = changes.iter().map(|(key, value)| (String::from(*key), String::from(*value)));
    let mut overrides = Overrides::of_process(changes.collect()).for_run();
    overrides.wanted = products.iter().map(|name| syntable::model::stage::Input::named(*name)).collect();
    match load(&registry, source, &overrides) {
        Ok((recipe, _)) => recipe,
        Err(report) => panic!("{report}"),
    }
}

/// The views of the recipe with these changes, each with these products.
fn samples(products: &[&str], changes: &[(&str, &str)]) -> Vec<syntable::Sample> {
    let names = products.iter().map(|name| String::from(*name)).collect();
    let options = syntable::GenerateOptions { products: names, ..Default::default() };
    let mut samples = Vec::new();
    let made = syntable::generate(&recipe(products, changes), &options, &syntable::Quiet, &mut |sample| {
        samples.push(sample);
        Ok(())
    });
    assert_eq!(made.expect("a run").failed, Vec::<u32>::new());
    samples
}
