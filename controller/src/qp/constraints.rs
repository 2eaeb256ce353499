//! Rows and bounds of a program in the form that the active-set solver uses: non-zero rows, over the coupled variables.

use super::hierarchy::Hierarchy;
use super::program::{Qp, QpRow, Unsolved};
use crate::dense::dot;
use std::ops::Range;

/// Constraints `n x ≤ side`, or `=` for the first [`Constraints::n_eq`]. Order: rows, then lower bounds by place, then upper bounds by place.
/// Rows are scaled to norm 1, so that the choice of the most violated row does not depend on units. An inequality row is scaled when it is violated for the
/// first time: most rows never are.
pub(super) struct Constraints {
    /// Columns in which each inequality row may have non-zero numbers.
    pattern: Vec<Vec<usize>>,
    /// Variable of each place.
    variables: Vec<usize>,
    /// Place of each variable, if it has one.
    place_of: Vec<Option<usize>>,
    /// Equality rows by place, concatenated.
    equalities: Vec<f64>,
    /// Start of each inequality row in `places` and `values`; the last entry is the end.
    starts: Vec<usize>,
    places: Vec<usize>,
    values: Vec<f64>,
    sides: Vec<f64>,
    rows: Vec<QpRow>,
    /// Whether a row has norm 1.
    is_scaled: Vec<bool>,
    n_eq: usize,
    lower: Vec<f64>,
    upper: Vec<f64>,
    in_set: Vec<bool>,
}

/// Largest violation allowed for a row of zeros.
const ROUNDING: f64 = 1e-9;

impl Constraints {
    /// Allocates memory for the rows of `pattern`.
    pub fn new(pattern: &Qp) -> Self {
        let (n, rows) = (pattern.n(), pattern.b.len() + pattern.d.len());
        let of_row = |row: usize| (0..n).filter(|&col| pattern.C[(row, col)] != 0.0).collect();
        Constraints {
            pattern: (0..pattern.d.len()).map(of_row).collect(),
            variables: Vec::with_capacity(n),
            place_of: vec![None; n],
            equalities: Vec::with_capacity(pattern.b.len() * n),
            starts: Vec::with_capacity(rows + 1),
            places: Vec::with_capacity(rows * n),
            values: Vec::with_capacity(rows * n),
            sides: Vec::with_capacity(rows),
            rows: Vec::with_capacity(rows),
            is_scaled: Vec::with_capacity(rows),
            n_eq: 0,
            lower: Vec::with_capacity(n),
            upper: Vec::with_capacity(n),
            in_set: Vec::with_capacity(rows + 2 * n),
        }
    }

    /// Allocates memory for `rows` inequality rows in `n` variables, which [`Constraints::take_general`] loads.
    pub fn with_capacity(n: usize, rows: usize) -> Self {
        Constraints::new(&Qp::zeros(n, 0, rows))
    }

    /// Loads bounds and the inequalities of general rows down to a level; the places are the variables. No constraint is in the working set
    /// afterwards.
    ///
    /// # Errors
    /// Contradicting bounds; non-finite numbers; a violated row of zeros.
    pub fn take_general(&mut self, problem: &Hierarchy, level: usize) -> Result<(), Unsolved> {
        let n = problem.n();
        if let Some(i) = (0..n).find(|&i| problem.lower[i] > problem.upper[i]) {
            return Err(Unsolved::infeasible(QpRow::Lower(i)));
        }
        if problem.lower.iter().chain(&problem.upper).any(|bound| bound.is_nan()) {
            return Err(Unsolved::failed());
        }
        self.clear_rows();
        self.variables.extend(0..n);
        self.lower.extend(&problem.lower);
        self.upper.extend(&problem.upper);
        for (i, (c, sides)) in problem.general.iter().enumerate() {
            if sides.from > level || sides.is_equality() {
                continue;
            }
            for (sign, side) in [(-1.0, -sides.lower), (1.0, sides.upper)] {
                if side != f64::INFINITY {
                    for (place, value) in c.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                        self.places.push(place);
                        self.values.push(sign * value);
                    }
                    self.end_row(side, QpRow::Inequality(i))?;
                }
            }
        }
        self.in_set.resize(self.rows.len() + 2 * n, false);
        Ok(())
    }

    /// Moves the sides of inequalities that `x` violates, so that `x` fulfils them: the solution of a level above, which fulfils them up to rounding errors.
    pub fn include(&mut self, x: &[f64]) {
        for (lower, x) in self.lower.iter_mut().zip(x) {
            *lower = lower.min(*x);
        }
        for (upper, x) in self.upper.iter_mut().zip(x) {
            *upper = upper.max(*x);
        }
        for i in self.n_eq..self.rows.len() {
            let excess = self.excess(i, x);
            if excess > 0.0 {
                self.sides[i] += excess;
            }
        }
    }

    fn clear_rows(&mut self) {
        self.n_eq = 0;
        self.variables.clear();
        for numbers in [&mut self.lower, &mut self.upper, &mut self.values, &mut self.sides] {
            numbers.clear();
        }
        self.places.clear();
        self.rows.clear();
        self.is_scaled.clear();
        self.starts.clear();
        self.starts.push(0);
        self.in_set.clear();
    }

    /// Completes an inequality row whose numbers were added to `places` and `values`.
    fn end_row(&mut self, side: f64, name: QpRow) -> Result<(), Unsolved> {
        let start = self.starts[self.rows.len() - self.n_eq];
        let values = &self.values[start..];
        let size = dot(values, values);
        if size == 0.0 || !size.is_finite() || side.is_nan() {
            // An error, or a row of zeros that any `x` fulfils.
            scaled(values, side, name)?;
            self.values.truncate(start);
            self.places.truncate(start);
            return Ok(());
        }
        self.sides.push(side);
        self.rows.push(name);
        self.is_scaled.push(false);
        self.starts.push(self.places.len());
        Ok(())
    }

    /// Loads the rows of a program. `places` lists the variable of each place. No constraint is in the working set afterwards.
    ///
    /// # Errors
    /// Non-finite numbers; a violated row of zeros.
    pub fn take(&mut self, qp: &Qp, places: &[usize]) -> Result<(), Unsolved> {
        self.clear_rows();
        self.variables.extend(places);
        self.place_of.fill(None);
        for (place, &i) in places.iter().enumerate() {
            self.place_of[i] = Some(place);
        }
        self.lower.extend(places.iter().map(|&i| qp.lower[i]));
        self.upper.extend(places.iter().map(|&i| qp.upper[i]));
        self.take_equalities(qp, places)?;
        for row in 0..qp.d.len() {
            for &col in &self.pattern[row] {
                if let Some(place) = self.place_of[col] {
                    let value = qp.C.as_slice()[col * qp.d.len() + row];
                    if value != 0.0 {
                        self.places.push(place);
                        self.values.push(value);
                    }
                }
            }
            self.end_row(qp.d[row], QpRow::Inequality(row))?;
        }
        self.in_set.resize(self.rows.len() + 2 * places.len(), false);
        Ok(())
    }

    fn take_equalities(&mut self, qp: &Qp, places: &[usize]) -> Result<(), Unsolved> {
        let (n, rows) = (places.len(), qp.b.len());
        if rows == 0 {
            return Ok(());
        }
        self.equalities.clear();
        self.equalities.resize(rows * n, 0.0);
        for (place, &i) in places.iter().enumerate() {
            let column = &qp.A.as_slice()[i * rows..(i + 1) * rows];
            for (value, to) in column.iter().zip(self.equalities[place..].iter_mut().step_by(n)) {
                *to = *value;
            }
        }
        for row in 0..rows {
            let from = row * n..(row + 1) * n;
            let Some((inverse, side)) = scaled(&self.equalities[from.clone()], qp.b[row], QpRow::Equality(row))? else {
                continue;
            };
            let to = self.n_eq * n;
            self.equalities.copy_within(from, to);
            self.equalities[to..to + n].iter_mut().for_each(|value| *value *= inverse);
            self.sides.push(side);
            self.rows.push(QpRow::Equality(row));
            self.is_scaled.push(true);
            self.n_eq += 1;
        }
        Ok(())
    }

    /// An equality row by places.
    pub fn equality(&self, i: usize) -> &[f64] {
        let n = self.lower.len();
        &self.equalities[i * n..(i + 1) * n]
    }

    /// Range of an inequality row in `places` and `values`.
    fn inequality(&self, i: usize) -> Range<usize> {
        self.starts[i - self.n_eq]..self.starts[i - self.n_eq + 1]
    }

    /// Number of equality rows.
    pub fn n_eq(&self) -> usize {
        self.n_eq
    }

    /// Number of places.
    pub fn n(&self) -> usize {
        self.variables.len()
    }

    /// The row or bound of the program that a constraint belongs to.
    pub fn name(&self, i: usize) -> QpRow {
        match i.checked_sub(self.rows.len()) {
            None => self.rows[i],
            Some(bound) if bound < self.n() => QpRow::Lower(self.variables[bound]),
            Some(bound) => QpRow::Upper(self.variables[bound - self.n()]),
        }
    }

    /// Writes a row by place. Returns the range outside which it is 0.
    pub fn load(&self, i: usize, row: &mut [f64]) -> Range<usize> {
        let n = self.lower.len();
        if i < self.n_eq {
            row[..n].copy_from_slice(self.equality(i));
            return 0..n;
        }
        row[..n].fill(0.0);
        match i.checked_sub(self.rows.len()) {
            None => {
                let of_row = self.inequality(i);
                let (mut first, mut last) = (n, 0);
                for (&place, value) in self.places[of_row.clone()].iter().zip(&self.values[of_row]) {
                    row[place] = *value;
                    (first, last) = (first.min(place), last.max(place));
                }
                first..last + 1
            }
            Some(bound) => {
                let (place, sign) = if bound < n { (bound, -1.0) } else { (bound - n, 1.0) };
                row[place] = sign;
                place..place + 1
            }
        }
    }

    /// Violation of a constraint at `x`; signed for an equality row.
    pub fn excess(&self, i: usize, x: &[f64]) -> f64 {
        let n = self.lower.len();
        if i < self.n_eq {
            return dot(self.equality(i), x) - self.sides[i];
        }
        match i.checked_sub(self.rows.len()) {
            None => {
                let of_row = self.inequality(i);
                let terms = self.places[of_row.clone()].iter().zip(&self.values[of_row]);
                terms.fold(0.0, |sum, (&place, value)| sum + value * x[place]) - self.sides[i]
            }
            Some(bound) if bound < n => self.lower[bound] - x[bound],
            Some(bound) => x[bound - n] - self.upper[bound - n],
        }
    }

    /// The inequality outside the working set that `x` violates most and by more than `tolerance`; the first one of a tie.
    pub fn worst(&mut self, x: &[f64], tolerance: f64) -> Option<usize> {
        let (rows, n) = (self.rows.len(), self.lower.len());
        for i in self.n_eq..rows {
            if !self.is_scaled[i] && self.excess(i, x) > 0.0 {
                self.scale(i);
            }
        }
        let (mut most, mut worst) = (tolerance, None);
        let mut check = |i: usize, excess: f64| {
            if excess > most && !self.in_set[i] {
                (most, worst) = (excess, Some(i));
            }
        };
        for i in self.n_eq..rows {
            if self.is_scaled[i] {
                check(i, self.excess(i, x));
            }
        }
        for (place, (lower, x)) in self.lower.iter().zip(x).enumerate() {
            check(rows + place, lower - x);
        }
        for (place, (upper, x)) in self.upper.iter().zip(x).enumerate() {
            check(rows + n + place, x - upper);
        }
        worst
    }

    /// Scales an inequality row to norm 1.
    fn scale(&mut self, i: usize) {
        let of_row = self.inequality(i);
        let values = &mut self.values[of_row];
        let size = dot(values, values).sqrt();
        self.is_scaled[i] = true;
        let inverse = 1.0 / size;
        values.iter_mut().for_each(|value| *value *= inverse);
        self.sides[i] /= size;
    }

    /// Marks a constraint as part of the working set.
    pub fn set_active(&mut self, i: usize) {
        self.in_set[i] = true;
    }

    /// Marks all constraints as not part of the working set.
    pub fn clear_active(&mut self) {
        self.in_set.fill(false);
    }

    /// Marks a constraint as not part of the working set.
    pub fn set_inactive(&mut self, i: usize) {
        self.in_set[i] = false;
    }
}

/// The inverse of a row's norm, and its side divided by the norm; `None` for a row of zeros.
fn scaled(values: &[f64], side: f64, row: QpRow) -> Result<Option<(f64, f64)>, Unsolved> {
    let size = dot(values, values).sqrt();
    if !size.is_finite() || side.is_nan() {
        return Err(Unsolved::failed());
    }
    if size > 0.0 {
        return Ok(Some((1.0 / size, side / size)));
    }
    let violated = if matches!(row, QpRow::Equality(_)) { side.abs() } else { -side };
    if violated > ROUNDING { Err(Unsolved::infeasible(row)) } else { Ok(None) }
}
