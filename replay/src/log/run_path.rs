//! Names of one run of a log: `LOG#N`.

use std::path::{Path, PathBuf};

/// The name of one run of a log, `LOG#N`: [`super::LogReader`] then reads this run only. `number` counts from 1.
pub fn path_of_run(log: &Path, number: usize) -> PathBuf {
    let mut name = log.as_os_str().to_owned();
    name.push(format!("#{number}"));
    name.into()
}

/// The file of a name such as `LOG#N`, and the number of the run. A file that exists has its own name.
pub fn split_run(path: &Path) -> (PathBuf, Option<usize>) {
    let split = || {
        let (file, number) = path.to_str().filter(|_| !path.exists())?.rsplit_once('#')?;
        Some((PathBuf::from(file), number.parse().ok().filter(|number| *number > 0)?))
    };
    split().map_or_else(|| (path.to_owned(), None), |(file, number)| (file, Some(number)))
}
