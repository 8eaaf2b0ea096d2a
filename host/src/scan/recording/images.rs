//! Frames as PNG.

use std::fs::File;
use std::io::{BufReader, BufWriter, ErrorKind, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use image::{ColorType, ExtendedColorType, GrayImage, ImageDecoder, ImageEncoder};

use super::error::RecordingError;

/// Reads an image of 8-bit grey and of the given size; `None` when there is no such file.
pub(super) fn read_png(path: &Path, size_px: [u32; 2]) -> Result<Option<GrayImage>, RecordingError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(source) if source.kind() == ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(RecordingError::System { path: path.to_owned(), source }),
    };
    let wrong = |message: String| RecordingError::Image { path: path.to_owned(), message };
    let damaged = |error: image::ImageError| {
        // One line, whatever the decoder has to say.
        wrong(format!("damaged: {}", error.to_string().replace('\n', " ")))
    };
    let decoder = PngDecoder::new(BufReader::new(file)).map_err(damaged)?;
    // Before anything is allocated.
    let (width, height) = decoder.dimensions();
    if [width, height] != size_px {
        let [w, h] = size_px;
        return Err(wrong(format!("{width} x {height} pixels, scan.toml says {w} x {h}")));
    }
    if decoder.color_type() != ColorType::L8 {
        return Err(wrong(format!("{:?} pixels, 8-bit grey is wanted", decoder.color_type())));
    }
    let mut pixels = vec![0; width as usize * height as usize];
    decoder.read_image(&mut pixels).map_err(damaged)?;
    Ok(GrayImage::from_raw(width, height, pixels))
}

/// Writes an image without loss; little effort is spent on noise, which nothing compresses.
pub(super) fn write_png(path: &Path, image: &GrayImage) -> Result<(), RecordingError> {
    let system = |source| RecordingError::System { path: path.to_owned(), source };
    let mut file = BufWriter::new(File::create(path).map_err(system)?);
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::NoFilter)
        .write_image(image.as_raw(), image.width(), image.height(), ExtendedColorType::L8)
        .map_err(|error| system(std::io::Error::other(error)))?;
    file.flush().map_err(system)
}
