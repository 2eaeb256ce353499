//! Finds the type of a message and its `.lcm` text.

use super::{EventRef, FileSchema};
use crate::Error;
use crate::{printable, printable_path};
use lcm_idl::{Type, TypeSet};
use lcmtypes::{Message, RunInfo, channels};
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Known message types of a log. Sources in order of precedence: `.lcm` texts from the user, this build for its own channels and types, the
/// log itself (RUN_INFO, schemas of an MCAP), and this build.
#[derive(Default)]
pub struct Types {
    given: Vec<Texts>,
    of_log: Vec<Texts>,
    /// Schemas of the file by fingerprint.
    schemas: BTreeMap<u64, Arc<FileSchema>>,
    /// Schemas that were processed, valid or not, by address: a file can have any number.
    seen: BTreeMap<usize, Arc<FileSchema>>,
    /// Hashes of the RUN_INFO texts that were processed.
    runs: Vec<u64>,
    warnings: Vec<String>,
}

/// RUN_INFO messages with different texts that are read. A log has one run, or a few.
const MAX_RUNS: usize = 64;

/// A set of `.lcm` texts and the types in them.
struct Texts {
    types: TypeSet,
    texts: BTreeMap<String, String>,
}

impl Types {
    /// Reads `.lcm` files, and the `.lcm` files in folders and their subfolders. Types that are complete are used; what is not is named in
    /// [`Types::warnings`].
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::NoTypes`] for a file or folder without a valid type.
    pub fn from_files(paths: &[PathBuf]) -> Result<Self, Error> {
        let mut types = Types::default();
        let mut sources = Vec::new();
        for path in paths {
            let before = sources.len();
            read_texts(path, &mut sources, &mut types.warnings)?;
            if sources.len() == before {
                return Err(Error::NoTypes { path: path.clone() });
            }
        }
        // A file can be given twice, directly and by its folder.
        sources.sort();
        sources.dedup();
        let (texts, errors) = Texts::of_valid(&sources);
        types.warnings.extend(errors.iter().map(|error| printable(&error.to_string()).into_owned()));
        match paths.first() {
            Some(path) if texts.types.types().next().is_none() => return Err(Error::NoTypes { path: path.clone() }),
            Some(_) => types.given.push(texts),
            None => {}
        }
        Ok(types)
    }

    /// Problems of the files that [`Types::from_files`] read, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Adds texts, as (name, text).
    pub(super) fn add(&mut self, path: &Path, sources: &[(String, String)]) -> Result<(), Error> {
        let texts = Texts::new(sources).map_err(|source| Error::Types { path: path.into(), source: source.into() })?;
        self.given.push(texts);
        Ok(())
    }

    /// Adds the types that an event describes: its channel's schema, or the texts in a RUN_INFO. Invalid texts are ignored.
    pub fn learn(&mut self, event: &EventRef<'_>) {
        if let Some(schema) = event.schema() {
            self.learn_schema(schema);
        }
        self.learn_run_info(event.channel, event.data);
    }

    /// Adds the texts of a RUN_INFO; `false` if they are already known, or for a message of another channel.
    #[inline]
    pub fn learn_run_info(&mut self, channel: &str, data: &[u8]) -> bool {
        channel == channels::RUN_INFO && self.run_info(data)
    }

    #[cold]
    fn run_info(&mut self, data: &[u8]) -> bool {
        let Ok(info) = RunInfo::decode(data) else { return false };
        let ours = lcmtypes::SOURCES.iter().copied();
        if info.lcm_types.iter().map(|file| (&*file.name, &*file.text)).eq(ours) {
            return false;
        }
        let sources: Vec<_> = info.lcm_types.into_iter().map(|file| (file.name, file.text)).collect();
        // A live run repeats its RUN_INFO; each text is parsed once.
        let mut hasher = DefaultHasher::new();
        sources.hash(&mut hasher);
        let hash = hasher.finish();
        if self.runs.contains(&hash) || self.runs.len() == MAX_RUNS {
            return false;
        }
        self.runs.push(hash);
        self.of_log.insert(0, Texts::of_valid(&sources).0);
        true
    }

    /// Adds a schema of the file; `false` if it was already processed.
    #[inline]
    pub fn learn_schema(&mut self, schema: &Arc<FileSchema>) -> bool {
        let is_new = !self.seen.contains_key(&(Arc::as_ptr(schema) as usize));
        if is_new {
            self.schema_of_file(schema);
        }
        is_new
    }

    #[cold]
    fn schema_of_file(&mut self, schema: &Arc<FileSchema>) {
        self.seen.insert(Arc::as_ptr(schema) as usize, Arc::clone(schema));
        let Some(text) = schema.lcm_text() else { return };
        let (texts, _) = Texts::of_valid(&[(schema.name.clone(), text.to_owned())]);
        let Some(ty) = texts.types.by_name(&schema.name) else { return };
        let fingerprint = ty.fingerprint();
        self.schemas.entry(fingerprint).or_insert_with(|| Arc::clone(schema));
        self.of_log.push(texts);
    }

    /// The type of a message.
    pub fn of_message(&self, channel: &str, message: &[u8]) -> Option<Type<'_>> {
        self.find(channel, super::fingerprint(message)?).map(|(ty, _)| ty)
    }

    /// The type of this name in the files that [`Types::from_files`] read.
    pub(super) fn given_by_name(&self, name: &str) -> Option<Type<'_>> {
        self.given.iter().find_map(|texts| texts.types.by_name(name))
    }

    /// Names and texts of these files.
    pub(super) fn given_texts(&self) -> impl Iterator<Item = (&String, &String)> {
        self.given.iter().flat_map(|texts| &texts.texts)
    }

    /// Name of the type of a message. Types that differ only in name have one fingerprint; then it is `one of A, B`, unless the channel table
    /// lists one for the channel.
    pub fn name_of(&self, channel: &str, message: &[u8]) -> Option<String> {
        let fingerprint = super::fingerprint(message)?;
        let (ty, texts) = self.find(channel, fingerprint)?;
        if channels::find(channel).is_some_and(|c| c.fingerprint == fingerprint) {
            return Some(ty.name().to_owned());
        }
        let set = texts.map_or(lcmtypes::types(), |texts| &texts.types);
        let mut names: Vec<_> = set.all_by_fingerprint(fingerprint).map(|ty| ty.name()).collect();
        names.dedup();
        Some(if names.len() > 1 { format!("one of {}", names.join(", ")) } else { ty.name().to_owned() })
    }

    /// The type with this fingerprint. If several types differ only in name, the one that the channel table lists for the channel.
    pub fn of(&self, channel: &str, fingerprint: u64) -> Option<Type<'_>> {
        self.find(channel, fingerprint).map(|(ty, _)| ty)
    }

    /// The type and the texts that contain it; no texts for a type of this build.
    fn find(&self, channel: &str, fingerprint: u64) -> Option<(Type<'_>, Option<&Texts>)> {
        let name = channels::find(channel).filter(|c| c.fingerprint == fingerprint).map(|c| c.type_name);
        // The texts of a log may lack the types of messages inside its messages; this build has all of its own.
        let ours = name.and_then(|name| lcmtypes::types().by_name(name)).map(|ty| (ty, None));
        in_texts(&self.given, name, fingerprint)
            .or(ours)
            .or_else(|| in_texts(&self.of_log, name, fingerprint))
            .or_else(|| among(lcmtypes::types(), name, fingerprint).map(|ty| (ty, None)))
    }

    /// The schema of a type for an MCAP file: the schema of the file that the message comes from; else the `.lcm` text of the type, followed
    /// by the texts of its nested types: those of the log's RUN_INFO if it has all of them, so that comments of an older build stay, else this build's.
    pub(super) fn schema(&self, channel: &str, fingerprint: u64) -> Option<Arc<FileSchema>> {
        if let Some(schema) = self.schemas.get(&fingerprint) {
            return Some(Arc::clone(schema));
        }
        let files = |ty: Type| -> Vec<String> {
            let mut inner = BTreeSet::new();
            files_inside(ty, &mut BTreeSet::from([ty.name()]), &mut inner);
            inner.remove(ty.file());
            std::iter::once(ty.file()).chain(inner).map(str::to_owned).collect()
        };
        let name = channels::find(channel).filter(|c| c.fingerprint == fingerprint).map(|c| c.type_name);
        let of_log = in_texts(&self.of_log, name, fingerprint);
        let is_whole = |(ty, texts): &(Type, Option<&Texts>)| {
            texts.is_some_and(|texts| files(*ty).iter().all(|file| texts.texts.contains_key(file)))
        };
        let (ty, texts) = of_log.filter(is_whole).or_else(|| self.find(channel, fingerprint))?;
        let text = |file: &str| match texts {
            Some(texts) => texts.texts.get(file).map(String::as_str),
            None => lcmtypes::SOURCES.iter().find(|(name, _)| *name == file).map(|(_, text)| *text),
        };
        let files = files(ty);
        let texts: Vec<_> = files.iter().filter_map(|file| text(file)).collect();
        let schema =
            FileSchema { name: ty.name().to_owned(), encoding: "lcm".into(), data: texts.join("\n").into_bytes() };
        Some(schema.into())
    }
}

impl Texts {
    fn new(sources: &[(String, String)]) -> Result<Self, lcm_idl::Error> {
        let types = TypeSet::parse(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())))?;
        Ok(Texts { types, texts: sources.iter().cloned().collect() })
    }

    /// The valid types, and the errors of the others.
    fn of_valid(sources: &[(String, String)]) -> (Self, Vec<lcm_idl::Error>) {
        let (types, errors) = TypeSet::parse_valid(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())));
        (Texts { types, texts: sources.iter().cloned().collect() }, errors)
    }
}

/// The first of the texts with a type of this fingerprint, and the type.
fn in_texts<'t>(all: &'t [Texts], name: Option<&str>, fingerprint: u64) -> Option<(Type<'t>, Option<&'t Texts>)> {
    all.iter().find_map(|texts| among(&texts.types, name, fingerprint).map(|ty| (ty, Some(texts))))
}

/// The type of this name if it has the fingerprint, else the first type that has it.
fn among<'t>(types: &'t TypeSet, name: Option<&str>, fingerprint: u64) -> Option<Type<'t>> {
    let named = name.and_then(|name| types.by_name(name)).filter(|ty| ty.fingerprint() == fingerprint);
    named.or_else(|| types.by_fingerprint(fingerprint))
}

/// Collects the files of all nested types of a type. Types can be recursive.
fn files_inside<'a>(ty: Type<'a>, seen: &mut BTreeSet<&'a str>, files: &mut BTreeSet<&'a str>) {
    for inner in (0..ty.def().fields.len()).filter_map(|field| ty.element(field)) {
        files.insert(inner.file());
        if seen.insert(inner.name()) {
            files_inside(inner, seen, files);
        }
    }
}

/// Reads a `.lcm` file, or the `.lcm` files in a folder and its subfolders. Files that are no LCM types, and files and folders inside a folder that
/// cannot be read, get a warning.
fn read_texts(path: &Path, sources: &mut Vec<(String, String)>, warnings: &mut Vec<String>) -> Result<(), Error> {
    let io = |source| Error::Io { path: path.into(), source };
    let has_ending = |path: &Path, wanted: &str| path.extension().is_some_and(|ending| ending == wanted);
    if !path.is_dir() {
        let name = printable_path(path);
        if has_ending(path, "zcm") {
            warnings.push(format!("{name}: types of ZCM, whose fingerprints differ from those of LCM: ignored"));
            return Ok(());
        }
        match crate::read_text(path) {
            Ok(text) => sources.push((path.display().to_string(), text)),
            Err(error) if error.kind() == ErrorKind::InvalidData => {
                warnings.push(format!("{name}: not UTF-8 text: ignored"));
            }
            Err(error) => return Err(io(error)),
        }
        return Ok(());
    }
    let mut entries = std::fs::read_dir(path)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>())
        .map_err(io)?;
    entries.sort();
    for entry in entries {
        // Symbolic links to folders are not followed: they can form a loop.
        let is_folder = entry.is_dir() && !entry.is_symlink();
        if is_folder || has_ending(&entry, "lcm") || has_ending(&entry, "zcm") {
            // Opening a pipe would wait for its writer.
            let is_readable = entry.is_dir() || entry.is_file();
            match is_readable.then(|| read_texts(&entry, sources, warnings)) {
                Some(Ok(())) => {}
                Some(Err(error)) => warnings.push(format!("{error}: ignored")),
                None => warnings.push(format!("{}: no regular file: ignored", printable_path(&entry))),
            }
        }
    }
    Ok(())
}
