//! OpenEXR environment maps, through the `exr` crate, with sizes checked before it allocates.

use exr::image::{AnyChannels, FlatSamples};
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read};
use std::io::Cursor;
use syntable_mesh::environment::check_size;
use syntable_mesh::format::{ImageDecoder, ImageFormat};
use syntable_model::error::{Error, Result};
use syntable_model::scene::EnvironmentMap;

/// First bytes of every OpenEXR file.
pub const MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Maximum number of channels of a layer, such as depth besides R, G, B and A.
const MAX_CHANNELS: usize = 32;

/// Decodes a file in memory: the first layer with R, G and B, or with Y alone.
pub fn decode(bytes: &[u8]) -> Result<EnvironmentMap> {
    let broken = |error: exr::error::Error| Error::new(format!("not a sound OpenEXR: {error}"));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
        let channels = header.channels.list.len();
        if channels > MAX_CHANNELS {
            return Err(Error::new(format!("{channels} channels are more than {MAX_CHANNELS}")));
        }
        // The file stores an offset of eight bytes for every chunk.
        if header.chunk_count > bytes.len() / 8 {
            return Err(Error::new(format!(
                "{} chunks are more than {} bytes can hold",
                header.chunk_count,
                bytes.len()
            )));
        }
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let planes = color_planes(&layer.channel_data, width * height)?;
    let texels = (0..width * height).map(|i| planes.map(|plane| sample(plane, i))).collect();
    EnvironmentMap::new("", width as u32, height as u32, texels)
}

fn color_planes(channels: &AnyChannels<FlatSamples>, texels: usize) -> Result<[&FlatSamples; 3]> {
    let find = |name: &str| channels.list.iter().find(|channel| channel.name.eq_case_insensitive(name));
    let found = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) => [y; 3],
        _ => {
            let names: Vec<String> = channels.list.iter().map(|channel| channel.name.to_string()).collect();
            return Err(Error::new(format!("channels {} hold no color", names.join(", ")))
                .help("a map has R, G and B, or Y alone"));
        }
    };
    for channel in found {
        // Subsampled channels (luminance and chroma) have fewer samples.
        if channel.sample_data.len() != texels {
            return Err(Error::new(format!("channel {} is subsampled, which is not read", channel.name))
                .help("save the map as RGB"));
        }
    }
    Ok(found.map(|channel| &channel.sample_data))
}

fn sample(plane: &FlatSamples, index: usize) -> f32 {
    match plane {
        FlatSamples::F16(values) => values[index].to_f32(),
        FlatSamples::F32(values) => values[index],
        FlatSamples::U32(values) => values[index] as f32,
    }
}

syntable_mesh::register_image_format!(
    ImageFormat::new("OpenEXR", &["exr"], |bytes| bytes.starts_with(MAGIC), ImageDecoder::Radiance(decode))
        .with_preference(20)
);
