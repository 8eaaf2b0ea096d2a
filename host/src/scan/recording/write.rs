//! Writing a recording: under a temporary name, which becomes the folder's when everything is there.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use image::GrayImage;
use tempfile::TempDir;

use super::error::RecordingError;
use super::images::write_png;
use super::manifest::{CameraEntry, Content, Manifest};
use super::tables::{write_frames, write_joints, write_stripes};
use super::{FRAMES, IMAGES, JOINTS, MANIFEST, STRIPES, image_name};
use crate::plan::arm::Arm;
use crate::scan::Camera;
use crate::scan::capture::Capture;
use crate::scan::rig::{Rig, StripeCamera};

/// A recording that is being made. Dropped before [`RecordingWriter::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct RecordingWriter {
    target: PathBuf,
    content: Content,
    folder: TempDir,
}

/// The name by which a recording knows its arm.
fn name_of(arm: &Arm) -> Result<&'static str, RecordingError> {
    if *arm == Arm::rx60() { Ok("rx60") } else { Err(RecordingError::UnknownArm) }
}

impl RecordingWriter {
    /// Begins a recording of a scan by `arm` that will be the folder `target`.
    ///
    /// # Errors
    /// When the arm is not the built-in one, `target` is there already, or its parent is not a folder that can be written.
    pub fn create(target: &Path, content: Content, arm: &Arm) -> Result<Self, RecordingError> {
        name_of(arm)?;
        if fs::symlink_metadata(target).is_ok() {
            return Err(RecordingError::Exists { path: target.to_owned() });
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let system = |source| RecordingError::System { path: target.to_owned(), source };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".prehend-");
        // A temporary folder is private by default; what it becomes here is an ordinary one, as the umask wants it.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let folder = builder.tempdir_in(parent).map_err(system)?;
        if content == Content::Frames {
            fs::create_dir(folder.path().join(IMAGES)).map_err(system)?;
        }
        Ok(Self { target: target.to_owned(), content, folder })
    }

    /// Adds an image; a recording of stripes does without. Frames may come in any order, from several threads.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn image(&self, frame: u32, camera: Camera, image: &GrayImage) -> Result<(), RecordingError> {
        match self.content {
            Content::Frames => write_png(&self.folder.path().join(image_name(frame, camera)), image),
            Content::Stripes => Ok(()),
        }
    }

    /// Adds everything else, and gives the folder its name.
    ///
    /// # Errors
    /// When something cannot be written, or the capture is not by the built-in arm.
    pub fn finish(self, capture: &Capture) -> Result<(), RecordingError> {
        let arm = name_of(&capture.arm)?;
        let Rig { cameras: [left, right], palm_from_scanner } = &capture.rig;
        let cameras = [self.calibration(Camera::Left, left)?, self.calibration(Camera::Right, right)?];
        let manifest = Manifest::new(self.content, arm, palm_from_scanner, cameras);
        let text = toml::to_string(&manifest).map_err(|error| RecordingError::Manifest {
            path: self.target.join(MANIFEST),
            message: error.to_string(),
        })?;
        self.write(MANIFEST, |writer| writer.write_all(text.as_bytes()))?;
        self.write(FRAMES, |writer| write_frames(writer, &capture.frames))?;
        self.write(JOINTS, |writer| write_joints(writer, capture.joints.samples()))?;
        if self.content == Content::Stripes {
            self.write(STRIPES, |writer| write_stripes(writer, &capture.frames))?;
        }
        // Looked for again: an empty folder would be replaced without a word.
        if fs::symlink_metadata(&self.target).is_ok() {
            return Err(RecordingError::Exists { path: self.target });
        }
        fs::rename(self.folder.path(), &self.target)
            .map_err(|source| RecordingError::System { path: self.target, source })?;
        // Nothing is left under the temporary name.
        let _ = self.folder.keep();
        Ok(())
    }

    /// Writes a camera's calibration; gives what the description says of it.
    fn calibration(&self, camera: Camera, of: &StripeCamera) -> Result<CameraEntry, RecordingError> {
        let name = format!("{}.toml", camera.name());
        let text = of.calibration.to_toml();
        let path = self.target.join(&name);
        let text = text.map_err(|source| RecordingError::Calibration { path, source })?;
        self.write(&name, |writer| writer.write_all(text.as_bytes()))?;
        Ok(CameraEntry::of(of, &name))
    }

    fn write(
        &self,
        name: &str,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), RecordingError> {
        let path = self.folder.path().join(name);
        let file = File::create(&path).map(BufWriter::new);
        let written = file.and_then(|mut file| fill(&mut file).and_then(|()| file.flush()));
        written.map_err(|source| RecordingError::System { path, source })
    }
}
