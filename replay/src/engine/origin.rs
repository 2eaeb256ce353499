//! Differences between a log and its replay in build, parameters, robot and types. They are reported before any difference in bits.

use controller::params::Params;
use lcm_idl::TypeSet;
use lcmtypes::{RunInfo, channels};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Channel and fingerprint of messages that a replay decoded or compared.
pub(super) type Consumed = (Arc<str>, Option<u64>);

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
    /// `revision`, `dirty`, `toolchain`, `build`, `urdf`, `types`, or the key of a parameter.
    pub what: String,
    /// Value in the log; empty for a parameter that the log does not contain.
    pub log: String,
    /// Value in the replay; empty for a parameter that no longer exists.
    pub here: String,
}

/// What differs between a log and the build and parameters that replay it.
///
/// - `used`: the run's description after all requested changes.
/// - `consumed`: the channels and fingerprints that the replay decoded or compared.
pub(super) fn deviations(log: &RunInfo, used: &RunInfo, here: Option<&Build>, consumed: &[Consumed]) -> Vec<Deviation> {
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
    changed_types(log, consumed, &mut compare);
    // Complete the text, so that the defaults of parameters added after the log count too.
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

/// Types that the replay consumed and that RUN_INFO declares with another fingerprint than this build.
///
/// Comments and types that the replay does not need make no difference.
fn changed_types(log: &RunInfo, consumed: &[Consumed], compare: &mut dyn FnMut(&str, &str, &str)) {
    // Parsing all texts costs as much as fifty ticks of a replay, so equal texts are not parsed.
    if log.lcm_types.iter().all(|file| is_unneeded(&file.name, consumed) || is_unchanged(&file.name, &file.text)) {
        return;
    }
    let texts = log.lcm_types.iter().map(|file| (&*file.name, &*file.text));
    let of_log = match TypeSet::parse(texts) {
        Ok(types) => types,
        Err(error) => return compare("types", &format!("RUN_INFO.lcm_types: {error}"), ""),
    };
    let names: BTreeSet<&str> =
        consumed.iter().filter_map(|(channel, fingerprint)| type_name(channel, *fingerprint)).collect();
    for name in names {
        if let (Some(then), Some(now)) = (of_log.by_name(name), lcmtypes::types().by_name(name)) {
            let shown = |fingerprint: u64| format!("{name} with fingerprint {fingerprint:016x}");
            compare("types", &shown(then.fingerprint()), &shown(now.fingerprint()));
        }
    }
}

/// The file declares the type of channels that the replay did not consume, and no other type has a field of it.
fn is_unneeded(file: &str, consumed: &[Consumed]) -> bool {
    let name = file.strip_suffix(".lcm").unwrap_or(file);
    let carries = |channel: &&channels::Channel| channel.type_name.rsplit('.').next() == Some(name);
    let is_field = |(_, text): &(&str, &str)| code(text).any(|line| line.split(' ').next() == Some(name));
    let mut of_type = channels::CHANNELS.iter().filter(carries).peekable();
    of_type.peek().is_some()
        && of_type.all(|channel| consumed.iter().all(|(consumed, _)| **consumed != *channel.name))
        && !lcmtypes::SOURCES.iter().any(is_field)
}

/// The text has the declarations of this build's file of that name, whatever its comments; also if this build has no such file.
fn is_unchanged(file: &str, text: &str) -> bool {
    let known = lcmtypes::SOURCES.iter().find(|(name, _)| *name == file);
    known.is_none_or(|(_, known)| code(text).eq(code(known)))
}

/// The lines of a `.lcm` text without line comments and white space around them.
fn code(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(|line| line.split("//").next().unwrap_or_default().trim()).filter(|line| !line.is_empty())
}

/// Type of a consumed message. The type of a snapshot depends on the controller, so its fingerprint names it.
fn type_name(channel: &str, fingerprint: Option<u64>) -> Option<&'static str> {
    match channels::find(channel) {
        Some(known) if known.name != channels::CONTROLLER_SNAPSHOT => Some(known.type_name),
        _ => lcmtypes::types().by_fingerprint(fingerprint?).map(|ty| ty.name()),
    }
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
