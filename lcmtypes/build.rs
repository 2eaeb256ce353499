//! Generates the Rust structs and the table of sources from `*.lcm`, and links liblcm.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let sources = lcm_texts(&here);

    let types = lcm_idl::TypeSet::parse(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())));
    let types = types.unwrap_or_else(|error| panic!("{}/{error}", here.display()));
    write(&out.join("types.rs"), &lcm_idl::generate(&types));

    let mut table = String::from("&[\n");
    for (name, _) in &sources {
        let path = here.join(name);
        let _ = writeln!(table, "    ({name:?}, include_str!({path:?})),");
    }
    write(&out.join("sources.rs"), &(table + "]\n"));

    // The folder, so that an added file is noticed too.
    println!("cargo:rerun-if-changed=.");
    println!("cargo:rustc-link-lib=lcm");
}

/// Name and text of every `.lcm` file of the folder, by name.
fn lcm_texts(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut texts: Vec<(String, String)> = entries
        .filter_map(|entry| entry.ok()?.path().into())
        .filter(|path: &PathBuf| path.extension().is_some_and(|e| e == "lcm"))
        .map(|path| {
            let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            (path.file_name().expect("a file has a name").to_string_lossy().into_owned(), text)
        })
        .collect();
    texts.sort();
    texts
}

fn write(path: &Path, text: &str) {
    fs::write(path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
