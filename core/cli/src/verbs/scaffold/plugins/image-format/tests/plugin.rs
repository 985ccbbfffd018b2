// The program decodes the format by its first bytes, and refuses damaged files.

use plain_ppm as _;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::limits::Budget;

#[test]
fn pixels_match_the_file() {
    let decode = |text: &str| DecodedImage::decode(text.as_bytes(), &Budget::default());
    let image = decode(include_str!("../sample.ppm")).expect("sound");
    assert_eq!((image.width, image.height), (2, 2));
    assert_eq!(image.texels[..8], [200, 30, 30, 255, 30, 200, 30, 255]);
    assert_eq!(image.texels[12..], [120, 120, 120, 255]);
    for damaged in
        ["P3 2 2 255 1 2 3", "P3 1 1 255 1 2 300", "P3 1 1 65535 1 2 3", "P3 1 x", "P3 4000000000 4000000000 255"]
    {
        assert!(decode(damaged).is_err(), "{damaged}");
    }
}
