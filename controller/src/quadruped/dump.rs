//! Every quantity of the last tick by name, for who looks into a replay. Not for use in a tick: it allocates.

use super::controller::{Quadruped, Scratch};
use super::fields::Part;
use super::leg::Leg;
use super::state::Mode;
use crate::dump::{Dump, Quantity};
use crate::qp::Qp;
use crate::stack::Level;
use nalgebra::DVector;

/// Slack of a row or bound below which it counts as active.
const ACTIVE: f64 = 1e-6;

impl Quadruped {
    /// What the last tick computed, as far as it came: a tick that is damped from its beginning has no stage but its output.
    pub(super) fn quantities(&self) -> Dump {
        let output = self.state.dump_joints(Part::Output, self.state.dump(Part::Output, Quantity::group()));
        // A stage that ran has left its digest.
        let ran = &self.messages.tick;
        let mut stages = Quantity::group();
        if ran.digest_estimation != 0 {
            stages = stages.with("estimation", self.estimation());
        }
        if ran.digest_gait != 0 {
            stages = stages.with("gait", self.gait());
        }
        if ran.digest_tasks != 0 {
            stages = stages.with("tasks", self.tasks());
        }
        if ran.digest_qp != 0 {
            stages = stages.with("qp", self.qp());
        }
        Dump(stages.with("output", output))
    }

    fn estimation(&self) -> Quantity {
        let Scratch { estimate, .. } = &self.scratch;
        let legs = by_leg(|leg| {
            let of_leg = &estimate.legs[leg];
            let group = Quantity::group()
                .with("p_BF_W", &of_leg.p_BF_W)
                .with("p_hip_W", &of_leg.p_hip_W)
                .with("J", &of_leg.J)
                .with("a_bias_W", &of_leg.a_bias_W);
            self.state.dump_leg(Part::Estimation, leg, group)
        });
        let group = Quantity::group()
            .with("R_WB", &estimate.base.R_WB)
            .with("rpy", estimate.base.rpy)
            .with("w_WB_W", &estimate.base.w_WB_W)
            .with("yaw_rate", estimate.base.yaw_rate)
            .with("n_W", &estimate.n_W);
        self.state.dump(Part::Estimation, group).with("legs", legs).with("M", &estimate.M).with("h", &estimate.h)
    }

    fn gait(&self) -> Quantity {
        let (state, references) = (&self.state, &self.scratch.references);
        if matches!(state.mode, Mode::StandUp | Mode::Sit) {
            return state.dump_joints(Part::StandSit, state.dump(Part::StandSit, Quantity::group()));
        }
        let legs = by_leg(|leg| {
            state
                .dump_leg(Part::Gait, leg, Quantity::group())
                .with("foothold_H", &references.foothold_H[leg])
                .with("p_BF_H_des", &references.p_BF_H[leg])
                .with("v_BF_H_des", &references.v_BF_H[leg])
        });
        state.dump_joints(Part::Gait, state.dump(Part::Gait, Quantity::group()).with("legs", legs))
    }

    fn tasks(&self) -> Quantity {
        let Scratch { wbc, trunk, .. } = &self.scratch;
        let rows = wbc.tasks.names().zip(&wbc.tasks.rows).fold(Quantity::group(), |group, (name, rows)| {
            group.with(name, Quantity::group().with("A", &rows.A).with("b", &rows.b))
        });
        let levels: Vec<Quantity> = (0..wbc.stack.levels.len()).map(|k| program(&wbc.program(k))).collect();
        Quantity::group()
            .with("R_WB_des", &trunk.R_WB)
            .with("w_WB_W_des", &trunk.w_WB_W)
            .with("e_o_W", &wbc.tasks.e_o_W)
            .with("wd_trunk", &wbc.tasks.wd_trunk)
            .with("qdd_posture", &wbc.tasks.qdd_posture)
            .with("f_z_bounds", by_leg(|leg| [wbc.f_z_bounds[leg].0, wbc.f_z_bounds[leg].1].into()))
            .with("rows", rows)
            .with("levels", levels)
    }

    fn qp(&self) -> Quantity {
        let Scratch { wbc, estimate, .. } = &self.scratch;
        let names: Vec<&str> = wbc.tasks.names().collect();
        let row_names = wbc.row_names(&self.robot);
        let constraints = &wbc.stack.levels[0].qp;
        let level = |level: &Level| {
            let terms: Vec<Quantity> = level
                .terms
                .iter()
                .map(|term| {
                    let rows = &wbc.tasks.rows[term.task];
                    Quantity::group()
                        .with("task", names[term.task])
                        .with("weight", term.weight)
                        .with("residual", residual(&rows.A, &rows.b, &term.takes, &wbc.vd))
                })
                .collect();
            let status = level.info.map_or("NotRun".to_owned(), |info| format!("{:?}", info.status));
            let mut group = Quantity::group().with("status", status);
            if let Some(info) = level.info {
                group = group.with("iterations", info.iterations).with("n_active", count(info.n_active));
            }
            let mut active: Vec<Quantity> = Vec::new();
            if level.solved() {
                let named = |names: &[String], i: usize| names.get(i).cloned().unwrap_or_else(|| format!("row {i}"));
                for (i, d) in constraints.d.iter().enumerate() {
                    let row = constraints.C.row(i);
                    let left = row.iter().zip(&level.x).fold(0.0, |sum, (c, x)| sum + c * x);
                    if row.iter().any(|c| *c != 0.0) && d - left < ACTIVE {
                        active.push(named(&row_names.inequalities, i).into());
                    }
                }
                for i in 0..level.x.len() {
                    for (which, slack) in
                        [("lower", level.x[i] - constraints.lower[i]), ("upper", constraints.upper[i] - level.x[i])]
                    {
                        if slack < ACTIVE {
                            active.push(format!("{which} bound of {}", named(&row_names.variables, i)).into());
                        }
                    }
                }
            }
            group.with("terms", terms).with("active", active).with("x", &level.x)
        };
        let levels: Vec<Quantity> = wbc.stack.levels.iter().map(level).collect();
        let [contact, trunk, posture] =
            if wbc.solved() { wbc.tasks.residuals(&wbc.vd, estimate, &self.state) } else { [f64::NAN; 3] };
        let residuals = Quantity::group().with("contact", contact).with("trunk", trunk).with("posture", posture);
        let mut group = Quantity::group()
            .with("solved", wbc.solved())
            .with("iterations", wbc.info.iterations)
            .with("residuals", residuals)
            .with("f_F_W", by_leg(|leg| (&wbc.f_F_W[leg]).into()))
            .with("vd", &wbc.vd)
            .with("tau", &wbc.tau)
            .with("levels", levels);
        if let Some((level, conflict)) = self.explain() {
            let conflict: Vec<Quantity> = conflict
                .iter()
                .map(|c| Quantity::group().with("constraint", c.name.as_str()).with("by", c.by))
                .collect();
            group = group.with("conflict_level", count(level)).with("conflict", conflict);
        }
        group
    }
}

/// Norm of `A vd - b` over the rows taken.
fn residual(A: &nalgebra::DMatrix<f64>, b: &DVector<f64>, takes: &[bool], vd: &DVector<f64>) -> f64 {
    let mut sum = 0.0;
    for row in (0..b.len()).filter(|row| takes[*row]) {
        let left = A.row(row).iter().zip(vd).fold(0.0, |sum, (a, v)| sum + a * v);
        sum += (left - b[row]) * (left - b[row]);
    }
    sum.sqrt()
}

fn program(qp: &Qp) -> Quantity {
    Quantity::group()
        .with("H", &qp.H)
        .with("g", &qp.g)
        .with("A", &qp.A)
        .with("b", &qp.b)
        .with("C", &qp.C)
        .with("d", &qp.d)
        .with("lower", &qp.lower)
        .with("upper", &qp.upper)
}

fn by_leg(quantity: impl Fn(Leg) -> Quantity) -> Quantity {
    Leg::ALL.into_iter().fold(Quantity::group(), |group, leg| group.with(leg.name(), quantity(leg)))
}

fn count(n: usize) -> Quantity {
    Quantity::Integer(i64::try_from(n).unwrap_or(i64::MAX))
}
