//! Which type a message has, and the text that explains it.

use lcm_idl::ast::FieldType;
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

/// `.lcm` texts, and in which of them each type stands.
pub(super) struct Schemas {
    types: TypeSet,
    texts: BTreeMap<String, String>,
    /// File of each type, by the type's full name.
    files: BTreeMap<String, String>,
}

impl Schemas {
    /// The types of this stack.
    pub fn ours() -> Self {
        let sources: Vec<_> = lcmtypes::SOURCES.iter().map(|(name, text)| ((*name).into(), (*text).into())).collect();
        Schemas::new(&sources).expect("the build of `lcmtypes` parsed the same texts")
    }

    /// # Errors
    /// If a text is not in the language, or names a type that no text declares.
    pub fn new(sources: &[(String, String)]) -> Result<Self, lcm_idl::Error> {
        let types = TypeSet::parse(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())))?;
        let mut files = BTreeMap::new();
        for (name, text) in sources {
            for declared in lcm_idl::parse(name, text)?.structs {
                files.insert(declared.name.to_string(), name.clone());
            }
        }
        Ok(Schemas { types, texts: sources.iter().cloned().collect(), files })
    }

    /// The schema of a message that begins with `fingerprint`.
    pub fn of(&self, channel: &str, fingerprint: u64) -> Option<Schema> {
        let known = type_of(channel, fingerprint).and_then(|ty| self.types.by_name(ty.name()));
        let ty =
            known.filter(|ty| ty.fingerprint() == fingerprint).or_else(|| self.types.by_fingerprint(fingerprint))?;
        let first = self.files.get(ty.name())?;
        let mut files = BTreeSet::new();
        self.collect(ty, &mut files);
        files.remove(first.as_str());
        let texts = std::iter::once(first.as_str()).chain(files).filter_map(|file| self.texts.get(file));
        Some(Schema { name: ty.name().to_owned(), text: texts.map(String::as_str).collect::<Vec<_>>().join("\n") })
    }

    /// Files of a type and of all types inside it.
    fn collect<'a>(&'a self, ty: Type<'a>, files: &mut BTreeSet<&'a str>) {
        let Some(file) = self.files.get(ty.name()) else { return };
        // A file may hold several types, so the walk ends at types, not at files.
        let mut seen = BTreeSet::from([ty.name()]);
        let mut open = vec![ty];
        files.insert(file);
        while let Some(ty) = open.pop() {
            for field in &ty.def().fields {
                let FieldType::Named(name) = &field.ty else { continue };
                let Some(inner) = self.types.by_name(&name.to_string()) else { continue };
                files.extend(self.files.get(inner.name()).map(String::as_str));
                if seen.insert(inner.name()) {
                    open.push(inner);
                }
            }
        }
    }
}
