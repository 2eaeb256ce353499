//! Reads settings that the kernel exposes as files; tests use a directory of their own.

use std::path::{Path, PathBuf};

/// The file system below a root directory.
pub struct System {
    root: PathBuf,
}

/// Capability to change the scheduler: bit in `CapEff`.
pub const CAP_SYS_NICE: u32 = 23;
/// Capability to use socket buffers larger than `rmem_max`.
pub const CAP_NET_ADMIN: u32 = 12;

impl System {
    /// The files of this machine.
    pub fn here() -> Self {
        System { root: PathBuf::from("/") }
    }

    #[cfg(test)]
    pub fn at(root: PathBuf) -> Self {
        System { root }
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// The trimmed text of a file.
    pub fn text(&self, path: &str) -> Option<String> {
        std::fs::read_to_string(self.path(path)).ok().map(|text| text.trim().to_owned())
    }

    /// The text of a gzip file.
    pub fn unpacked(&self, path: &str) -> Option<String> {
        let output = std::process::Command::new("zcat").arg(self.path(path)).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// The number in a file.
    pub fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// Names in a directory, sorted.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Whether a file is writable.
    pub fn is_writable(&self, path: &str) -> bool {
        std::fs::File::options().write(true).open(self.path(path)).is_ok()
    }

    /// Whether a file exists.
    pub fn has(&self, path: &str) -> bool {
        Path::exists(&self.path(path))
    }

    /// Whether this process has a capability.
    pub fn is_capable(&self, bit: u32) -> bool {
        let status = self.text("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("CapEff:")?.trim(), 16).ok());
        mask.is_some_and(|mask| mask >> bit & 1 == 1)
    }

    /// Soft limit of this process by its name in `/proc/self/limits`; `u64::MAX` means unlimited.
    pub fn limit(&self, name: &str) -> Option<u64> {
        let limits = self.text("/proc/self/limits")?;
        let rest = limits.lines().find_map(|line| line.strip_prefix(name))?;
        match rest.split_whitespace().next()? {
            "unlimited" => Some(u64::MAX),
            soft => soft.parse().ok(),
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A test machine with these files and texts.
    pub fn machine(test: &str, files: &[(&str, &str)]) -> System {
        let root = std::env::temp_dir().join(format!("hoof-doctor-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        let system = System::at(root);
        for (path, text) in files {
            let path = system.path(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        system
    }

    impl Drop for System {
        fn drop(&mut self) {
            if self.root.starts_with(std::env::temp_dir()) {
                let _ = std::fs::remove_dir_all(&self.root);
            }
        }
    }

    #[test]
    fn capabilities_and_limits_are_parsed() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max locked memory         8388608              8388608              bytes     \n\
                      Max realtime priority     0                    0                              \n\
                      Max cpu time              unlimited            unlimited            seconds   \n";
        let files = [("/proc/self/status", "Name:\thoof\nCapEff:\t0000000000801000\n"), ("/proc/self/limits", limits)];
        let system = machine("caps", &files);
        let capable = [CAP_SYS_NICE, 14, CAP_NET_ADMIN].map(|bit| system.is_capable(bit));
        assert_eq!(capable, [true, false, true]);
        let limit = |name| system.limit(name);
        assert_eq!(limit("Max locked memory"), Some(8_388_608));
        assert_eq!(
            (limit("Max realtime priority"), limit("Max cpu time"), limit("Max fun")),
            (Some(0), Some(u64::MAX), None)
        );
        assert!(!machine("none", &[]).is_capable(CAP_SYS_NICE));
    }
}
