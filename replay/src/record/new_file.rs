//! Creates the file of a recording: exclusive, and never over an existing log.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A new, empty file for a recording.
pub struct NewFile {
    /// Empty, and locked while it is open, so that no second recorder writes to it.
    pub file: File,
    /// New name of the file that had this name before.
    pub moved: Option<PathBuf>,
}

impl NewFile {
    /// Creates `path`. A non-empty file of that name is renamed: `run.mcap` to `run.1.mcap`, or the next free number.
    ///
    /// # Errors
    /// [`io::ErrorKind::ResourceBusy`] if another process records into it; other errors of the operating system.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut moved = None;
        loop {
            let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    let text = "another process is recording into it";
                    return Err(io::Error::new(io::ErrorKind::ResourceBusy, text));
                }
                // Record also on a file system without locks.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            let found = file.metadata()?;
            if !found.is_file() {
                return Ok(NewFile { file, moved });
            }
            // Another recorder may have renamed the file between open and lock.
            let is_there =
                std::fs::metadata(path).is_ok_and(|there| (there.dev(), there.ino()) == (found.dev(), found.ino()));
            if !is_there {
                continue;
            }
            if found.len() == 0 {
                return Ok(NewFile { file, moved });
            }
            // Create the new name first, so that two processes never choose the same.
            let aside = claim(path)?;
            if let Err(error) = std::fs::rename(path, &aside) {
                // The first error is the cause.
                let _ = std::fs::remove_file(&aside);
                return Err(error);
            }
            moved = Some(aside);
        }
    }
}

/// Creates the first of `run.1.mcap`, `run.2.mcap`, … that does not exist.
fn claim(path: &Path) -> io::Result<PathBuf> {
    let part = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, ending) = (part(path.file_stem()), part(path.extension()));
    for number in 1_u32.. {
        let aside = path.with_file_name(format!("{stem}.{number}.{ending}"));
        match File::create_new(&aside) {
            Ok(_) => return Ok(aside),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use std::io::Write;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("new-file-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn an_existing_log_is_renamed() {
        let folder = folder("aside");
        let path = folder.join("run.mcap");
        let aside = ["run.1.mcap", "run.3.mcap"].map(|name| folder.join(name));
        std::fs::write(folder.join("run.2.mcap"), "of another process").unwrap();
        let mut moved = Vec::new();
        for text in ["first", "second", "third"] {
            let mut new = NewFile::create(&path).unwrap();
            moved.push(new.moved.take());
            new.file.write_all(text.as_bytes()).unwrap();
        }
        assert_eq!(moved, [None, Some(aside[0].clone()), Some(aside[1].clone())]);
        let texts = ["run.1.mcap", "run.2.mcap", "run.3.mcap", "run.mcap"]
            .map(|name| std::fs::read_to_string(folder.join(name)).unwrap());
        assert_eq!(texts, ["first", "of another process", "second", "third"]);
        // An empty file is reused.
        std::fs::write(&path, "").unwrap();
        assert_eq!(NewFile::create(&path).unwrap().moved, None);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_second_recorder_of_one_file_is_rejected() {
        let folder = folder("lock");
        let path = folder.join("run.mcap");
        let mut first = NewFile::create(&path).unwrap();
        first.file.write_all(b"first").unwrap();
        let error = NewFile::create(&path).err().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::ResourceBusy);
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        drop(first);
        assert!(NewFile::create(&path).unwrap().moved.is_some());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
