//! Files for the peers: states of the robots with the quantities that this project computes, and quadratic programs with its solutions.
//!
//! Format: little-endian u64 and f64, matrices by column, a text as length and bytes. Readers: `benches/peers/peer.hpp`, `programs.hpp`, and this
//! file.

use crate::inputs::{Run, Stack};
use crate::rigid_body::{Body, State, states};
use anyhow::{Context, Result, ensure};
use controller::qp::Qp;
use controller::{Controller, Outbox};
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// Arguments of `bench export`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of the files.
    pub dir: PathBuf,
    /// Log of which quadratic programs are written.
    #[arg(long, default_value = "logs/golden/flat_trot.mcap")]
    pub log: PathBuf,
    /// First tick and number of ticks of which programs are written.
    #[arg(long, num_args = 2, default_values_t = [1000, 500])]
    pub ticks: Vec<usize>,
}

/// Folders of the robots whose quantities are timed.
pub const ROBOTS: [&str; 2] = ["hyq", "anymal_b"];
/// Number of states per robot.
const STATES: usize = 256;

/// Path of a robot's URDF.
pub fn urdf(robot: &str) -> PathBuf {
    format!("robots/{robot}/{robot}.urdf").into()
}

/// File of a robot's states.
pub fn states_file(dir: &Path, robot: &str) -> PathBuf {
    dir.join(format!("{robot}.states"))
}

/// Files of quadratic programs with their names in tables.
pub fn programs_files(dir: &Path) -> Vec<(String, PathBuf)> {
    let level = |stack: Stack, k: usize| (stack, format!("{} level {}", stack.name(), k + 1), k);
    [(Stack::S1, "S1".to_owned(), 0), level(Stack::S3, 0), level(Stack::S3, 1), level(Stack::S3, 2)]
        .map(|(stack, name, k)| (name, programs_file(dir, stack, k)))
        .to_vec()
}

fn programs_file(dir: &Path, stack: Stack, level: usize) -> PathBuf {
    dir.join(format!("{}_{}.programs", stack.name().to_lowercase(), level + 1))
}

/// Writes the files of all robots and stacks.
pub fn export(args: &Args) -> Result<()> {
    std::fs::create_dir_all(&args.dir).with_context(|| args.dir.display().to_string())?;
    for robot in ROBOTS {
        let mut body = Body::read(&urdf(robot))?;
        let states = states(&body, STATES);
        write(&states_file(&args.dir, robot), &states_bytes(&mut body, &states))?;
    }
    let run = Run::read(&args.log)?;
    let ticks = args.ticks[0]..args.ticks[0] + args.ticks[1];
    ensure!(
        !ticks.is_empty() && ticks.end <= run.inputs.len(),
        "{}: ticks {} to {} requested, the log has {}",
        args.log.display(),
        ticks.start,
        ticks.end,
        run.inputs.len()
    );
    for stack in [Stack::S1, Stack::S3] {
        let mut controller = run.controller(stack)?;
        let levels = controller.wbc().stack.levels.len();
        let mut programs: Vec<Vec<(Qp, DVector<f64>)>> = vec![Vec::new(); levels];
        let mut outbox = Outbox::new();
        for (tick, input) in run.inputs[..ticks.end].iter().enumerate() {
            controller.step(input, &mut outbox);
            for (k, (level, programs)) in controller.wbc().stack.levels.iter().zip(&mut programs).enumerate() {
                if ticks.contains(&tick) && level.solved() {
                    programs.push((controller.wbc().program(k), level.x.clone()));
                }
            }
        }
        for (k, programs) in programs.iter().enumerate() {
            ensure!(
                !programs.is_empty(),
                "{}: level {} of {} has no solution",
                args.log.display(),
                k + 1,
                stack.name()
            );
            write(&programs_file(&args.dir, stack, k), &programs_bytes(programs))?;
        }
    }
    Ok(())
}

/// Reads programs and their solutions.
pub fn read_programs(path: &Path) -> Result<Vec<(Qp, DVector<f64>)>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let mut from = Reader { bytes: &bytes, path };
    let (n, n_eq, n_in, count) = (from.count()?, from.count()?, from.count()?, from.count()?);
    let mut programs = Vec::with_capacity(count);
    for _ in 0..count {
        let H = from.matrix(n, n)?;
        let g = from.vector(n)?;
        let (A, b) = (from.matrix(n_eq, n)?, from.vector(n_eq)?);
        let (C, d) = (from.matrix(n_in, n)?, from.vector(n_in)?);
        let (lower, upper) = (from.vector(n)?, from.vector(n)?);
        programs.push((Qp { H, g, A, b, C, d, lower, upper }, from.vector(n)?));
    }
    Ok(programs)
}

/// Reads states, without the values.
pub fn read_states(path: &Path, body: &Body) -> Result<Vec<State>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let mut from = Reader { bytes: &bytes, path };
    for names in [&body.joint_names, &body.foot_names] {
        let found = from.texts()?;
        ensure!(found == *names, "{}: found {found:?}, expected {names:?}", path.display());
    }
    let (nv, nj) = (body.model.nv(), body.model.nj());
    let values = nv * nv + nv + 6 * body.feet.len() * (nv + 1) + 6 + 6 * nv + 6;
    (0..from.count()?)
        .map(|_| {
            let [p_WB, q_wxyz, w_WB_W] = [from.vector(3)?, from.vector(4)?, from.vector(3)?];
            let (q, qd) = (from.vector(nj)?, from.vector(nj)?);
            from.vector(values)?;
            Ok(State::new(&p_WB, &q_wxyz, &w_WB_W, q.as_slice(), qd.as_slice()))
        })
        .collect()
}

fn states_bytes(body: &mut Body, states: &[State]) -> Vec<u8> {
    let mut out = Vec::new();
    for names in [&body.joint_names, &body.foot_names] {
        count(&mut out, names.len());
        for name in names {
            count(&mut out, name.len());
            out.extend(name.as_bytes());
        }
    }
    count(&mut out, states.len());
    for state in states {
        f64s(&mut out, state.base.p_WB.as_slice());
        f64s(&mut out, &state.q_WB_wxyz);
        f64s(&mut out, state.base.w_WB_W.as_slice());
        f64s(&mut out, &state.q);
        f64s(&mut out, &state.qd);
        body.set(state);
        f64s(&mut out, body.M.as_slice());
        f64s(&mut out, body.h.as_slice());
        f64s(&mut out, body.stacked_jacobians().as_slice());
        for dJv in &body.dJv {
            f64s(&mut out, dJv.as_slice());
        }
        f64s(&mut out, body.com.as_slice());
        f64s(&mut out, body.v_com.as_slice());
        body.centroidal(state);
        f64s(&mut out, body.A_G.as_slice());
        f64s(&mut out, body.momentum.as_slice());
    }
    out
}

fn programs_bytes(programs: &[(Qp, DVector<f64>)]) -> Vec<u8> {
    let mut out = Vec::new();
    let (first, _) = &programs[0];
    for n in [first.n(), first.b.len(), first.d.len(), programs.len()] {
        count(&mut out, n);
    }
    for (Qp { H, g, A, b, C, d, lower, upper }, x) in programs {
        for (matrix, vector) in [(H, g), (A, b), (C, d)] {
            f64s(&mut out, matrix.as_slice());
            f64s(&mut out, vector.as_slice());
        }
        for vector in [lower, upper, x] {
            f64s(&mut out, vector.as_slice());
        }
    }
    out
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

fn count(out: &mut Vec<u8>, n: usize) {
    out.extend((n as u64).to_le_bytes());
}

fn f64s(out: &mut Vec<u8>, values: &[f64]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

struct Reader<'a> {
    bytes: &'a [u8],
    path: &'a Path,
}

impl Reader<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8]> {
        ensure!(n <= self.bytes.len(), "{} is too short: write it again with `bench export`", self.path.display());
        let (taken, rest) = self.bytes.split_at(n);
        self.bytes = rest;
        Ok(taken)
    }

    fn count(&mut self) -> Result<usize> {
        let bytes = self.take(8)?.first_chunk().copied().unwrap_or_default();
        Ok(usize::try_from(u64::from_le_bytes(bytes))?)
    }

    fn texts(&mut self) -> Result<Vec<String>> {
        (0..self.count()?)
            .map(|_| {
                let n = self.count()?;
                Ok(String::from_utf8(self.take(n)?.to_vec())?)
            })
            .collect()
    }

    fn vector(&mut self, n: usize) -> Result<DVector<f64>> {
        let values = self.take(n.saturating_mul(8))?.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        Ok(DVector::from_iterator(n, values))
    }

    fn matrix(&mut self, m: usize, n: usize) -> Result<DMatrix<f64>> {
        Ok(DMatrix::from_column_slice(m, n, self.vector(m * n)?.as_slice()))
    }
}
