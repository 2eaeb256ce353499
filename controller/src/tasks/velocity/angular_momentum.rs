//! Angular momentum of the robot about its centre of mass, `A_G v = l_des`: the angular rows of the centroidal momentum matrix.
//!
//! Source: D. E. Orin, A. Goswami, S.-H. Lee, *Centroidal dynamics of a humanoid robot* (2013).

use crate::model::centroidal_momentum_matrix;
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{DMatrix, Vector3};

/// The task: three rows, N m s, in W axes.
pub struct AngularMomentum {
    /// Joints whose columns stay 0, by velocity index.
    pub disabled: Vec<usize>,
    A_G: DMatrix<f64>,
}

impl AngularMomentum {
    /// Of the whole robot.
    pub fn new(of: &Structure<'_>) -> Self {
        AngularMomentum { disabled: Vec::new(), A_G: DMatrix::from_element(6, of.model.nv(), f64::NAN) }
    }
}

impl Task for AngularMomentum {
    /// Angular momentum about the centre of mass, in W axes, N m s.
    type Reference = Vector3<f64>;

    fn size(&self) -> usize {
        3
    }

    /// One dense block of three.
    fn rows(&self) -> Rows {
        let nv = self.A_G.ncols();
        let mut rows = Rows::new(nv, [(3, (0..nv).collect())]);
        rows.switch(0, true);
        rows
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &Vector3<f64>, rows: &mut Rows) {
        centroidal_momentum_matrix(state.model, state.kin, &mut self.A_G);
        rows.A.copy_from(&self.A_G.rows(3, 3));
        for &col in &self.disabled {
            rows.A.column_mut(col).fill(0.0);
        }
        rows.b.copy_from(reference);
    }
}
