//! Where the files are that ship with the command: `robots/`, `gaits/`, `scenarios/`, `runs/`, `stacks/`.
//!
//! Three folders are searched, in this order: the working directory, `../share/hoofprint` beside the executable (`make install`), and the
//! source tree that the command was built in. So a local file takes precedence over an installed one.

use std::convert::Infallible;
use std::path::{Path, PathBuf};

/// The folders that are searched for a shipped file, in order of precedence. The first is the working directory (an empty path).
pub fn folders() -> Vec<PathBuf> {
    let mut folders = vec![PathBuf::new()];
    let prefix = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.parent()?.to_path_buf()));
    folders.extend(prefix.map(|prefix| prefix.join("share/hoofprint")));
    folders.push(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."));
    folders
}

/// The first file of this name, such as `scenarios/flat_trot.toml`, below [`folders`]; `None` if there is none.
pub fn find(name: &Path) -> Option<PathBuf> {
    folders().into_iter().map(|folder| folder.join(name)).find(|path| path.is_file())
}

/// The path of an argument: as typed if the file exists or is not shipped, else the shipped file of this name. For `value_parser`.
///
/// # Errors
///
/// None: a missing file is reported by the code that opens it, under the name that was typed.
pub fn argument(path: &str) -> Result<PathBuf, Infallible> {
    Ok(find(Path::new(path)).unwrap_or_else(|| PathBuf::from(path)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shipped_scenario_is_found_and_other_paths_stay_as_typed() {
        let found = find(Path::new("scenarios/flat_trot.toml")).unwrap();
        assert!(found.is_file() && found.ends_with("scenarios/flat_trot.toml"));
        assert_eq!(find(Path::new("scenarios/no_such.toml")), None);
        assert_eq!(argument("no/such.toml").unwrap(), Path::new("no/such.toml"));
        assert_eq!(argument("/no/such.toml").unwrap(), Path::new("/no/such.toml"));
    }
}
