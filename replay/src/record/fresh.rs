//! The file of a new recording: nobody else's, and never one that holds something already.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file to record into.
pub struct Fresh {
    /// Empty and locked for as long as it is open, so that no second recorder writes it.
    pub file: File,
    /// What had the name before, by its new name.
    pub moved: Option<PathBuf>,
}

impl Fresh {
    /// Creates `path`. A file of that name that is not empty is moved aside: `run.mcap` to `run.1.mcap`, or the next number that is free.
    ///
    /// # Errors
    /// [`io::ErrorKind::ResourceBusy`] if another process records into it; whatever the operating system refuses.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut moved = None;
        loop {
            let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    let text = "another process is recording into it";
                    return Err(io::Error::new(io::ErrorKind::ResourceBusy, text));
                }
                // A file system without locks is no reason not to record.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            let found = file.metadata()?;
            if !found.is_file() {
                return Ok(Fresh { file, moved });
            }
            // Between opening and locking another recorder may have moved it aside.
            let is_there =
                std::fs::metadata(path).is_ok_and(|there| (there.dev(), there.ino()) == (found.dev(), found.ino()));
            if !is_there {
                continue;
            }
            if found.len() == 0 {
                return Ok(Fresh { file, moved });
            }
            // What it is moved to is claimed first, so that two who move never choose one name.
            let aside = claim(path)?;
            if let Err(error) = std::fs::rename(path, &aside) {
                // The one that tells is the first.
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
        let folder = std::env::temp_dir().join(format!("fresh-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn a_log_that_is_there_is_moved_aside() {
        let folder = folder("aside");
        let path = folder.join("run.mcap");
        let aside = ["run.1.mcap", "run.3.mcap"].map(|name| folder.join(name));
        std::fs::write(folder.join("run.2.mcap"), "of somebody else").unwrap();
        let mut moved = Vec::new();
        for text in ["first", "second", "third"] {
            let mut fresh = Fresh::create(&path).unwrap();
            moved.push(fresh.moved.take());
            fresh.file.write_all(text.as_bytes()).unwrap();
        }
        assert_eq!(moved, [None, Some(aside[0].clone()), Some(aside[1].clone())]);
        let texts = ["run.1.mcap", "run.2.mcap", "run.3.mcap", "run.mcap"]
            .map(|name| std::fs::read_to_string(folder.join(name)).unwrap());
        assert_eq!(texts, ["first", "of somebody else", "second", "third"]);
        // An empty one holds nothing to keep.
        std::fs::write(&path, "").unwrap();
        assert_eq!(Fresh::create(&path).unwrap().moved, None);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_has_one_recorder() {
        let folder = folder("lock");
        let path = folder.join("run.mcap");
        let mut first = Fresh::create(&path).unwrap();
        first.file.write_all(b"first").unwrap();
        let refused = Fresh::create(&path).err().unwrap();
        assert_eq!(refused.to_string(), "another process is recording into it");
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        drop(first);
        assert!(Fresh::create(&path).unwrap().moved.is_some());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
