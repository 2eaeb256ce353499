//! The rows and bounds of a program as the active-set solver walks over them: those that say something, over the variables that couple.

use super::active_set::Trouble;
use super::dense::dot;
use super::{Qp, QpRow};
use std::ops::Range;

/// Constraints `n x ≤ side`, `=` for the first [`Constraints::n_eq`], by number: rows, then lower bounds, then upper bounds by place. Rows are
/// scaled to length 1, so that no unit decides which is violated most.
pub(super) struct Constraints {
    /// Columns in which each inequality row may have numbers.
    pattern: Vec<Vec<usize>>,
    /// Place of each variable, if it has one.
    place_of: Vec<Option<usize>>,
    /// Where the numbers of each row begin in `places` and `values`, and where the last ends.
    starts: Vec<usize>,
    places: Vec<usize>,
    values: Vec<f64>,
    sides: Vec<f64>,
    rows: Vec<QpRow>,
    n_eq: usize,
    lower: Vec<f64>,
    upper: Vec<f64>,
    in_set: Vec<bool>,
}

/// Violation that a row of zeros may have.
const ROUNDING: f64 = 1e-9;

impl Constraints {
    /// Memory for the rows of `pattern`.
    pub fn new(pattern: &Qp) -> Self {
        let (n, rows) = (pattern.n(), pattern.b.len() + pattern.d.len());
        let of_row = |row: usize| (0..n).filter(|&col| pattern.C[(row, col)] != 0.0).collect();
        Constraints {
            pattern: (0..pattern.d.len()).map(of_row).collect(),
            place_of: vec![None; n],
            starts: Vec::with_capacity(rows + 1),
            places: Vec::with_capacity(rows * n),
            values: Vec::with_capacity(rows * n),
            sides: Vec::with_capacity(rows),
            rows: Vec::with_capacity(rows),
            n_eq: 0,
            lower: Vec::with_capacity(n),
            upper: Vec::with_capacity(n),
            in_set: Vec::with_capacity(rows + 2 * n),
        }
    }

    /// Takes over the rows of a program whose variables stand at `places`, none in the set.
    ///
    /// # Errors
    /// Numbers that are none; a violated row of zeros.
    pub fn take(&mut self, qp: &Qp, places: &[usize]) -> Result<(), Trouble> {
        self.place_of.fill(None);
        for (place, &i) in places.iter().enumerate() {
            self.place_of[i] = Some(place);
        }
        for numbers in [&mut self.lower, &mut self.upper, &mut self.values, &mut self.sides] {
            numbers.clear();
        }
        self.lower.extend(places.iter().map(|&i| qp.lower[i]));
        self.upper.extend(places.iter().map(|&i| qp.upper[i]));
        self.places.clear();
        self.rows.clear();
        self.starts.clear();
        self.starts.push(0);
        for row in 0..qp.b.len() {
            for (place, &col) in places.iter().enumerate() {
                self.enter(place, qp.A[(row, col)]);
            }
            self.close(qp.b[row], QpRow::Equality(row))?;
        }
        self.n_eq = self.rows.len();
        for row in 0..qp.d.len() {
            for k in 0..self.pattern[row].len() {
                let col = self.pattern[row][k];
                if let Some(place) = self.place_of[col] {
                    self.enter(place, qp.C[(row, col)]);
                }
            }
            self.close(qp.d[row], QpRow::Inequality(row))?;
        }
        self.in_set.clear();
        self.in_set.resize(self.rows.len() + 2 * places.len(), false);
        Ok(())
    }

    fn enter(&mut self, place: usize, value: f64) {
        if value != 0.0 {
            self.places.push(place);
            self.values.push(value);
        }
    }

    /// Ends a row whose numbers have been entered.
    fn close(&mut self, side: f64, row: QpRow) -> Result<(), Trouble> {
        let values = &mut self.values[self.starts[self.rows.len()]..];
        let size = dot(values, values).sqrt();
        if !size.is_finite() || side.is_nan() {
            return Err(Trouble::failed());
        }
        if size == 0.0 {
            let violated = if matches!(row, QpRow::Equality(_)) { side.abs() } else { -side };
            return if violated > ROUNDING { Err(Trouble::infeasible(row)) } else { Ok(()) };
        }
        let inverse = 1.0 / size;
        values.iter_mut().for_each(|value| *value *= inverse);
        self.sides.push(side * inverse);
        self.rows.push(row);
        self.starts.push(self.places.len());
        Ok(())
    }

    /// Number of equality rows.
    pub fn n_eq(&self) -> usize {
        self.n_eq
    }

    /// Which row or bound of the program a constraint is.
    pub fn name(&self, i: usize, places: &[usize]) -> QpRow {
        let rows = self.rows.len();
        match i.checked_sub(rows) {
            None => self.rows[i],
            Some(bound) if bound < places.len() => QpRow::Lower(places[bound]),
            Some(bound) => QpRow::Upper(places[bound - places.len()]),
        }
    }

    /// Writes the numbers of a row; gives where those other than 0 stand.
    pub fn load(&self, i: usize, row: &mut [f64]) -> Range<usize> {
        row.fill(0.0);
        let n = self.lower.len();
        match i.checked_sub(self.rows.len()) {
            None => {
                let of_row = self.starts[i]..self.starts[i + 1];
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

    /// By how much `x` violates a constraint; of an equality row, signed.
    pub fn excess(&self, i: usize, x: &[f64]) -> f64 {
        let n = self.lower.len();
        match i.checked_sub(self.rows.len()) {
            None => {
                let of_row = self.starts[i]..self.starts[i + 1];
                let terms = self.places[of_row.clone()].iter().zip(&self.values[of_row]);
                terms.fold(0.0, |sum, (&place, value)| sum + value * x[place]) - self.sides[i]
            }
            Some(bound) if bound < n => self.lower[bound] - x[bound],
            Some(bound) => x[bound - n] - self.upper[bound - n],
        }
    }

    /// The inequality outside the set that `x` violates most, and by more than `tolerance`; of equal ones the first.
    pub fn worst(&self, x: &[f64], tolerance: f64) -> Option<usize> {
        let (mut most, mut worst) = (tolerance, None);
        let mut look = |i: usize, excess: f64| {
            if excess > most && !self.in_set[i] {
                (most, worst) = (excess, Some(i));
            }
        };
        let (rows, n) = (self.rows.len(), self.lower.len());
        for i in self.n_eq..rows {
            look(i, self.excess(i, x));
        }
        for (place, (lower, x)) in self.lower.iter().zip(x).enumerate() {
            look(rows + place, lower - x);
        }
        for (place, (upper, x)) in self.upper.iter().zip(x).enumerate() {
            look(rows + n + place, x - upper);
        }
        worst
    }

    /// Notes that a constraint is in the set.
    pub fn take_in(&mut self, i: usize) {
        self.in_set[i] = true;
    }

    /// Notes that it has left.
    pub fn let_go(&mut self, i: usize) {
        self.in_set[i] = false;
    }
}
