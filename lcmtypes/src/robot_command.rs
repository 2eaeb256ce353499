//! Constructors of [`RobotCommand`].

use crate::RobotCommand;

impl RobotCommand {
    /// A command for `nj` joints with every number zero: time and tick 0, `MODE_IDLE`.
    pub fn zeros(nj: usize) -> Self {
        let zeros = || vec![0.0; nj];
        RobotCommand {
            nj: i32::try_from(nj).expect("robots have fewer than 2^31 joints"),
            tau: zeros(),
            q_des: zeros(),
            qd_des: zeros(),
            kp: zeros(),
            kd: zeros(),
            ..Default::default()
        }
    }

    /// A command that damps each joint with its `kd` (N m s/rad) and applies no other torque.
    pub fn damping(kd: Vec<f64>) -> Self {
        let zeros = Self::zeros(kd.len());
        RobotCommand { mode: Self::MODE_DAMPING, kd, ..zeros }
    }
}
