//! Which type a message has, and the text that explains it.

use lcm_idl::{Type, TypeSet};
use lcmtypes::channels;
use std::collections::{BTreeMap, BTreeSet};

/// Name and text of a type.
pub(super) struct Schema {
    pub name: String,
    pub text: String,
}

/// The type of a message: that of its channel if the fingerprint agrees, else the one that has the fingerprint.
pub(super) fn type_of(channel: &str, fingerprint: u64) -> Option<Type<'static>> {
    let types = lcmtypes::types();
    match channels::find(channel).filter(|c| c.fingerprint == fingerprint) {
        Some(known) => types.by_name(known.type_name),
        None => types.by_fingerprint(fingerprint),
    }
}

/// `.lcm` texts, and the types in them.
pub(super) struct Schemas {
    types: TypeSet,
    texts: BTreeMap<String, String>,
}

impl Schemas {
    /// The types of this stack.
    pub fn ours() -> Self {
        let text = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        Schemas { types: lcmtypes::types().clone(), texts: lcmtypes::SOURCES.iter().map(text).collect() }
    }

    /// # Errors
    /// If a text is not in the language, or names a type that no text declares.
    pub fn new(sources: &[(String, String)]) -> Result<Self, lcm_idl::Error> {
        let types = TypeSet::parse(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())))?;
        Ok(Schemas { types, texts: sources.iter().cloned().collect() })
    }

    /// The schema of a message that begins with `fingerprint`: the text of its type, then those of the types inside it.
    pub fn of(&self, channel: &str, fingerprint: u64) -> Option<Schema> {
        let named = type_of(channel, fingerprint).and_then(|ty| self.types.by_name(ty.name()));
        let ty =
            named.filter(|ty| ty.fingerprint() == fingerprint).or_else(|| self.types.by_fingerprint(fingerprint))?;
        let mut inner = BTreeSet::new();
        files_inside(ty, &mut BTreeSet::from([ty.name()]), &mut inner);
        inner.remove(ty.file());
        let files = std::iter::once(ty.file()).chain(inner);
        let texts: Vec<_> = files.filter_map(|file| self.texts.get(file)).map(String::as_str).collect();
        Some(Schema { name: ty.name().to_owned(), text: texts.join("\n") })
    }
}

/// Files of all types inside a type. A type may hold itself.
fn files_inside<'a>(ty: Type<'a>, seen: &mut BTreeSet<&'a str>, files: &mut BTreeSet<&'a str>) {
    for inner in (0..ty.def().fields.len()).filter_map(|field| ty.element(field)) {
        files.insert(inner.file());
        if seen.insert(inner.name()) {
            files_inside(inner, seen, files);
        }
    }
}
