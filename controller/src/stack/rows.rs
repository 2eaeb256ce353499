//! The rows of a task, preallocated and overwritten in every tick.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Rows `A x = b` of a task in a tick. Rows are switched on and off in blocks, for example the contact of one foot.
///
/// Blocks that are switched off keep their place; their rows are 0.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Left side, rows x variables: accelerations, and forces if a row has a force.
    pub A: DMatrix<f64>,
    /// Right side, m/s², rad/s² or N.
    pub b: DVector<f64>,
    blocks: Vec<Block>,
}

#[derive(Clone, Debug)]
struct Block {
    rows: Range<usize>,
    cols: Vec<usize>,
    on: bool,
}

impl Rows {
    /// Allocates blocks, each given by its number of rows and the columns that may be non-zero. All blocks are switched off.
    ///
    /// - `variables`: number of leading variables in which rows may be non-zero.
    pub fn new(variables: usize, blocks: impl IntoIterator<Item = (usize, Vec<usize>)>) -> Self {
        let mut placed = Vec::new();
        let mut n = 0;
        for (rows, cols) in blocks {
            placed.push(Block { rows: n..n + rows, cols, on: false });
            n += rows;
        }
        Rows { A: DMatrix::zeros(n, variables), b: DVector::zeros(n), blocks: placed }
    }

    /// One row `vd[col] = b` for each column; all are switched on.
    pub fn selection(nv: usize, cols: impl IntoIterator<Item = usize>) -> Self {
        let cols: Vec<usize> = cols.into_iter().collect();
        let mut rows = Rows::new(nv, cols.iter().map(|&col| (1, vec![col])));
        for (row, col) in cols.into_iter().enumerate() {
            rows.A[(row, col)] = 1.0;
            rows.blocks[row].on = true;
        }
        rows
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.b.len()
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.b.is_empty()
    }

    /// Switches a block on (the caller then writes its rows) or off (its rows become 0).
    pub fn switch(&mut self, block: usize, on: bool) {
        let Block { rows, on: was, .. } = &mut self.blocks[block];
        *was = on;
        if !on {
            self.A.rows_mut(rows.start, rows.len()).fill(0.0);
            self.b.rows_mut(rows.start, rows.len()).fill(0.0);
        }
    }

    /// Switches a block on with rows of 0 and no columns. [`Rows::add_column`] adds them: for tasks whose columns change with the state.
    pub fn restart(&mut self, block: usize) {
        self.switch(block, false);
        let Block { cols, on, .. } = &mut self.blocks[block];
        cols.clear();
        *on = true;
    }

    /// Adds a column in which a block may be non-zero, and returns the entries of its rows. Does not allocate if the block was made with enough columns.
    pub fn add_column(&mut self, block: usize, col: usize) -> &mut [f64] {
        let height = self.A.nrows();
        let Block { rows, cols, .. } = &mut self.blocks[block];
        cols.push(col);
        &mut self.A.as_mut_slice()[col * height + rows.start..col * height + rows.end]
    }

    /// Whether a block is switched on.
    pub fn is_on(&self, block: usize) -> bool {
        self.blocks[block].on
    }

    /// Calls `give` for every row that is switched on and has `takes`, with its right side and its entries (variable, number).
    pub(super) fn each(&self, takes: &[bool], mut give: impl FnMut(f64, &mut dyn Iterator<Item = (usize, f64)>)) {
        for block in self.blocks.iter().filter(|block| block.on) {
            for row in block.rows.clone().filter(|&row| takes[row]) {
                give(self.b[row], &mut block.cols.iter().map(|&col| (col, self.A[(row, col)])));
            }
        }
    }

    /// Adds half of `weight |A x - b|²`, over the rows with `takes`, to the upper triangle of a Hessian and to a gradient.
    ///
    /// Products are summed over the rows of a block first, then multiplied by the weight, then added.
    pub(super) fn accumulate(&self, weight: f64, takes: &[bool], H: &mut DMatrix<f64>, g: &mut DVector<f64>) {
        for block in self.blocks.iter().filter(|block| block.on) {
            let taken = || block.rows.clone().filter(|&row| takes[row]);
            for &j in &block.cols {
                for &i in block.cols.iter().filter(|&&i| i <= j) {
                    H[(i, j)] += weight * taken().fold(0.0, |sum, row| sum + self.A[(row, i)] * self.A[(row, j)]);
                }
                g[j] -= weight * taken().fold(0.0, |sum, row| sum + self.A[(row, j)] * self.b[row]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_equations_contain_only_the_selected_rows() {
        let mut rows = Rows::new(3, [(2, vec![0, 2]), (1, vec![1])]);
        rows.switch(0, true);
        rows.A.row_mut(0).copy_from_slice(&[1.0, 0.0, 2.0]);
        rows.A.row_mut(1).copy_from_slice(&[3.0, 0.0, -1.0]);
        rows.b.copy_from_slice(&[4.0, 5.0, 6.0]);
        let normal = |takes: [bool; 3]| {
            let (mut H, mut g) = (DMatrix::zeros(3, 3), DVector::zeros(3));
            rows.accumulate(2.0, &takes, &mut H, &mut g);
            (H, g)
        };
        let (H, g) = normal([true; 3]);
        assert_eq!(H, DMatrix::from_row_slice(3, 3, &[20.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 10.0]));
        assert_eq!(g, DVector::from_row_slice(&[-38.0, 0.0, -6.0]));
        let (H, g) = normal([true, false, true]);
        assert_eq!((H[(0, 0)], H[(0, 2)], H[(2, 2)], g[0], g[2]), (2.0, 4.0, 8.0, -8.0, -16.0));
    }

    /// Columns of an earlier tick are neither read nor left non-zero.
    #[test]
    fn a_restarted_block_has_only_the_columns_that_are_added() {
        let mut rows = Rows::new(3, [(1, vec![0]), (2, vec![0, 1, 2])]);
        rows.restart(1);
        rows.add_column(1, 0).copy_from_slice(&[7.0, 8.0]);
        rows.restart(1);
        rows.add_column(1, 2).copy_from_slice(&[1.0, 2.0]);
        rows.b.copy_from_slice(&[0.0, 3.0, 4.0]);
        assert_eq!(rows.A, DMatrix::from_row_slice(3, 3, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0]));
        let (mut H, mut g) = (DMatrix::zeros(3, 3), DVector::zeros(3));
        rows.accumulate(1.0, &[true; 3], &mut H, &mut g);
        assert_eq!((H.sum(), H[(2, 2)], g[0], g[2]), (5.0, 5.0, 0.0, -11.0));
    }

    #[test]
    fn a_block_that_is_off_adds_nothing() {
        let mut rows = Rows::selection(2, [1, 0]);
        rows.b.fill(3.0);
        rows.switch(1, false);
        let (mut H, mut g) = (DMatrix::zeros(2, 2), DVector::zeros(2));
        rows.accumulate(1.0, &[true; 2], &mut H, &mut g);
        assert_eq!((H[(0, 0)], H[(1, 1)], g[0], g[1]), (0.0, 1.0, 0.0, -3.0));
        assert_eq!((rows.b[1], rows.A[(1, 0)]), (0.0, 0.0));
    }
}
