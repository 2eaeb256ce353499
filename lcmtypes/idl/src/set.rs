//! Several `.lcm` texts linked together.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ast::{Dim, Enum, FieldType, Position, Primitive, Struct, TypeName};
use crate::wire::MAX_DEPTH;
use crate::{Error, hash, parse};

/// Types from one or more `.lcm` texts, with every name linked to its type.
#[derive(Debug, Clone, Default)]
pub struct TypeSet {
    pub(crate) structs: Vec<Linked>,
    enums: Vec<Enum>,
    by_name: BTreeMap<String, usize>,
    by_fingerprint: BTreeMap<u64, Vec<usize>>,
}

/// A linked struct.
#[derive(Debug, Clone)]
pub(crate) struct Linked {
    pub def: Struct,
    pub file: Arc<str>,
    /// Name with package.
    pub full_name: Arc<str>,
    /// Element type of each field.
    pub elements: Vec<Element>,
    pub base: u64,
    pub fingerprint: u64,
    /// Smallest number of bytes of a value on the wire.
    pub min_size: usize,
}

/// Element type of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Element {
    Primitive(Primitive),
    /// Index in [`TypeSet::structs`].
    Struct(usize),
    /// Index in the set's enums; on the wire an `int32_t`.
    Enum(usize),
}

/// One struct of a [`TypeSet`], with reflection on its messages.
#[derive(Debug, Clone, Copy)]
pub struct Type<'a> {
    pub(crate) set: &'a TypeSet,
    pub(crate) index: usize,
}

impl TypeSet {
    /// Parses and links texts, given as (name, text). Their order does not matter.
    ///
    /// # Errors
    /// [`Error::Syntax`] at the first place where a text breaks a rule of the language, names a type that no text declares, declares
    /// a type twice, or contains itself without end.
    pub fn parse<'t>(sources: impl IntoIterator<Item = (&'t str, &'t str)>) -> Result<Self, Error> {
        let (set, errors) = Self::parse_valid(sources);
        errors.into_iter().next().map_or(Ok(set), Err)
    }

    /// Parses and links the types that are complete, as `lcm-gen` does, which compiles each by itself. Returns the errors of all others. Of
    /// two declarations of one name the first one counts; another one that differs is found by its fingerprint.
    pub fn parse_valid<'t>(sources: impl IntoIterator<Item = (&'t str, &'t str)>) -> (Self, Vec<Error>) {
        let (mut enums, mut defs, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (path, text) in sources {
            match parse(path, text) {
                Ok(file) => {
                    enums.extend(file.enums.into_iter().map(|e| (Arc::clone(&file.path), e)));
                    defs.extend(file.structs.into_iter().map(|def| (Arc::clone(&file.path), def)));
                }
                Err(error) => errors.push(error),
            }
        }
        let mut places = Names::default();
        let mut set = Self::default();
        for (file, e) in enums {
            match places.declare(&file, &e.name, e.position, Element::Enum(set.enums.len()), e.fingerprint()) {
                Ok(()) => set.enums.push(e),
                Err((_, error)) => errors.push(error),
            }
        }
        for (file, def) in defs {
            let (full_name, base) = (def.name.to_string().into(), hash::struct_base(&def));
            let element = Element::Struct(set.structs.len());
            if let Err((is_same, error)) = places.declare(&file, &def.name, def.position, element, base) {
                errors.push(error);
                if is_same {
                    continue;
                }
            }
            let (elements, fingerprint, min_size) = (Vec::new(), 0, 0);
            set.structs.push(Linked { def, file, full_name, elements, base, fingerprint, min_size });
        }
        set.remove_incomplete(&mut places, &mut errors);
        // Removing a type can only make others incomplete, so few rounds are needed.
        for _ in 0..MAX_ROUNDS {
            let invalid = set.link();
            if invalid.is_empty() {
                return (set, errors);
            }
            let (indices, found): (Vec<_>, Vec<_>) = invalid.into_iter().unzip();
            errors.extend(found);
            set.remove(&indices, &mut places);
            set.remove_incomplete(&mut places, &mut errors);
        }
        (Self::default(), errors)
    }

    /// Removes the structs with a field of a type that is not declared, and those that need them.
    fn remove_incomplete(&mut self, places: &mut Names, errors: &mut Vec<Error>) {
        for _ in 0..MAX_ROUNDS {
            let mut removed = Vec::new();
            for (index, linked) in self.structs.iter_mut().enumerate() {
                match elements(linked, places) {
                    Ok(elements) => linked.elements = elements,
                    Err(error) => {
                        errors.push(error);
                        removed.push(index);
                    }
                }
            }
            if removed.is_empty() {
                return;
            }
            self.remove(&removed, places);
        }
        self.structs.clear();
    }

    /// Removes structs; `indices` in ascending order.
    fn remove(&mut self, indices: &[usize], places: &mut Names) {
        let mut index = 0;
        self.structs.retain(|_| {
            index += 1;
            indices.binary_search(&(index - 1)).is_err()
        });
        places.0.retain(|_, found| match &mut found.element {
            Element::Struct(index) => {
                let before = indices.partition_point(|removed| removed < index);
                let is_removed = indices.get(before) == Some(index);
                *index -= before;
                !is_removed
            }
            _ => true,
        });
    }

    /// Computes fingerprints and sizes. Returns the structs for which that is not possible; if there are any, nothing else counts.
    fn link(&mut self) -> Vec<(usize, Error)> {
        let (mut hashes, mut sizes) = (Known::new(self), Known::new(self));
        let mut invalid = Vec::new();
        (self.by_name, self.by_fingerprint) = (BTreeMap::new(), BTreeMap::new());
        for index in 0..self.structs.len() {
            let hashed = self.full_hash(index, &mut Vec::new(), &mut hashes);
            let sized = hashed.and_then(|hashed| {
                self.min_size(index, &mut Vec::new(), &mut sizes).map(|min_size| (hashed.hash, min_size))
            });
            match sized {
                Ok((fingerprint, min_size)) => {
                    let linked = &mut self.structs[index];
                    (linked.fingerprint, linked.min_size) = (fingerprint, min_size);
                    self.by_name.entry(linked.full_name.to_string()).or_insert(index);
                    // Types that differ in name only share a fingerprint and a wire format.
                    self.by_fingerprint.entry(fingerprint).or_default().push(index);
                }
                Err(error) => invalid.push((index, error)),
            }
        }
        invalid
    }

    /// The struct of that full name, such as `hoofprint.robot_state_t`.
    pub fn by_name(&self, name: &str) -> Option<Type<'_>> {
        self.by_name.get(name).map(|&index| Type { set: self, index })
    }

    /// The struct of that fingerprint. Structs that differ in name only share one; then it is the first one declared.
    pub fn by_fingerprint(&self, fingerprint: u64) -> Option<Type<'_>> {
        self.all_by_fingerprint(fingerprint).next()
    }

    /// Every struct of that fingerprint, in the order of their declaration.
    pub fn all_by_fingerprint(&self, fingerprint: u64) -> impl Iterator<Item = Type<'_>> {
        let indices = self.by_fingerprint.get(&fingerprint).map_or(&[][..], Vec::as_slice);
        indices.iter().map(|&index| Type { set: self, index })
    }

    /// The struct whose fingerprint a message begins with.
    pub fn of_message(&self, bytes: &[u8]) -> Option<Type<'_>> {
        self.by_fingerprint(u64::from_be_bytes(*bytes.first_chunk()?))
    }

    /// Every struct, in the order of the texts.
    pub fn types(&self) -> impl Iterator<Item = Type<'_>> {
        (0..self.structs.len()).map(|index| Type { set: self, index })
    }

    /// Every enum, in the order of the texts.
    pub fn enums(&self) -> &[Enum] {
        &self.enums
    }

    /// Sum of the hashes of the types that a struct holds, folded into its own; a struct inside itself adds nothing.
    fn full_hash(&self, index: usize, parents: &mut Vec<usize>, known: &mut Known<Hashed>) -> Result<Hashed, Error> {
        if parents.contains(&index) {
            return Ok(Hashed { hash: 0, height: 0, met_itself: true });
        }
        if let Some(hashed) = known.values[index] {
            return Ok(hashed);
        }
        let linked = &self.structs[index];
        known.visits += 1;
        if parents.len() == MAX_DEPTH || known.visits > MAX_VISITS {
            return Err(too_many(linked));
        }
        parents.push(index);
        let mut own = Hashed { hash: 0, height: 1, met_itself: false };
        for element in &linked.elements {
            match *element {
                Element::Primitive(_) => {}
                Element::Enum(inner) => own.hash = own.hash.wrapping_add(self.enums[inner].fingerprint()),
                Element::Struct(inner) => {
                    let inner = self.full_hash(inner, parents, known)?;
                    own.hash = own.hash.wrapping_add(inner.hash);
                    own.height = own.height.max(inner.height + 1);
                    own.met_itself |= inner.met_itself;
                }
            }
        }
        parents.pop();
        if own.height > MAX_DEPTH {
            return Err(too_many(linked));
        }
        own.hash = hash::full(linked.base, own.hash);
        if !own.met_itself {
            known.values[index] = Some(own);
        }
        Ok(own)
    }

    /// Fewest bytes on the wire: arrays of variable length count as empty. Fails on a struct that always holds itself.
    fn min_size(&self, index: usize, parents: &mut Vec<usize>, known: &mut Known<usize>) -> Result<usize, Error> {
        if let Some(size) = known.values[index] {
            return Ok(size);
        }
        let linked = &self.structs[index];
        parents.push(index);
        let mut size = 0usize;
        for (field, element) in linked.def.fields.iter().zip(&linked.elements) {
            let count = field.dims.iter().fold(1usize, |count, dim| match dim {
                Dim::Constant { size, .. } => count.saturating_mul(*size),
                Dim::Variable { .. } => 0,
            });
            if count == 0 {
                continue;
            }
            let one = match *element {
                Element::Primitive(p) => p.min_size(),
                Element::Enum(_) => Primitive::Int32.min_size(),
                Element::Struct(inner) if parents.contains(&inner) => {
                    let found =
                        format!("a field of type `{}`, which always holds another one", self.structs[inner].full_name);
                    return Err(error(
                        &linked.file,
                        field.position,
                        found,
                        "an array of variable length between the two",
                    ));
                }
                Element::Struct(inner) => self.min_size(inner, parents, known)?,
            };
            size = size.saturating_add(count.saturating_mul(one));
        }
        parents.pop();
        known.values[index] = Some(size);
        Ok(size)
    }
}

/// Structs that hold each other in many ways take exponential time to hash. No real set comes near this many steps, and texts from a
/// log may be anything.
const MAX_VISITS: usize = 1 << 20;

/// Rounds in which incomplete types are removed. Each round removes the types that need those of the round before.
const MAX_ROUNDS: usize = 200;

/// What hashing a struct found.
#[derive(Clone, Copy)]
struct Hashed {
    hash: u64,
    /// Structs in each other, this one included.
    height: usize,
    /// A struct inside itself was met: the hash holds for these parents only.
    met_itself: bool,
}

/// What is already known of each struct, or types that share types would take exponential time.
struct Known<T> {
    values: Vec<Option<T>>,
    visits: usize,
}

impl<T: Clone> Known<T> {
    fn new(set: &TypeSet) -> Self {
        Self { values: vec![None; set.structs.len()], visits: 0 }
    }
}

impl<'a> Type<'a> {
    /// What the text says: comment, constants, fields.
    pub fn def(&self) -> &'a Struct {
        &self.linked().def
    }

    /// Name with package, such as `hoofprint.robot_state_t`.
    pub fn name(&self) -> &'a str {
        &self.linked().full_name
    }

    /// The hash that starts every message of this type.
    pub fn fingerprint(&self) -> u64 {
        self.linked().fingerprint
    }

    /// Name of the text that declares it.
    pub fn file(&self) -> &'a str {
        &self.linked().file
    }

    /// The struct that a field's elements are; `None` for primitives, enums and an index past the last field.
    pub fn element(&self, field: usize) -> Option<Type<'a>> {
        match *self.linked().elements.get(field)? {
            Element::Struct(index) => Some(Type { set: self.set, index }),
            Element::Primitive(_) | Element::Enum(_) => None,
        }
    }

    /// Hash of the struct's own fields, as `lcm-gen -d` prints it.
    pub fn base_hash(&self) -> u64 {
        self.linked().base
    }

    pub(crate) fn linked(&self) -> &'a Linked {
        &self.set.structs[self.index]
    }
}

fn error(file: &str, at: Position, found: String, expected: &str) -> Error {
    Error::Syntax { file: file.to_owned(), line: at.line, column: at.column, found, expected: expected.to_owned() }
}

fn too_many(linked: &Linked) -> Error {
    let found = format!("{}, which holds too many other types in each other", linked.full_name);
    let expected = format!("at most {MAX_DEPTH} in each other, and {MAX_VISITS} ways through them");
    error(&linked.file, linked.def.position, found, &expected)
}

/// Every declared name.
#[derive(Default)]
struct Names(BTreeMap<TypeName, Declared>);

/// The declaration of a name.
struct Declared {
    element: Element,
    /// Where it stands.
    place: String,
    /// Hash of its content.
    hash: u64,
}

impl Names {
    /// Adds a name. If it is declared already: whether with the same content, and the error.
    fn declare(
        &mut self,
        file: &str,
        name: &TypeName,
        at: Position,
        element: Element,
        hash: u64,
    ) -> Result<(), (bool, Error)> {
        if let Some(first) = self.0.get(name) {
            let expected = format!("another name: {} declares this one", first.place);
            return Err((first.hash == hash, error(file, at, format!("`{name}`"), &expected)));
        }
        let place = format!("{file}:{}:{}", at.line, at.column);
        self.0.insert(name.clone(), Declared { element, place, hash });
        Ok(())
    }
}

fn elements(linked: &Linked, names: &Names) -> Result<Vec<Element>, Error> {
    let link = |field: &crate::ast::Field| match &field.ty {
        FieldType::Primitive(p) => Ok(Element::Primitive(*p)),
        FieldType::Named(name) => names.0.get(name).map(|found| found.element).ok_or_else(|| {
            error(
                &linked.file,
                field.position,
                format!("a field of type `{name}`"),
                "a type that one of the texts declares",
            )
        }),
    };
    linked.def.fields.iter().map(link).collect()
}
