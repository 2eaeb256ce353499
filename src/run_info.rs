//! The build of this command, for RUN_INFO.

use replay::engine::Build;

/// This build: its commit, compiler and flags, as the build script recorded them.
pub fn build() -> Build {
    Build {
        revision: env!("HOOF_REVISION").to_owned(),
        dirty: env!("HOOF_DIRTY") == "true",
        toolchain: env!("HOOF_TOOLCHAIN").to_owned(),
        flags: env!("HOOF_BUILD").to_owned(),
    }
}
