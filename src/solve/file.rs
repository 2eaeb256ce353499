//! Hierarchies and quadratic programs as JSON, for checks against other solvers: the format of `hoof solve`.
//!
//! Matrices are row-major, null is an absent bound. A program may have the keys that `hoof replay --break --json` prints: `A`, `b` and `d`.

use anyhow::{anyhow, bail, ensure};
use controller::qp::Qp;
use controller::qp::hierarchy::{GeneralRows, Hierarchy, Law, Level, Selective, Sides};
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

/// A problem to solve.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// Levels of least squares.
    Hierarchy(Hierarchy),
    /// One program; the general rows are two-sided.
    Program(Box<Program>),
}

/// A quadratic program with two-sided rows and bounds: `min ½ xᵀHx + gᵀx`.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The program with one-sided rows.
    pub qp: Qp,
    /// The row of the file that each inequality row of `qp` comes from.
    pub row_of: Vec<usize>,
}

/// Numbers by row; `[]` for no rows.
type Matrix = Vec<Vec<f64>>;
/// Sides and bounds; null for none.
type Bounds = Vec<Option<Side>>;

/// A side; `hoof replay --break --json` writes infinite numbers as texts.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
enum Side {
    Number(f64),
    Text(Infinite),
}

#[derive(Clone, Copy, Debug, Deserialize)]
enum Infinite {
    #[serde(rename = "inf")]
    Positive,
    #[serde(rename = "-inf")]
    Negative,
}

impl From<Side> for f64 {
    fn from(side: Side) -> f64 {
        match side {
            Side::Number(number) => number,
            Side::Text(Infinite::Positive) => f64::INFINITY,
            Side::Text(Infinite::Negative) => f64::NEG_INFINITY,
        }
    }
}

/// The file of a hierarchy.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HierarchyFile {
    #[serde(default, rename = "kind")]
    _kind: Option<String>,
    n: usize,
    #[serde(default)]
    regularization: f64,
    lower: Option<Bounds>,
    upper: Option<Bounds>,
    #[serde(default, rename = "C")]
    c: Matrix,
    c_lower: Option<Bounds>,
    c_upper: Option<Bounds>,
    levels: Vec<LevelFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelFile {
    #[serde(rename = "A")]
    a: Matrix,
    b: Vec<f64>,
    weight: Option<Vec<f64>>,
    #[serde(default, rename = "C")]
    c: Matrix,
    c_lower: Option<Bounds>,
    c_upper: Option<Bounds>,
    law: Option<Law>,
    threshold: Option<f64>,
}

/// The file of a program.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProgramFile {
    #[serde(default, rename = "kind")]
    _kind: Option<String>,
    #[serde(rename = "H")]
    h: Matrix,
    g: Vec<f64>,
    #[serde(default, rename = "A_eq", alias = "A")]
    a_eq: Matrix,
    #[serde(default, alias = "b")]
    b_eq: Vec<f64>,
    #[serde(default, rename = "C")]
    c: Matrix,
    c_lower: Option<Bounds>,
    #[serde(alias = "d")]
    c_upper: Option<Bounds>,
    lower: Option<Bounds>,
    upper: Option<Bounds>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
    /// Present in a program.
    #[serde(rename = "H")]
    h: Option<serde::de::IgnoredAny>,
}

/// Largest number of variables and of rows of a matrix: the memory of a problem stays below a gigabyte.
const LARGEST: usize = 2000;
/// Largest relative difference of a Hessian from its transpose.
const SYMMETRIC: f64 = 1e-9;

impl Problem {
    /// Reads a problem.
    ///
    /// # Errors
    /// The text is not of the format, or a length or a number is wrong; the error names the key.
    pub fn from_json(text: &str) -> anyhow::Result<Self> {
        let kind: Kind = serde_json::from_str(text)?;
        let default = if kind.h.is_some() { "qp" } else { "hierarchy" };
        match kind.kind.as_deref().unwrap_or(default) {
            "hierarchy" => serde_json::from_str::<HierarchyFile>(text)?.read().map(Problem::Hierarchy),
            "qp" => {
                let program = serde_json::from_str::<ProgramFile>(text)?.read()?;
                Ok(Problem::Program(Box::new(program)))
            }
            other => bail!("kind: found {other:?}, expected \"hierarchy\" or \"qp\""),
        }
    }
}

impl HierarchyFile {
    fn read(self) -> anyhow::Result<Hierarchy> {
        let n = self.n;
        at_least("n", n, 1)?;
        at_least("levels", self.levels.len(), 1)?;
        if self.regularization < 0.0 {
            return Err(value("regularization", self.regularization, "a number that is not negative"));
        }
        let (lower, upper) = bounds(n, self.lower, self.upper)?;
        let mut general = GeneralRows::with_capacity(n, self.c.len());
        general_rows(&mut general, 0, "", (self.c, self.c_lower, self.c_upper), n)?;
        let mut levels = Vec::with_capacity(self.levels.len());
        for (k, file) in self.levels.into_iter().enumerate() {
            let key = |name: &str| format!("levels[{k}].{name}");
            let mut level = Level::with_capacity(n, file.a.len());
            same_length(&key("b"), file.b.len(), file.a.len())?;
            let weights = file.weight.unwrap_or_else(|| vec![1.0; file.a.len()]);
            same_length(&key("weight"), weights.len(), file.a.len())?;
            rows(&key("A"), &file.a, n)?;
            for ((a, b), weight) in file.a.iter().zip(file.b).zip(weights) {
                if weight <= 0.0 {
                    return Err(value(&key("weight"), weight, "a positive number"));
                }
                level.push(b, weight).copy_from_slice(a);
            }
            let prefix = format!("levels[{k}].");
            general_rows(&mut general, k, &prefix, (file.c, file.c_lower, file.c_upper), n)?;
            if let Some(threshold) = file.threshold {
                if threshold <= 0.0 || threshold >= 1.0 {
                    return Err(value(&key("threshold"), threshold, "a number between 0 and 1"));
                }
                level.selective = Some(Selective { law: file.law.unwrap_or(Law::Exact), threshold });
            }
            levels.push(level);
        }
        Ok(Hierarchy { regularization: self.regularization, lower, upper, general, levels })
    }
}

impl ProgramFile {
    fn read(self) -> anyhow::Result<Program> {
        let n = self.g.len();
        at_least("g", n, 1)?;
        same_length("H", self.h.len(), n)?;
        rows("H", &self.h, n)?;
        rows("A_eq", &self.a_eq, n)?;
        same_length("b_eq", self.b_eq.len(), self.a_eq.len())?;
        let (lower, upper) = bounds(n, self.lower, self.upper)?;
        let mut general = GeneralRows::with_capacity(n, self.c.len());
        general_rows(&mut general, 0, "", (self.c, self.c_lower, self.c_upper), n)?;
        let mut a = self.a_eq;
        let mut b = self.b_eq;
        let (mut c, mut d, mut row_of) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (row, sides)) in general.iter().enumerate() {
            if sides.is_equality() {
                a.push(row.to_vec());
                b.push(sides.upper);
                continue;
            }
            if sides.lower > f64::NEG_INFINITY {
                c.push(row.iter().map(|x| -x).collect());
                d.push(-sides.lower);
                row_of.push(i);
            }
            if sides.upper < f64::INFINITY {
                c.push(row.to_vec());
                d.push(sides.upper);
                row_of.push(i);
            }
        }
        let H = matrix(&self.h, n);
        let largest = H.amax();
        if let Some((i, j)) = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .find(|&(i, j)| (H[(i, j)] - H[(j, i)]).abs() > SYMMETRIC * largest)
        {
            return Err(value(&format!("H[{i}][{j}]"), H[(i, j)], "a symmetric matrix"));
        }
        let qp = Qp {
            H,
            g: DVector::from_vec(self.g),
            A: matrix(&a, n),
            b: DVector::from_vec(b),
            C: matrix(&c, n),
            d: DVector::from_vec(d),
            lower: DVector::from_vec(lower),
            upper: DVector::from_vec(upper),
        };
        Ok(Program { qp, row_of })
    }
}

fn matrix(rows: &Matrix, n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j])
}

fn value(key: &str, found: f64, expected: &str) -> anyhow::Error {
    anyhow!("{key}: found {found}, expected {expected}")
}

fn same_length(key: &str, found: usize, expected: usize) -> anyhow::Result<()> {
    ensure!(found == expected, "{key}: found {found} numbers or rows, expected {expected}");
    Ok(())
}

fn at_least(key: &str, found: usize, least: usize) -> anyhow::Result<()> {
    ensure!((least..=LARGEST).contains(&found), "{key}: found {found}, expected {least} to {LARGEST}");
    Ok(())
}

fn rows(key: &str, rows: &Matrix, n: usize) -> anyhow::Result<()> {
    at_least(key, rows.len(), 0)?;
    rows.iter().enumerate().try_for_each(|(i, row)| same_length(&format!("{key}[{i}]"), row.len(), n))
}

fn sides(key: &str, count: usize, found: Option<Bounds>, absent: f64) -> anyhow::Result<Vec<f64>> {
    let Some(found) = found else { return Ok(vec![absent; count]) };
    same_length(key, found.len(), count)?;
    Ok(found.into_iter().map(|side| side.map_or(absent, f64::from)).collect())
}

fn bounds(n: usize, lower: Option<Bounds>, upper: Option<Bounds>) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    Ok((sides("lower", n, lower, f64::NEG_INFINITY)?, sides("upper", n, upper, f64::INFINITY)?))
}

fn general_rows(
    to: &mut GeneralRows,
    from: usize,
    prefix: &str,
    (c, lower, upper): (Matrix, Option<Bounds>, Option<Bounds>),
    n: usize,
) -> anyhow::Result<()> {
    rows(&format!("{prefix}C"), &c, n)?;
    let lower = sides(&format!("{prefix}c_lower"), c.len(), lower, f64::NEG_INFINITY)?;
    let upper = sides(&format!("{prefix}c_upper"), c.len(), upper, f64::INFINITY)?;
    for (row, (lower, upper)) in c.iter().zip(lower.into_iter().zip(upper)) {
        to.push(Sides { lower, upper, from }).copy_from_slice(row);
    }
    Ok(())
}
