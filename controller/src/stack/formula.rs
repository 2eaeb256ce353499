//! Parser of a stack's formula; the result keeps the column of every task for errors.
//!
//! ```text
//! formula = level { "/" level } { "<<" constraint }
//! level   = term { "+" term }
//! term    = [ weight ] task [ "[" row { "," row } "]" ]
//! ```

use super::StackError;

/// A parsed formula: levels in order of falling priority, and the constraints of all levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    /// Levels, the most important first; at least one.
    pub levels: Vec<Priority>,
    /// Constraints of all levels.
    pub constraints: Vec<ConstraintTerm>,
}

/// The tasks of a level; at least one.
pub type Priority = Vec<TaskTerm>;

/// A task in a level.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskTerm {
    /// Name of the task.
    pub task: String,
    /// Weight of its squared error.
    pub weight: f64,
    /// The rows used, ascending; `None` for all rows.
    pub rows: Option<Vec<usize>>,
    /// Position of the task's name, in characters from 1.
    pub column: usize,
}

/// A constraint in a formula.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConstraintTerm {
    /// Name of the constraint.
    pub name: String,
    /// Position of the name, in characters from 1.
    pub column: usize,
}

impl Formula {
    /// Parses a formula. The names are checked by [`Registry::check`](super::Registry::check).
    ///
    /// # Errors
    /// Syntax errors, weights that are not positive, repeated constraints, repeated rows of a task.
    pub fn parse(text: &str) -> Result<Self, StackError> {
        let mut reader = Reader { tokens: tokens(text)?, at: 0 };
        let (mut levels, mut constraints) = (vec![reader.level()?], Vec::new());
        while reader.take("/") {
            levels.push(reader.level()?);
        }
        while reader.take("<<") {
            let constraint = reader.constraint()?;
            if constraints.iter().any(|before: &ConstraintTerm| before.name == constraint.name) {
                let ConstraintTerm { name: constraint, column } = constraint;
                return Err(StackError::ConstraintTwice { column, constraint });
            }
            constraints.push(constraint);
        }
        if constraints.is_empty() {
            reader.end("+, /, << or [")?;
        }
        reader.end("<< or the end")?;
        let formula = Formula { levels, constraints };
        formula.check_repeated_rows()?;
        Ok(formula)
    }

    /// Whether it contains a constraint.
    pub fn has(&self, constraint: &str) -> bool {
        self.constraints.iter().any(|term| term.name == constraint)
    }

    /// Every term with the number of its level, from 0.
    pub fn terms(&self) -> impl Iterator<Item = (usize, &TaskTerm)> {
        self.levels.iter().enumerate().flat_map(|(i, level)| level.iter().map(move |term| (i, term)))
    }

    /// Whether a term contains this row of a task.
    pub fn takes(&self, task: &str, row: usize) -> bool {
        self.terms().any(|(_, term)| term.task == task && term.rows.as_ref().is_none_or(|rows| rows.contains(&row)))
    }

    fn check_repeated_rows(&self) -> Result<(), StackError> {
        let terms: Vec<&TaskTerm> = self.terms().map(|(_, term)| term).collect();
        for (i, term) in terms.iter().enumerate() {
            for before in terms[..i].iter().filter(|before| before.task == term.task) {
                let shared = match (&before.rows, &term.rows) {
                    (Some(a), Some(b)) => b.iter().copied().find(|row| a.contains(row)),
                    (Some(rows), None) | (None, Some(rows)) => rows.first().copied(),
                    (None, None) => Some(0),
                };
                if let Some(row) = shared {
                    let (column, first, task) = (term.column, before.column, term.task.clone());
                    return Err(StackError::RowTwice { column, first, task, row });
                }
            }
        }
        Ok(())
    }
}

/// A token of a formula and the column of its first character.
#[derive(Clone, Debug, PartialEq)]
struct Token {
    column: usize,
    text: String,
    number: Option<f64>,
}

impl Token {
    fn is_name(&self) -> bool {
        self.text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
    }
}

/// Whether a formula can contain this name.
pub(crate) fn is_name(name: &str) -> bool {
    let first = |c: char| c.is_ascii_alphabetic() || c == '_';
    name.starts_with(first) && name.chars().all(|c| first(c) || c.is_ascii_digit())
}

fn tokens(text: &str) -> Result<Vec<Token>, StackError> {
    let chars: Vec<char> = text.chars().collect();
    let (mut found, mut i) = (Vec::new(), 0);
    while i < chars.len() {
        let start = i;
        let c = chars[i];
        i += 1;
        if c.is_whitespace() {
            continue;
        }
        let mut number = None;
        if c.is_ascii_alphabetic() || c == '_' {
            while i < chars.len() && (chars[i].is_ascii_alphanumeric() || chars[i] == '_') {
                i += 1;
            }
        } else if c.is_ascii_digit() || c == '.' || (c == '-' && chars.get(i).is_some_and(char::is_ascii_digit)) {
            let exponent = |i: usize| matches!(chars[i - 1], 'e' | 'E');
            while i < chars.len()
                && (chars[i].is_ascii_alphanumeric()
                    || chars[i] == '.'
                    || (matches!(chars[i], '+' | '-') && exponent(i)))
            {
                i += 1;
            }
        } else if c == '<' && chars.get(i) == Some(&'<') {
            i += 1;
        }
        let text: String = chars[start..i].iter().collect();
        let column = start + 1;
        if c.is_ascii_digit() || matches!(c, '.' | '-') {
            number = text.parse().ok();
            if number.is_none() {
                return Err(syntax(column, &text, "a number such as 1e6, followed by a space and a task"));
            }
        } else if !is_name(&text) && !["+", "/", "<<", "[", ",", "]"].contains(&text.as_str()) {
            return Err(syntax(column, &text, "a weight, a name, or one of + / << [ , ]"));
        }
        found.push(Token { column, text, number });
    }
    found.push(Token { column: chars.len() + 1, text: String::new(), number: None });
    Ok(found)
}

fn syntax(column: usize, text: &str, expected: &'static str) -> StackError {
    let found = if text.is_empty() { "the end".to_owned() } else { format!("`{text}`") };
    StackError::Syntax { column, found, expected }
}

/// The tokens; the last one is the end of the text.
struct Reader {
    tokens: Vec<Token>,
    at: usize,
}

impl Reader {
    fn peek(&self) -> &Token {
        &self.tokens[self.at]
    }

    fn next(&mut self) -> Token {
        let token = self.peek().clone();
        self.at = (self.at + 1).min(self.tokens.len() - 1);
        token
    }

    fn take(&mut self, text: &str) -> bool {
        let there = self.peek().text == text;
        self.at += usize::from(there);
        there
    }

    fn end(&self, expected: &'static str) -> Result<(), StackError> {
        let token = self.peek();
        if token.text.is_empty() { Ok(()) } else { Err(syntax(token.column, &token.text, expected)) }
    }

    fn level(&mut self) -> Result<Priority, StackError> {
        let mut terms = vec![self.term()?];
        while self.take("+") {
            terms.push(self.term()?);
        }
        Ok(terms)
    }

    fn term(&mut self) -> Result<TaskTerm, StackError> {
        let weight = self.peek().number.map(|weight| (self.next().column, weight));
        let name = self.next();
        if !name.is_name() {
            let expected = if weight.is_some() { "a task" } else { "a task, optionally after a weight" };
            return Err(syntax(name.column, &name.text, expected));
        }
        if let Some((column, found)) = weight.filter(|(_, w)| !(1e-9..=1e9).contains(w)) {
            return Err(StackError::Weight { column, task: name.text, found });
        }
        let rows = if self.take("[") { Some(self.rows(&name)?) } else { None };
        Ok(TaskTerm { task: name.text, weight: weight.map_or(1.0, |(_, w)| w), rows, column: name.column })
    }

    fn rows(&mut self, task: &Token) -> Result<Vec<usize>, StackError> {
        let mut rows = Vec::new();
        loop {
            let token = self.next();
            let row: usize =
                token.text.parse().map_err(|_| syntax(token.column, &token.text, "a row number, from 0"))?;
            if rows.contains(&row) {
                let (column, first, task) = (token.column, task.column, task.text.clone());
                return Err(StackError::RowTwice { column, first, task, row });
            }
            rows.push(row);
            if self.take("]") {
                rows.sort_unstable();
                return Ok(rows);
            }
            if !self.take(",") {
                let token = self.peek();
                return Err(syntax(token.column, &token.text, ", or ]"));
            }
        }
    }

    fn constraint(&mut self) -> Result<ConstraintTerm, StackError> {
        let token = self.next();
        if !token.is_name() {
            return Err(syntax(token.column, &token.text, "a constraint"));
        }
        Ok(ConstraintTerm { name: token.text, column: token.column })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{S1, S3};
    use super::*;

    const ENOUGH: &str = " << base_dynamics << force_bounds";

    fn parse(tasks: &str) -> Result<Formula, StackError> {
        Formula::parse(&format!("{tasks}{ENOUGH}"))
    }

    fn error(text: &str) -> String {
        Formula::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn parses_the_two_stacks_of_the_source() {
        let s1 = Formula::parse(S1).unwrap();
        let weights: Vec<f64> = s1.levels[0].iter().map(|t| t.weight).collect();
        assert_eq!((s1.levels.len(), weights), (1, vec![1e6, 1e3, 1.0]));
        let s3 = Formula::parse(S3).unwrap();
        let names: Vec<&str> = s3.terms().map(|(_, t)| t.task.as_str()).collect();
        assert_eq!((s3.levels.len(), names), (3, vec!["contact", "trunk", "posture"]));
        let constraints = |of: &Formula| of.constraints.iter().map(|term| term.name.clone()).collect::<Vec<_>>();
        assert_eq!(constraints(&s1), constraints(&s3));
        assert_eq!(constraints(&s1)[..2], ["base_dynamics", "friction"]);
        assert_eq!((s1.has("torque_limits"), s1.has("torque")), (true, false));
    }

    #[test]
    fn plus_binds_stronger_than_slash_and_a_task_may_occur_on_two_levels() {
        let f = parse("2.5e-1 a[2,0]+.5 b/a[1]").unwrap();
        let expected = |task: &str, weight, rows: Option<&[usize]>, column| TaskTerm {
            task: task.to_owned(),
            weight,
            rows: rows.map(<[usize]>::to_vec),
            column,
        };
        assert_eq!(f.levels[0], [expected("a", 0.25, Some(&[0, 2]), 8), expected("b", 0.5, None, 18)]);
        assert_eq!(f.levels[1], [expected("a", 1.0, Some(&[1]), 20)]);
    }

    #[test]
    fn errors_name_the_column_and_the_entry() {
        for (text, expected) in [
            ("", "column 1: found the end, expected a task, optionally after a weight"),
            ("contact / ", "column 11: found the end, expected a task"),
            ("contact + / trunk", "column 11: found `/`, expected a task"),
            ("contact & trunk", "column 9: found `&`, expected a weight, a name"),
            ("contact trunk", "column 9: found `trunk`, expected +, /, << or ["),
            ("1e6x contact", "column 1: found `1e6x`, expected a number"),
            ("0 contact", "column 1: weight of contact is 0,"),
            ("trunk + -2 contact", "column 9: weight of contact is -2"),
            ("1e999 contact", "weight of contact is inf"),
            ("trunk[0,", "column 9: found the end, expected a row number"),
            ("trunk[1.5]", "column 7: found `1.5`, expected a row number"),
            ("trunk[0 1]", "column 9: found `1`, expected , or ]"),
            ("trunk[0,0]", "column 9: row 0 of trunk occurs twice, first at column 1"),
            ("trunk / posture + trunk", "column 19: row 0 of trunk occurs twice, first at column 1"),
            ("trunk[2,1] / trunk[0,2]", "column 14: row 2 of trunk occurs twice"),
            ("a << friction << friction", "column 18: constraint friction occurs twice"),
            ("a << friction / b", "column 15: found `/`, expected << or the end"),
            ("a << ", "column 6: found the end, expected a constraint"),
            ("a < b", "column 3: found `<`"),
        ] {
            let enough = if text.contains("trunk") && !text.ends_with(',') { ENOUGH } else { "" };
            let error = error(&format!("{text}{enough}"));
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
