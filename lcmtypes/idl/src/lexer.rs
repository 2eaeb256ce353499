//! Text → tokens. Comments are not tokens; the comment directly above a token is stored with it.

use crate::Error;
use crate::ast::Position;

/// Kind of a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Keyword, name or type, dots included.
    Word,
    /// Text that starts like a number; the parser checks it.
    Number,
    /// One of `{ } [ ] ; , =`.
    Sign,
    /// After the last token.
    End,
}

#[derive(Debug, Clone)]
pub(crate) struct Token {
    pub kind: Kind,
    pub text: String,
    pub position: Position,
    /// Comment block that ends on the line above, or the same line before it.
    pub comment: Option<String>,
}

impl Token {
    /// Text in error messages.
    pub fn described(&self) -> String {
        match self.kind {
            Kind::End => "the end of the file".into(),
            _ => format!("`{}`", self.text),
        }
    }
}

/// Splits a text into tokens; the last one is of kind [`Kind::End`].
pub(crate) fn tokens(file: &str, text: &str) -> Result<Vec<Token>, Error> {
    let mut lexer = Lexer { file, chars: text.chars().collect(), at: 0, line: 1, column: 1 };
    let mut tokens: Vec<Token> = Vec::new();
    let mut comment: Option<Comment> = None;
    loop {
        lexer.skip_space();
        let position = lexer.position();
        if let Some(lines) = lexer.comment()? {
            let trails = tokens.last().is_some_and(|t| t.position.line == position.line);
            if !trails {
                match &mut comment {
                    Some(c) if position.line <= c.last_line + 1 => c.lines.extend(lines),
                    _ => comment = Some(Comment { lines, last_line: 0 }),
                }
                if let Some(c) = &mut comment {
                    c.last_line = lexer.line;
                }
            }
            continue;
        }
        let (kind, text) = lexer.token()?;
        let comment = comment.take().filter(|c| position.line <= c.last_line + 1).map(Comment::text);
        tokens.push(Token { kind, text, position, comment });
        if kind == Kind::End {
            return Ok(tokens);
        }
    }
}

struct Comment {
    lines: Vec<String>,
    last_line: usize,
}

impl Comment {
    /// The lines without their common indentation and without empty ones at both ends.
    fn text(self) -> String {
        let indent = |l: &String| l.len() - l.trim_start().len();
        let common = self.lines.iter().filter(|l| !l.trim().is_empty()).map(indent).min().unwrap_or(0);
        let lines: Vec<&str> = self.lines.iter().map(|l| l.get(common..).unwrap_or("").trim_end()).collect();
        lines.join("\n").trim_matches('\n').to_owned()
    }
}

struct Lexer<'a> {
    file: &'a str,
    chars: Vec<char>,
    at: usize,
    line: usize,
    column: usize,
}

impl Lexer<'_> {
    fn peek(&self, ahead: usize) -> Option<char> {
        self.chars.get(self.at + ahead).copied()
    }

    fn next(&mut self) -> Option<char> {
        let c = self.peek(0)?;
        self.at += 1;
        if c == '\n' {
            self.line += 1;
            self.column = 1;
        } else {
            self.column += 1;
        }
        Some(c)
    }

    fn position(&self) -> Position {
        Position { line: self.line, column: self.column }
    }

    fn error(&self, at: Position, found: impl Into<String>, expected: &str) -> Error {
        Error::Syntax {
            file: self.file.to_owned(),
            line: at.line,
            column: at.column,
            found: found.into(),
            expected: expected.into(),
        }
    }

    fn skip_space(&mut self) {
        while self.peek(0).is_some_and(char::is_whitespace) {
            self.next();
        }
    }

    fn take_while(&mut self, mut keep: impl FnMut(char, &str) -> bool) -> String {
        let mut text = String::new();
        while let Some(c) = self.peek(0).filter(|&c| keep(c, &text)) {
            text.push(c);
            self.next();
        }
        text
    }

    /// Lines of the comment that starts here, without comment signs; `None` if none starts here.
    fn comment(&mut self) -> Result<Option<Vec<String>>, Error> {
        let start = self.position();
        match (self.peek(0), self.peek(1)) {
            (Some('/'), Some('/')) => {
                let line = self.take_while(|c, _| c != '\n');
                Ok(Some(vec![line.trim_start_matches('/').trim_end().to_owned()]))
            }
            (Some('/'), Some('*')) => {
                self.next();
                self.next();
                let mut text = String::new();
                loop {
                    match (self.peek(0), self.peek(1)) {
                        (Some('*'), Some('/')) => break,
                        (Some(c), _) => text.push(c),
                        (None, _) => {
                            return Err(self.error(start, "a comment without an end", "`*/`"));
                        }
                    }
                    self.next();
                }
                self.next();
                self.next();
                Ok(Some(text.lines().map(without_stars).collect()))
            }
            _ => Ok(None),
        }
    }

    fn token(&mut self) -> Result<(Kind, String), Error> {
        let start = self.position();
        let in_word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
        let Some(c) = self.peek(0) else {
            return Ok((Kind::End, String::new()));
        };
        if "{}[];,=".contains(c) {
            self.next();
            Ok((Kind::Sign, c.to_string()))
        } else if c.is_ascii_alphabetic() || c == '_' {
            Ok((Kind::Word, self.take_while(|c, _| in_word(c))))
        } else if c.is_ascii_digit() || "+-.".contains(c) {
            // A sign belongs to the number at its start and after the `e` of a decimal exponent.
            let sign_fits =
                |before: &str| before.is_empty() || (before.ends_with(['e', 'E']) && !before.contains(['x', 'X']));
            Ok((Kind::Number, self.take_while(|c, before| in_word(c) || ("+-".contains(c) && sign_fits(before)))))
        } else {
            Err(self.error(start, format!("`{c}`"), "a name, a number, a comment or one of `{ } [ ] ; , =`"))
        }
    }
}

/// A line of a block comment without the stars that decorate its start.
fn without_stars(line: &str) -> String {
    let bare = line.trim_start();
    match bare.strip_prefix('*') {
        Some(rest) => rest.trim_start_matches('*').trim_end().to_owned(),
        None => line.trim_end().to_owned(),
    }
}
