//! Constructors of [`RobotState`].

use crate::RobotState;

impl RobotState {
    /// A measurement with every number zero, apart from the IMUs: upright and at rest.
    ///
    /// - `nj`, `n_imus`, `n_ft`: numbers of joints, IMUs and force/torque sensors.
    pub fn zeros(nj: usize, n_imus: usize, n_ft: usize) -> Self {
        let zeros = || vec![0.0; nj];
        let count = |n: usize| i32::try_from(n).expect("robots have fewer than 2^31 parts");
        RobotState {
            nj: count(nj),
            q: zeros(),
            qd: zeros(),
            tau: zeros(),
            n_imus: count(n_imus),
            q_WI_wxyz: vec![[1.0, 0.0, 0.0, 0.0]; n_imus],
            w_WI_I: vec![[0.0; 3]; n_imus],
            a_I: vec![[0.0, 0.0, 9.81]; n_imus],
            n_ft: count(n_ft),
            f_S: vec![[0.0; 3]; n_ft],
            tau_S: vec![[0.0; 3]; n_ft],
            ..Default::default()
        }
    }
}
