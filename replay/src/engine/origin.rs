//! What may be other than it was when the log was written: build, parameters, robot, types. Named before any difference in bits.

use controller::params::Params;
use lcmtypes::RunInfo;
use std::collections::BTreeMap;

/// A build of this software, as RUN_INFO describes one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Build {
    /// Git commit.
    pub revision: String,
    /// Its tree had uncommitted changes.
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

/// Something that is not as it was when the log was written.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Deviation {
    /// `revision`, `dirty`, `toolchain`, `build`, `urdf`, `types`, or the key of a parameter.
    pub what: String,
    /// What the log says; empty for a parameter that there was not.
    pub log: String,
    /// What it is here; empty for a parameter that there is no more.
    pub here: String,
}

/// What differs between a log and what replays it. `used` is the run's description after all changes asked for.
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
    let types = |info: &RunInfo| -> BTreeMap<String, String> {
        info.lcm_types.iter().map(|file| (file.name.clone(), file.text.clone())).collect()
    };
    let today: BTreeMap<String, String> =
        lcmtypes::SOURCES.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
    for (name, text) in types(log) {
        match today.get(&name) {
            Some(now) if *now == text => {}
            now => compare("types", &name, now.map_or("no such file", |_| "another text")),
        }
    }
    // Defaults of parameters that came after the log count too, so the text is completed.
    let completed =
        |text: &str| Params::from_toml(text, "").map_or_else(|_| text.to_owned(), |params| params.to_toml());
    let (before, now) = (keys(&log.params), keys(&completed(&used.params)));
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
