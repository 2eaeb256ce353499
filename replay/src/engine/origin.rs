//! Differences between a log and its replay in build, parameters and robot. They are reported before any difference in bits.
//!
//! Message types need no entry: a message whose fingerprint differs from this build's is [`crate::Error::OtherTypeVersion`]. The `.lcm` texts of
//! RUN_INFO describe the log to other tools and do not decide anything here.

use controller::params::Params;
use lcmtypes::RunInfo;
use std::collections::BTreeMap;

/// A build of this software, as RUN_INFO describes one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Build {
    /// Git commit.
    pub revision: String,
    /// The source tree had uncommitted changes.
    pub dirty: bool,
    /// Compiler version.
    pub toolchain: String,
    /// Profile, target and code-generation flags.
    pub flags: String,
}

impl Build {
    /// The build that wrote a log.
    pub fn of(info: &RunInfo) -> Self {
        Build {
            revision: info.revision.clone(),
            dirty: info.dirty,
            toolchain: info.toolchain.clone(),
            flags: info.build.clone(),
        }
    }
}

/// A difference between the log and its replay.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Deviation {
    /// `revision`, `dirty`, `toolchain`, `build`, `urdf`, or the key of a parameter.
    pub what: String,
    /// Value in the log; empty for a parameter that the log does not contain.
    pub log: String,
    /// Value in the replay; empty for a parameter that no longer exists.
    pub here: String,
}

/// What differs between a log and the build and parameters that replay it.
///
/// - `used`: the run's description after all requested changes.
pub(super) fn deviations(log: &RunInfo, used: &RunInfo, here: Option<&Build>) -> Vec<Deviation> {
    let mut found = Vec::new();
    let mut compare = |what: &str, log: &str, here: &str| {
        if log != here {
            found.push(Deviation { what: what.to_owned(), log: log.to_owned(), here: here.to_owned() });
        }
    };
    if let Some(here) = here {
        let log = Build::of(log);
        compare("revision", &log.revision, &here.revision);
        compare("dirty", &log.dirty.to_string(), &here.dirty.to_string());
        compare("toolchain", &log.toolchain, &here.toolchain);
        compare("build", &log.flags, &here.flags);
    }
    let size = |text: &str| format!("{} bytes", text.len());
    if log.urdf != used.urdf {
        compare("urdf", &format!("{} as recorded", size(&log.urdf)), &format!("{} as given", size(&used.urdf)));
    }
    // Complete the text, so that the defaults of parameters added after the log count too.
    let completed =
        |text: &str| Params::from_toml(text, "").map_or_else(|_| text.to_owned(), |params| params.to_toml());
    let (before, now) = (keys(log.params()), keys(&completed(used.params())));
    let mut names: Vec<&String> = before.keys().chain(now.keys()).collect();
    names.sort();
    names.dedup();
    for name in names {
        let value = |of: &BTreeMap<String, String>| of.get(name).cloned().unwrap_or_default();
        compare(name, &value(&before), &value(&now));
    }
    found
}

/// Every value of a TOML text by its dotted key.
fn keys(text: &str) -> BTreeMap<String, String> {
    fn walk(prefix: &str, table: &toml::Table, keys: &mut BTreeMap<String, String>) {
        for (name, value) in table {
            let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            match value {
                toml::Value::Table(inner) => walk(&key, inner, keys),
                value => drop(keys.insert(key, value.to_string())),
            }
        }
    }
    let mut found = BTreeMap::new();
    if let Ok(table) = text.parse() {
        walk("", &table, &mut found);
    }
    found
}
