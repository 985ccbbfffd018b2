// The stock renderer sees the same bodies at the same depths.

use first_hit as _;
use syntable::model::product::standard::{DEPTH, INSTANCE};

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn the_stock_renderer_agrees() {
    let samples_by = |kind: &str| samples(&["depth", "instance"], &[("render.kind", kind)]);
    let (own, stock) = (samples_by("\"first_hit\""), samples_by("\"cpu_path\""));
    assert_eq!((own.len(), stock.len()), (1, 1));
    let [own_ids, stock_ids] = [&own, &stock].map(|of| of[0].products.get(INSTANCE).expect("rendered"));
    let [own, stock] = [&own, &stock].map(|of| of[0].products.get(DEPTH).expect("rendered"));
    // A ray along the edge of two triangles may meet either of them, or pass between them.
    let pixels = own.data().len();
    let same_id = own_ids.data().iter().zip(stock_ids.data()).filter(|(a, b)| a == b).count();
    let same_depth = own.data().iter().zip(stock.data()).filter(|(a, b)| a == b || (*a - *b).abs() < 1e-4).count();
    assert!(same_id + 10 >= pixels && same_depth + 10 >= pixels, "{same_id}, {same_depth} of {pixels}");
    assert!(stock_ids.data().iter().any(|id| id.0 == 1), "an object is in the image");
}
