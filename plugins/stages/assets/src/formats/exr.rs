//! OpenEXR environment maps, through the `exr` crate, with sizes checked before it allocates.

use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Text, Vec2, read};
use std::io::Cursor;
use syntable_mesh::environment::MAX_SIDE;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_mesh::limits::Budget;
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};
use syntable_model::scene::EnvironmentMap;

/// First bytes of every OpenEXR file.
pub const MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Decodes a file in memory: the first layer with R, G and B, or with Y alone. Other channels are not unpacked.
pub fn decode(bytes: &[u8], budget: &Budget) -> Result<EnvironmentMap> {
    let broken = |error: exr::error::Error| Error::new(format!("not a valid OpenEXR: {error}"));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        // The file stores an offset of eight bytes for every chunk.
        if header.chunk_count > bytes.len() / 8 {
            return Err(Error::new(format!("{} chunks do not fit into {} bytes", header.chunk_count, bytes.len())));
        }
    }
    let mut layers = meta.headers.iter().map(|header| (header, color_channels(header)));
    let Some((_, Ok(channels))) = layers.find(|(_, channels)| channels.is_ok()) else {
        let none = || Error::new("not a valid OpenEXR: the file has no layer");
        return Err(meta.headers.first().and_then(|first| color_channels(first).err()).unwrap_or_else(none));
    };
    if let Some(size) = meta.headers.iter().map(|header| header.layer_size).max_by_key(|size| size.area()) {
        budget.image(size.width() as u64, size.height() as u64, MAX_SIDE)?;
    }
    let [r, g, b] = channels;
    // A gray map has one channel, which is unpacked once.
    let gray = r == g;
    let image = if gray {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels()
            .required(r)
            .collect_pixels(
                |size, _| (size.width(), vec![[0.0; 3]; size.area()]),
                |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (y,): (f32,)| {
                    texels[at.y() * *width + at.x()] = [y; 3];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map(|image| image.layer_data.channel_data.pixels)
    } else {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels()
            .required(r)
            .required(g)
            .required(b)
            .collect_pixels(
                |size, _| (size.width(), vec![[0.0; 3]; size.area()]),
                |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                    texels[at.y() * *width + at.x()] = [r, g, b];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map(|image| image.layer_data.channel_data.pixels)
    };
    let (width, texels) = image.map_err(broken)?;
    if width == 0 || texels.len() % width != 0 {
        return Err(Error::new("not a valid OpenEXR: its layer has no pixels"));
    }
    let height = texels.len() / width;
    EnvironmentMap::new("", width as u32, height as u32, texels)
}

/// The names of the channels of color of a layer, as it spells them.
fn color_channels(header: &Header) -> Result<[Text; 3]> {
    let list = &header.channels.list;
    let find = |name: &str| list.iter().find(|channel| channel.name.eq_case_insensitive(name));
    let found = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) => [y; 3],
        _ => {
            let names: Vec<String> = list.iter().take(8).map(|channel| shorten(&channel.name.to_string())).collect();
            let more = if list.len() > names.len() { " and more" } else { "" };
            return Err(Error::new(format!("channels {}{more} are not colors", names.join(", ")))
                .help("save the map with channels R, G and B, or Y alone"));
        }
    };
    for channel in list {
        // Subsampled channels (luminance and chroma) have fewer samples; rows that hold one are not unpacked.
        if channel.sampling != Vec2(1, 1) {
            let name = shorten(&channel.name.to_string());
            return Err(
                Error::new(format!("channel {name} is subsampled, which is not supported")).help("save the map as RGB")
            );
        }
    }
    Ok(found.map(|channel| channel.name.clone()))
}

syntable_mesh::register_image_format!(
    ImageFormat::new("OpenEXR", &["exr"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Radiance(decode))
        .with_preference(20)
);
