//! Files appear whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::error::IoError;

/// Writes a file by way of a temporary one in the same directory that is renamed when `fill` has succeeded, so that
/// nobody sees half a file and a failed run leaves the old one alone. Missing directories are not made.
///
/// A symbolic link is followed. What is no regular file (a pipe, `/dev/null`) is written in place: renaming over it
/// would destroy it.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), IoError> {
    let system = |source| IoError::System { path: path.to_owned(), source };
    let target = match fs::metadata(path) {
        Ok(found) if found.is_dir() => return Err(IoError::Directory { path: path.to_owned() }),
        Ok(found) if !found.is_file() => {
            let mut special = fs::OpenOptions::new().write(true).open(path).map_err(system)?;
            return fill(&mut special).and_then(|()| special.flush()).map_err(system);
        }
        Ok(_) => fs::canonicalize(path).map_err(system)?,
        Err(_) => path.to_owned(),
    };
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        return Err(IoError::NoFolder { path: path.to_owned(), folder });
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".prehend-");
    // A temporary file is private by default; what it becomes here is an ordinary file, as the umask wants it.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = BufWriter::new(builder.tempfile_in(&folder).map_err(system)?);
    fill(&mut file).map_err(system)?;
    let file = file.into_inner().map_err(|failed| system(failed.into_error()))?;
    file.persist(&target).map_err(|failed| system(failed.error))?;
    Ok(())
}
