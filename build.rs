//! Passes revision, toolchain and flags to the command (`env!("HOOF_…")`), and the run paths of libmujoco.so to the linker.

use std::process::Command;

fn main() {
    for path in [
        ".git/HEAD",
        ".git/index",
        "src",
        "controller",
        "drivers",
        "replay",
        "lcmtypes",
        "analysis/src",
        "experiments/src",
    ] {
        println!("cargo::rerun-if-changed={path}");
    }
    let revision = output("git", &["rev-parse", "HEAD"]).unwrap_or_else(|| "unknown".to_owned());
    let dirty = output("git", &["status", "--porcelain", "--untracked-files=no"]).is_some_and(|text| !text.is_empty());
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let toolchain = output(&rustc, &["--version"]).unwrap_or_else(|| "unknown".to_owned());
    let var = |name: &str| std::env::var(name).unwrap_or_default();
    let flags = var("CARGO_ENCODED_RUSTFLAGS").replace('\x1f', " ");
    println!("cargo::rustc-env=HOOF_REVISION={revision}");
    println!("cargo::rustc-env=HOOF_DIRTY={dirty}");
    println!("cargo::rustc-env=HOOF_TOOLCHAIN={toolchain}");
    println!("cargo::rustc-env=HOOF_BUILD={} {} [{flags}]", var("PROFILE"), var("TARGET"));

    println!("cargo::rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    // libmujoco.so: of an installed command, of a build in `target`, of a build elsewhere.
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib/hoofprint");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../../third_party/mujoco/lib");
    if let Ok(dir) = std::env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}");
    }
}

fn output(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
