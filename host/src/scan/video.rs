//! Cameras that Linux knows (V4L2), behind the feature `v4l2`.
//!
//! A camera of the scanner delivers 8-bit grey, or YUYV, of which the brightness is taken. Time stamps are the driver's, of
//! the machine's monotonic clock as a rule; what they differ by from the arm's clock is what
//! [`super::clock_offset`] finds. Never run against a device: none has been at hand.

use std::path::{Path, PathBuf};
use std::time::Duration;

use image::GrayImage;
use thiserror::Error;
use v4l::buffer::Type;
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream;
use v4l::video::Capture;
use v4l::{Device, FourCC};

/// Why a camera gives no image.
#[derive(Debug, Error)]
pub enum VideoError {
    /// The system or the driver refused.
    #[error("{}: {source}", .path.display())]
    System {
        /// The device.
        path: PathBuf,
        /// What was said.
        source: std::io::Error,
    },
    /// The camera has no format that can be read, or not at the size asked for.
    #[error("{}: no 8-bit grey or YUYV of {} x {} pixels", .path.display(), .size_px[0], .size_px[1])]
    Format {
        /// The device.
        path: PathBuf,
        /// The size asked for.
        size_px: [u32; 2],
    },
    /// A buffer with fewer bytes than an image.
    #[error("{}: frame {sequence} is cut short", .path.display())]
    Short {
        /// The device.
        path: PathBuf,
        /// The driver's number of the frame.
        sequence: u32,
    },
}

/// How the bytes of a row lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// A byte for each pixel.
    Grey,
    /// Two bytes, the first the brightness.
    Yuyv,
}

impl Layout {
    const ALL: [Self; 2] = [Self::Grey, Self::Yuyv];

    const fn code(self) -> &'static [u8; 4] {
        match self {
            Self::Grey => b"GREY",
            Self::Yuyv => b"YUYV",
        }
    }

    const fn bytes(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Yuyv => 2,
        }
    }

    /// The image in a buffer whose rows are `stride` bytes apart; `None` when the buffer is too short for it.
    fn image(self, buffer: &[u8], [width, height]: [u32; 2], stride: usize) -> Option<GrayImage> {
        let row_bytes = width as usize * self.bytes();
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height as usize {
            let start = row.checked_mul(stride)?;
            let row = buffer.get(start..start.checked_add(row_bytes)?)?;
            pixels.extend(row.iter().step_by(self.bytes()));
        }
        GrayImage::from_raw(width, height, pixels)
    }
}

/// One image.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoFrame {
    /// Of the whole sensor.
    pub image: GrayImage,
    /// The driver's time stamp.
    pub time_s: f64,
    /// The driver's number of the frame: gaps are frames that nobody fetched in time.
    pub sequence: u32,
}

/// A camera that delivers images.
pub struct VideoCamera {
    path: PathBuf,
    size_px: [u32; 2],
    layout: Layout,
    stride: usize,
    stream: Stream<'static>,
}

/// Images that may wait to be fetched.
const BUFFERS: u32 = 4;
/// A camera that delivers nothing for so long has stopped.
const PATIENCE: Duration = Duration::from_secs(2);

impl VideoCamera {
    /// Opens a device, such as `/dev/video0`, for images of a size.
    ///
    /// # Errors
    /// When the device cannot be opened, or has no such images; see [`VideoError`].
    pub fn open(path: &Path, size_px: [u32; 2]) -> Result<Self, VideoError> {
        let system = |source| VideoError::System { path: path.to_owned(), source };
        let device = Device::with_path(path).map_err(system)?;
        for layout in Layout::ALL {
            let mut wanted = device.format().map_err(system)?;
            [wanted.width, wanted.height] = size_px;
            wanted.fourcc = FourCC::new(layout.code());
            // A driver gives what it has, not what it is asked for.
            let Ok(given) = device.set_format(&wanted) else { continue };
            if [given.width, given.height] != size_px || given.fourcc.repr != *layout.code() {
                continue;
            }
            let stride = (given.stride as usize).max(size_px[0] as usize * layout.bytes());
            let mut stream = Stream::with_buffers(&device, Type::VideoCapture, BUFFERS).map_err(system)?;
            stream.set_timeout(PATIENCE);
            return Ok(Self { path: path.to_owned(), size_px, layout, stride, stream });
        }
        Err(VideoError::Format { path: path.to_owned(), size_px })
    }

    /// Waits for the next image.
    ///
    /// # Errors
    /// When none comes within two seconds, or it is incomplete.
    pub fn frame(&mut self) -> Result<VideoFrame, VideoError> {
        let (buffer, metadata) =
            self.stream.next().map_err(|source| VideoError::System { path: self.path.clone(), source })?;
        let sequence = metadata.sequence;
        let used = buffer.get(..metadata.bytesused as usize).unwrap_or(buffer);
        let image = self.layout.image(used, self.size_px, self.stride);
        let image = image.ok_or_else(|| VideoError::Short { path: self.path.clone(), sequence })?;
        let time_s = metadata.timestamp.sec as f64 + 1e-6 * metadata.timestamp.usec as f64;
        Ok(VideoFrame { image, time_s, sequence })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_taken_from_rows_that_may_be_padded() {
        let grey = Layout::Grey.image(&[1, 2, 3, 0, 4, 5, 6], [3, 2], 4).unwrap();
        assert_eq!(grey.as_raw(), &[1, 2, 3, 4, 5, 6]);
        let yuyv = Layout::Yuyv.image(&[1, 128, 2, 128, 3, 128, 4, 128], [2, 2], 4).unwrap();
        assert_eq!(yuyv.as_raw(), &[1, 2, 3, 4]);
        assert_eq!(Layout::Grey.image(&[1, 2, 3, 0, 4, 5], [3, 2], 4), None);
        assert_eq!(Layout::Grey.image(&[], [3, 2], usize::MAX), None);
    }

    #[test]
    fn what_is_no_camera_is_one_line() {
        let nowhere = VideoCamera::open(Path::new("/dev/no-such-camera"), [768, 576]).err().unwrap();
        assert!(nowhere.to_string().starts_with("/dev/no-such-camera: "), "{nowhere}");
    }
}
