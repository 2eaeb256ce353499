//! Tokens → [`File`]: recursive descent, one function per construct.
//!
//! The language is that of `lcm-gen` 1.5: constants may be dimensions, packages may change within a file, enums are numbered as
//! `lcm-gen` numbers them. Numbers are read as in C: `0x10` is 16 and `010` is 8.

use std::sync::Arc;

use crate::Error;
use crate::ast::{Constant, ConstantValue, Dim, Enum, Field, FieldType, File, Primitive, Struct, TypeName};
use crate::lexer::{Kind, Token, tokens};

/// Parses one `.lcm` text. `file` is its name in error messages.
///
/// # Errors
/// [`Error::Syntax`] at the first place where the text breaks a rule of the language.
pub fn parse(file: &str, text: &str) -> Result<File, Error> {
    let mut parser = Parser { file, tokens: tokens(file, text)?, at: 0, package: String::new() };
    let mut out = File { path: file.into(), structs: Vec::new(), enums: Vec::new() };
    loop {
        let token = parser.next();
        match (token.kind, token.text.as_str()) {
            (Kind::End, _) => return Ok(out),
            (Kind::Word, "package") => parser.package()?,
            (Kind::Word, "struct") => out.structs.push(parser.structure(token.comment)?),
            (Kind::Word, "enum") => out.enums.push(parser.enumeration(token.comment)?),
            _ => {
                return Err(parser.unexpected(&token, "`package`, `struct`, `enum` or the end of the file"));
            }
        }
    }
}

struct Parser<'a> {
    file: &'a str,
    tokens: Vec<Token>,
    at: usize,
    package: String,
}

impl Parser<'_> {
    /// The next token; after the last one always [`Kind::End`].
    fn next(&mut self) -> Token {
        let token = self.tokens[self.at].clone();
        if token.kind != Kind::End {
            self.at += 1;
        }
        token
    }

    fn found(&self, at: &Token, found: String, expected: impl Into<String>) -> Error {
        Error::Syntax {
            file: self.file.to_owned(),
            line: at.position.line,
            column: at.position.column,
            found,
            expected: expected.into(),
        }
    }

    fn unexpected(&self, token: &Token, expected: impl Into<String>) -> Error {
        self.found(token, token.described(), expected)
    }

    fn try_sign(&mut self, sign: &str) -> bool {
        let token = &self.tokens[self.at];
        let is = token.kind == Kind::Sign && token.text == sign;
        self.at += usize::from(is);
        is
    }

    fn require_sign(&mut self, sign: &str, expected: &str) -> Result<(), Error> {
        if self.try_sign(sign) {
            return Ok(());
        }
        let token = self.next();
        Err(self.unexpected(&token, expected))
    }

    fn word(&mut self, expected: &str) -> Result<Token, Error> {
        let token = self.next();
        if token.kind == Kind::Word { Ok(token) } else { Err(self.unexpected(&token, expected)) }
    }

    /// A name without a package.
    fn name(&mut self, expected: &str) -> Result<Token, Error> {
        let token = self.word(expected)?;
        if token.text.contains('.') {
            return Err(self.unexpected(&token, format!("{expected} without a dot")));
        }
        Ok(token)
    }

    fn package(&mut self) -> Result<(), Error> {
        let token = self.word("the name of the package")?;
        if token.text.split('.').any(str::is_empty) {
            return Err(self.unexpected(&token, "names with single dots between them"));
        }
        self.package = token.text;
        self.require_sign(";", "`;` after the name of the package")
    }

    /// Name of a type that is declared here.
    fn declared(&mut self, what: &str) -> Result<(Token, TypeName), Error> {
        let token = self.name(what)?;
        if Primitive::from_name(&token.text).is_some() {
            return Err(self.unexpected(&token, format!("{what} that is not a built-in type")));
        }
        let name = TypeName { package: self.package.clone(), short: token.text.clone() };
        Ok((token, name))
    }

    fn structure(&mut self, comment: Option<String>) -> Result<Struct, Error> {
        let (token, name) = self.declared("the name of the struct")?;
        self.require_sign("{", "`{` after the name of the struct")?;
        let mut out = Struct { name, position: token.position, comment, constants: Vec::new(), fields: Vec::new() };
        while !self.try_sign("}") {
            let token = self.next();
            match (token.kind, token.text.as_str()) {
                (Kind::Word, "const") => self.constants(&mut out, &token.comment)?,
                (Kind::Word, "struct" | "enum") => {
                    return Err(self.unexpected(&token, "a field (types cannot be declared inside a struct)"));
                }
                (Kind::Word, _) => self.fields(&mut out, &token)?,
                _ => return Err(self.unexpected(&token, "a field, `const` or `}`")),
            }
        }
        // `};` as in C++ is an error in lcm-gen, and here too.
        Ok(out)
    }

    /// A name that no other field or constant of the struct uses.
    fn new_name(&mut self, of: &Struct, what: &str) -> Result<Token, Error> {
        let token = self.name(what)?;
        if of.fields.iter().any(|f| *f.name == token.text) || of.constants.iter().any(|c| c.name == token.text) {
            return Err(self.unexpected(&token, format!("a name that {} does not have yet", of.name)));
        }
        Ok(token)
    }

    /// `const TYPE NAME = VALUE, NAME = VALUE;` after the `const`.
    fn constants(&mut self, out: &mut Struct, comment: &Option<String>) -> Result<(), Error> {
        let expected = "int8_t, int16_t, int32_t, int64_t, float or double";
        let ty = self.word(expected)?;
        let primitive = match Primitive::from_name(&ty.text) {
            Some(p) if p.is_signed_integer() || matches!(p, Primitive::Float | Primitive::Double) => p,
            _ => return Err(self.unexpected(&ty, expected)),
        };
        loop {
            let name = self.new_name(out, "the name of the constant")?.text;
            self.require_sign("=", "`=` after the name of the constant")?;
            let token = self.next();
            let Some(value) = constant_value(primitive, &token.text) else {
                return Err(self.unexpected(&token, format!("a number that fits {}", primitive.name())));
            };
            out.constants.push(Constant { name, value, text: token.text, comment: comment.clone() });
            if !self.try_sign(",") {
                return self.require_sign(";", "`,` or `;` after the constant");
            }
        }
    }

    /// `TYPE NAME[DIM].., NAME[DIM]..;` after the type.
    fn fields(&mut self, out: &mut Struct, ty: &Token) -> Result<(), Error> {
        let ty_of_field = match Primitive::from_name(&ty.text) {
            Some(p) => FieldType::Primitive(p),
            None => FieldType::Named(self.qualified(ty)?),
        };
        loop {
            let token = self.new_name(out, "the name of the field")?;
            let mut dims = Vec::new();
            while self.try_sign("[") {
                dims.push(self.dimension(out)?);
                self.require_sign("]", "`]` after the array size")?;
            }
            out.fields.push(Field {
                name: token.text.into(),
                position: token.position,
                ty: ty_of_field.clone(),
                dims,
                comment: ty.comment.clone(),
            });
            if !self.try_sign(",") {
                return self.require_sign(";", "`[`, `,` or `;` after the field");
            }
        }
    }

    /// Type of a field, with the package of the text added.
    fn qualified(&self, token: &Token) -> Result<TypeName, Error> {
        if token.text.split('.').any(str::is_empty) {
            return Err(self.unexpected(token, "a type"));
        }
        let (package, short) = token.text.rsplit_once('.').unwrap_or((&self.package, &token.text));
        Ok(TypeName { package: package.to_owned(), short: short.to_owned() })
    }

    fn dimension(&mut self, of: &Struct) -> Result<Dim, Error> {
        let token = self.next();
        let expected = "a number above 0, an integer constant or an earlier integer field";
        let constant = of.constants.iter().find(|c| c.name == token.text);
        let text = match (token.kind, constant) {
            (Kind::Number, _) => token.text.clone(),
            (Kind::Word, Some(c)) if !matches!(c.value, ConstantValue::Float(_) | ConstantValue::Double(_)) => {
                c.text.clone()
            }
            (Kind::Word, None) => return self.length_field(of, &token, expected),
            _ => return Err(self.unexpected(&token, expected)),
        };
        match integer(&text).and_then(|n| i32::try_from(n).ok()).and_then(|n| usize::try_from(n).ok()) {
            Some(size) if size > 0 => Ok(Dim::Constant { size, text }),
            _ => Err(self.unexpected(&token, expected)),
        }
    }

    fn length_field(&self, of: &Struct, token: &Token, expected: &str) -> Result<Dim, Error> {
        let Some(index) = of.fields.iter().position(|f| *f.name == token.text) else {
            return Err(self.unexpected(token, expected));
        };
        let field = &of.fields[index];
        match field.ty {
            FieldType::Primitive(p) if p.is_signed_integer() && field.dims.is_empty() => {
                Ok(Dim::Variable { field: index, name: Arc::clone(&field.name) })
            }
            _ => Err(self.unexpected(token, expected)),
        }
    }

    fn enumeration(&mut self, comment: Option<String>) -> Result<Enum, Error> {
        let (token, name) = self.declared("the name of the enum")?;
        self.require_sign("{", "`{` after the name of the enum")?;
        let mut values: Vec<(String, i32)> = Vec::new();
        while !self.try_sign("}") {
            let token = self.name("a name or `}`")?;
            let value = if self.try_sign("=") {
                let number = self.next();
                let value = integer(&number.text).and_then(|n| i32::try_from(n).ok());
                value.ok_or_else(|| self.unexpected(&number, "a number that fits int32_t"))?
            } else {
                // As lcm-gen counts: one above the largest so far, where 0 counts as present.
                let largest = values.iter().map(|v| v.1).fold(0, i32::max);
                largest
                    .checked_add(1)
                    .ok_or_else(|| self.unexpected(&token, "a value (the next one does not fit int32_t)"))?
            };
            if let Some((other, _)) = values.iter().find(|v| v.0 == token.text || v.1 == value) {
                let found = format!("`{}` = {value}", token.text);
                return Err(self.found(&token, found, format!("a name and a value other than those of {other}")));
            }
            values.push((token.text, value));
            // lcm-gen takes either, or neither.
            self.try_sign(",");
            self.try_sign(";");
        }
        Ok(Enum { name, position: token.position, comment, values })
    }
}

/// Reads an integer like C's `strtoll(text, .., 0)`; `None` if it does not fit.
fn integer(text: &str) -> Option<i64> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let lower = digits.to_ascii_lowercase();
    let (radix, digits) = match lower.strip_prefix("0x") {
        Some(hex) => (16, hex),
        None if lower.len() > 1 && lower.starts_with('0') => (8, &lower[1..]),
        None => (10, lower.as_str()),
    };
    if !digits.starts_with(|c: char| c.is_digit(radix)) {
        return None;
    }
    let magnitude = i128::from(u64::from_str_radix(digits, radix).ok()?);
    i64::try_from(if negative { -magnitude } else { magnitude }).ok()
}

/// Reads a number as C's `strtod` does: decimal or hexadecimal integer.
#[allow(clippy::cast_precision_loss, reason = "as defined by the language")]
fn float(text: &str) -> Option<f64> {
    let hexadecimal = text.to_ascii_lowercase().contains("0x");
    if hexadecimal { integer(text).map(|n| n as f64) } else { text.parse().ok() }
}

/// The value of a constant, if the text is a number of that type.
#[allow(clippy::cast_possible_truncation, reason = "a float constant is the nearest float")]
fn constant_value(ty: Primitive, text: &str) -> Option<ConstantValue> {
    match ty {
        Primitive::Int8 => integer(text)?.try_into().ok().map(ConstantValue::Int8),
        Primitive::Int16 => integer(text)?.try_into().ok().map(ConstantValue::Int16),
        Primitive::Int32 => integer(text)?.try_into().ok().map(ConstantValue::Int32),
        Primitive::Int64 => integer(text).map(ConstantValue::Int64),
        Primitive::Float => {
            let value = float(text)?;
            let fits = !value.is_finite() || value.abs() <= f64::from(f32::MAX);
            fits.then_some(ConstantValue::Float(value as f32))
        }
        Primitive::Double => float(text).map(ConstantValue::Double),
        Primitive::Byte | Primitive::String | Primitive::Boolean => None,
    }
}
