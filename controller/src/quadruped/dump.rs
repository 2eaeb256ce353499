//! Every quantity of the last tick with its name and unit, for inspecting a replay. Allocates: not for use in a tick.

use super::controller::{Quadruped, Scratch};
use super::fields::Part;
use super::leg::{Leg, LegPhase};
use super::state::Mode;
use crate::dump::{
    ContactSummary, Dump, GaitSummary, Group, LevelSummary, Overview, Phase, PhaseKind, Quantity, TermSummary, Value,
};
use crate::qp::{NamedViolation, Qp};
use crate::stack::Level;
use lcmtypes::channels::Stage;
use nalgebra::{DMatrix, DVector};

/// Slack of a row or bound below which it counts as active, in units of the program.
const ACTIVE: f64 = 1e-6;
/// Unit of a generalized acceleration.
const ACCELERATION: &str = "m/s², rad/s²";
/// Unit of a task's right side.
const OF_TASK: &str = "m/s², rad/s², N";
/// Unit of a generalized force.
const FORCE: &str = "N, N m";

impl Quadruped {
    /// The stages that the last tick reached. A tick that enters the safe state at its beginning has only the stage `output`.
    pub(super) fn quantities(&self) -> Dump {
        // A stage that ran has a digest.
        let ran = &self.messages.tick;
        let mut stages = Vec::new();
        let mut overview = Overview::default();
        if ran.digest[Stage::Estimation as usize] != 0 || ran.digest[Stage::Gait as usize] != 0 {
            overview.contacts =
                Leg::ALL.map(|leg| ContactSummary { name: leg.name().to_owned(), ..ContactSummary::default() }).into();
        }
        if ran.digest[Stage::Estimation as usize] != 0 {
            stages.push((Stage::Estimation, self.estimation()));
            self.summarize_estimation(&mut overview);
        }
        if ran.digest[Stage::Gait as usize] != 0 {
            stages.push((Stage::Gait, self.gait()));
            self.summarize_gait(&mut overview);
        }
        if ran.digest[Stage::Tasks as usize] != 0 {
            stages.push((Stage::Tasks, self.tasks()));
            self.summarize_tasks(&mut overview);
        }
        if ran.digest[Stage::Qp as usize] != 0 {
            let row_names = self.scratch.wbc.row_names(&self.robot);
            overview.levels = self
                .scratch
                .wbc
                .stack
                .levels
                .iter()
                .map(|level| self.level(level, &row_names.inequalities, &row_names.variables))
                .collect();
            let conflict = self.explain();
            stages.push((Stage::Qp, self.qp(&overview.levels, conflict.as_ref())));
            overview.conflict = conflict.map(|(_, constraints)| constraints);
            for (leg, contact) in Leg::ALL.into_iter().zip(&mut overview.contacts) {
                contact.f_z_qp = Some(self.scratch.wbc.f_F_W[leg].z);
            }
        }
        stages.push((Stage::Output, self.output()));
        Dump { stages, overview }
    }

    fn estimation(&self) -> Group {
        let Scratch { estimate, .. } = &self.scratch;
        let legs = by_leg(|leg| {
            let of_leg = &estimate.legs[leg];
            let group = Group::new()
                .with_unit("p_BF_W", "m", &of_leg.p_BF_W)
                .with_unit("p_hip_W", "m", &of_leg.p_hip_W)
                .with("J", &estimate.contacts[leg].J)
                .with_unit("a_bias_W", "m/s²", &estimate.contacts[leg].linear_bias());
            self.state.dump_leg(Part::Estimation, leg, group).into()
        });
        let group = Group::new()
            .with("R_WB", &estimate.base.R_WB)
            .with_unit("rpy", "rad", estimate.base.rpy)
            .with_unit("w_WB_W", "rad/s", &estimate.base.w_WB_W)
            .with_unit("yaw_rate", "rad/s", estimate.base.yaw_rate)
            .with("n_W", &estimate.n_W);
        let group = self.state.dump(Part::Estimation, group);
        group.with("legs", legs).with("M", &estimate.M).with_unit("h", FORCE, &estimate.h)
    }

    fn summarize_estimation(&self, overview: &mut Overview) {
        for (leg, contact) in Leg::ALL.into_iter().zip(&mut overview.contacts) {
            contact.in_contact = Some(self.state.contact[leg]);
            contact.f_z_est = Some(self.state.f_F_W[leg].z);
        }
        let base = &mut overview.base;
        base.push(named("rpy", "rad", self.scratch.estimate.base.rpy));
        base.push(named("height", "m", self.state.height));
    }

    fn gait(&self) -> Group {
        let (state, references) = (&self.state, &self.scratch.references);
        if self.is_in_transition() {
            return state.dump_joints(Part::StandSit, state.dump(Part::StandSit, Group::new()));
        }
        let legs = by_leg(|leg| {
            state
                .dump_leg(Part::Gait, leg, Group::new())
                .with_unit("foothold_H", "m", &references.foothold_H[leg])
                .with_unit("p_BF_H_des", "m", &references.p_BF_H[leg])
                .with_unit("v_BF_H_des", "m/s", &references.v_BF_H[leg])
                .into()
        });
        let robot = Group::new().with("gait", self.params.gait.name(state.gait));
        state.dump_joints(Part::Gait, state.dump(Part::Gait, robot).with("legs", legs))
    }

    /// Whether the robot stands up or sits down: then the stage `gait` computes no gait.
    fn is_in_transition(&self) -> bool {
        matches!(self.state.mode, Mode::StandUp | Mode::Sit)
    }

    fn summarize_gait(&self, overview: &mut Overview) {
        let state = &self.state;
        if self.is_in_transition() {
            overview.base.push(named("move_phase", "", state.move_phase.name()));
            overview.base.push(named("move_progress", "", state.move_progress));
            return;
        }
        overview.gait =
            Some(GaitSummary { name: self.params.gait.name(state.gait).to_owned(), clock: state.gait_clock });
        for (leg, contact) in Leg::ALL.into_iter().zip(&mut overview.contacts) {
            contact.phase = Some(phase(state.leg_state[leg]));
            contact.t_phase = Some(state.t_leg[leg]).filter(|t| t.is_finite());
            contact.p_des = Some(self.scratch.references.p_BF_H[leg].into());
        }
        overview.base.push(named("v_H_des", "m/s", state.v_H_des));
    }

    fn tasks(&self) -> Group {
        let Scratch { wbc, trunk, .. } = &self.scratch;
        let rows = wbc.tasks.names().zip(&wbc.tasks.rows).fold(Group::new(), |group, (name, rows)| {
            group.with(name, Group::new().with("A", &rows.A).with_unit("b", OF_TASK, &rows.b))
        });
        let levels: Vec<Group> = (0..wbc.stack.levels.len()).map(|k| program(&wbc.program(k))).collect();
        Group::new()
            .with("R_WB_des", &trunk.R_WB)
            .with_unit("w_WB_W_des", "rad/s", &trunk.w_WB_W)
            .with_unit("e_o_W", "rad", &wbc.tasks.trunk.e_o_W)
            .with_unit("wd_trunk", "rad/s²", &wbc.tasks.trunk.wd)
            .with_unit("qdd_posture", "rad/s²", &wbc.tasks.posture.qdd)
            .with_unit("f_z_bounds", "N", by_leg(|leg| [wbc.f_z_bounds[leg].0, wbc.f_z_bounds[leg].1].into()))
            .with("rows", rows)
            .with("levels", levels)
    }

    fn summarize_tasks(&self, overview: &mut Overview) {
        let Scratch { wbc, .. } = &self.scratch;
        for (leg, contact) in Leg::ALL.into_iter().zip(&mut overview.contacts) {
            contact.f_z_bounds = Some([wbc.f_z_bounds[leg].0, wbc.f_z_bounds[leg].1]);
        }
        let orientation_error = named("e_o_W", "rad", &wbc.tasks.trunk.e_o_W);
        overview.base.insert(1.min(overview.base.len()), orientation_error);
    }

    fn qp(&self, levels: &[LevelSummary], conflict: Option<&(usize, Vec<NamedViolation>)>) -> Group {
        let Scratch { wbc, estimate, .. } = &self.scratch;
        let level_group = |(summary, level): (&LevelSummary, &Level)| {
            let terms: Vec<Group> = summary
                .terms
                .iter()
                .map(|TermSummary { task, weight, residual }| {
                    Group::new()
                        .with("task", task.as_str())
                        .with("weight", *weight)
                        .with_unit("residual", OF_TASK, *residual)
                })
                .collect();
            let mut group = Group::new().with("status", summary.status_name());
            if summary.status.is_some() {
                group = group.with("iterations", summary.iterations).with("n_active", summary.n_active);
            }
            let active: Vec<Value> = summary.active.iter().map(|name| name.as_str().into()).collect();
            group.with("terms", terms).with("active", active).with("x", &level.x)
        };
        let levels: Vec<Group> = levels.iter().zip(&wbc.stack.levels).map(level_group).collect();
        let [contact, trunk, posture] =
            if wbc.solved() { wbc.tasks.residuals(&wbc.vd, estimate, &self.state) } else { [f64::NAN; 3] };
        let residuals = Group::new()
            .with_unit("contact", "m/s²", contact)
            .with_unit("trunk", "rad/s²", trunk)
            .with_unit("posture", "rad/s²", posture);
        let group = Group::new()
            .with("solved", wbc.solved())
            .with("iterations", wbc.info.iterations)
            .with("residuals", residuals)
            .with_unit("f_F_W", "N", by_leg(|leg| (&wbc.f_F_W[leg]).into()))
            .with_unit("vd", ACCELERATION, &wbc.vd)
            .with_unit("tau", "N m", &wbc.tau)
            .with("levels", levels);
        let Some((level, constraints)) = conflict else { return group };
        let constraints: Vec<Group> = constraints
            .iter()
            .map(|violation| Group::new().with("constraint", violation.name.as_str()).with("by", violation.by))
            .collect();
        group.with("conflict_level", *level).with("conflict", constraints)
    }

    /// - `inequalities`, `variables`: names of the inequality rows and variables of the programs.
    fn level(&self, level: &Level, inequalities: &[String], variables: &[String]) -> LevelSummary {
        let Scratch { wbc, .. } = &self.scratch;
        let names: Vec<&str> = wbc.tasks.names().collect();
        let terms = level.terms.iter().map(|term| {
            let rows = &wbc.tasks.rows[term.task];
            let residual = residual(&rows.A, &rows.b, &term.takes, &wbc.x);
            TermSummary { task: names[term.task].to_owned(), weight: term.weight, residual }
        });
        let active = if level.solved() {
            active(&wbc.stack.levels[0].qp, &level.x, inequalities, variables)
        } else {
            Vec::new()
        };
        LevelSummary {
            status: level.info.map(|info| info.status),
            iterations: level.info.map_or(0, |info| info.iterations),
            n_active: level.info.map_or(0, |info| info.n_active),
            terms: terms.collect(),
            active,
        }
    }

    fn output(&self) -> Group {
        self.state.dump_joints(Part::Output, self.state.dump(Part::Output, Group::new()))
    }
}

fn named(name: &str, unit: &'static str, value: impl Into<Value>) -> Quantity {
    Quantity { name: name.to_owned(), unit, value: value.into() }
}

fn phase(phase: LegPhase) -> Phase {
    let kind = match phase {
        LegPhase::Stance => PhaseKind::Stance,
        LegPhase::SwingUp | LegPhase::SwingDown => PhaseKind::Swing,
        LegPhase::Reach | LegPhase::FaultHold => PhaseKind::Unplanned,
    };
    Phase { name: phase.name(), kind }
}

/// Names of the inequality rows and bounds that hold with equality at `x`.
fn active(constraints: &Qp, x: &DVector<f64>, inequalities: &[String], variables: &[String]) -> Vec<String> {
    let named = |names: &[String], i: usize| names.get(i).cloned().unwrap_or_else(|| format!("row {i}"));
    let mut active = Vec::new();
    for (i, d) in constraints.d.iter().enumerate() {
        let row = constraints.C.row(i);
        let left = row.iter().zip(x).fold(0.0, |sum, (c, x)| sum + c * x);
        if row.iter().any(|c| *c != 0.0) && d - left < ACTIVE {
            active.push(named(inequalities, i));
        }
    }
    for i in 0..x.len() {
        for (bound, slack) in [("lower", x[i] - constraints.lower[i]), ("upper", constraints.upper[i] - x[i])] {
            if slack < ACTIVE {
                active.push(format!("{bound} bound of {}", named(variables, i)));
            }
        }
    }
    active
}

/// Norm of `A x - b` over the rows with `takes`. `x` may be longer than the rows.
fn residual(A: &DMatrix<f64>, b: &DVector<f64>, takes: &[bool], x: &DVector<f64>) -> f64 {
    let mut sum = 0.0;
    for row in (0..b.len()).filter(|row| takes[*row]) {
        let left = A.row(row).iter().zip(x).fold(0.0, |sum, (a, x)| sum + a * x);
        sum += (left - b[row]) * (left - b[row]);
    }
    sum.sqrt()
}

fn program(qp: &Qp) -> Group {
    Group::new()
        .with("H", &qp.H)
        .with("g", &qp.g)
        .with("A", &qp.A)
        .with("b", &qp.b)
        .with("C", &qp.C)
        .with("d", &qp.d)
        .with("lower", &qp.lower)
        .with("upper", &qp.upper)
}

fn by_leg(value: impl Fn(Leg) -> Value) -> Group {
    Leg::ALL.into_iter().fold(Group::new(), |group, leg| group.with(leg.name(), value(leg)))
}
