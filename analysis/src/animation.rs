//! Animated side view of a walk as SVG: the robot as lines between its joints, the ground as marks at the footholds.
//!
//! Lines come from the URDF in RUN_INFO and the joint positions, the pose of the base from ground truth. Without ground truth, the horizontal position of the
//! base is fixed, and orientation and height are the estimates. The animation is SMIL, so the file contains no script.

use std::fmt::Write as _;

use crate::figures::escape;
use crate::math::{Vec3, transform};
use crate::run::{Run, Tick};
use nalgebra::Matrix3;
use robot_model::math::rotation_of_rpy;

/// Frames per second.
const RATE_HZ: f64 = 25.0;
/// Longest part of a run that is shown, s.
const LENGTH_S: f64 = 10.0;
/// Size of the picture, units.
const SIZE: (f64, f64) = (680.0, 300.0);
/// Free space above and below the robot, as a fraction of the height of the base.
const MARGIN: f64 = 0.35;

/// Animated attributes, frame by frame.
#[derive(Default)]
struct Frames {
    /// Path data of the legs on the near (right) side, of the legs on the far side, and of the trunk.
    near: Vec<String>,
    far: Vec<String>,
    trunk: Vec<String>,
    /// Translations of the ground.
    ground: Vec<String>,
    /// Times, s.
    t_s: Vec<f64>,
}

/// The middle of the walk as an SVG document; `None` without joint positions, a usable URDF, or a pose of the base.
pub fn side_view(run: &Run) -> Option<String> {
    let robot = run.robot.as_ref().filter(|robot| robot.nj() == run.joints.count())?;
    let shown = part_shown(run);
    let poses: Vec<(&Tick, Vec3, Matrix3<f64>)> =
        every_frame(shown).filter_map(|tick| pose(tick).map(|(p, r)| (tick, p, r))).collect();
    let (_, first, r_first) = poses.first()?;
    let heading = {
        let ahead = r_first.column(0);
        let length = ahead[0].hypot(ahead[1]).max(1e-9);
        [ahead[0] / length, ahead[1] / length]
    };
    let along = |p: Vec3| (p[0] - first[0]) * heading[0] + (p[1] - first[1]) * heading[1];

    // All frames have one scale, so that the largest height of the base fits with its margins.
    let height = poses.iter().map(|(_, p, _)| p[2]).fold(0.2, f64::max);
    let scale = SIZE.1 / (height * (1.0 + 2.0 * MARGIN));
    let floor = SIZE.1 - MARGIN * 0.5 * SIZE.1;
    let mut frames = Frames::default();
    for (tick, p_WB, R_WB) in &poses {
        let q: Option<Vec<f64>> =
            (0..run.joints.count()).map(|joint| run.joints.measured(tick, joint).map(|s| s.q)).collect();
        let Some(q) = q else { continue };
        let camera = along(*p_WB);
        let place = |p_B: Vec3| {
            let p = transform(*p_WB, R_WB, p_B);
            (0.5 * SIZE.0 + (along(p) - camera) * scale, floor - p[2] * scale)
        };
        let (mut near, mut far, mut hips) = (String::new(), String::new(), Vec::new());
        for (a_B, b_B) in robot.sticks(&q) {
            let at_origin = a_B == [0.0; 3];
            if at_origin {
                hips.push(b_B);
                continue;
            }
            let ((ax, ay), (bx, by)) = (place(a_B), place(b_B));
            let side = if a_B[1] + b_B[1] <= 0.0 { &mut near } else { &mut far };
            let _ = write!(side, "M{ax:.1} {ay:.1}L{bx:.1} {by:.1}");
        }
        let ends = |k: fn(f64, f64) -> bool| hips.iter().copied().reduce(|a, b| if k(b[0], a[0]) { b } else { a });
        let (front, hind) = (ends(|a, b| a > b)?, ends(|a, b| a < b)?);
        let middle = |p: Vec3| place([p[0], 0.0, p[2]]);
        let ((ax, ay), (bx, by)) = (middle(hind), middle(front));
        frames.trunk.push(format!("M{ax:.1} {ay:.1}L{bx:.1} {by:.1}"));
        frames.near.push(near);
        frames.far.push(far);
        frames.ground.push(format!("{:.1} 0", -camera * scale));
        frames.t_s.push(tick.t_s);
    }
    (frames.t_s.len() > 1).then(|| {
        let spots = footholds(run, shown).map(|p| (0.5 * SIZE.0 + along(p) * scale, floor - p[2] * scale));
        document(run, &frames, &spots.collect::<Vec<_>>(), floor)
    })
}

/// The middle of the walk.
fn part_shown(run: &Run) -> &[Tick] {
    let walks = |tick: &Tick| (0..4).any(|leg| tick.swings(leg));
    let first = run.ticks.iter().position(walks).unwrap_or(0);
    let last = run.ticks.iter().rposition(walks).unwrap_or(run.ticks.len() - 1);
    let middle = 0.5 * (run.ticks[first].t_s + run.ticks[last].t_s);
    let (begin, end) = (run.begin_s(), run.end_s());
    let from = (middle - 0.5 * LENGTH_S).clamp(begin, (end - LENGTH_S).max(begin));
    let begin = run.ticks.partition_point(|tick| tick.t_s < from);
    let stop = run.ticks.partition_point(|tick| tick.t_s <= from + LENGTH_S);
    &run.ticks[begin..stop]
}

/// One tick per frame.
fn every_frame(ticks: &[Tick]) -> impl Iterator<Item = &Tick> {
    let mut next = f64::NEG_INFINITY;
    ticks.iter().filter(move |tick| {
        let due = tick.t_s >= next;
        if due {
            next = if next.is_finite() { (next + 1.0 / RATE_HZ).max(tick.t_s) } else { tick.t_s + 1.0 / RATE_HZ };
        }
        due
    })
}

/// Position and orientation of the base in W: ground truth, else estimate.
fn pose(tick: &Tick) -> Option<(Vec3, Matrix3<f64>)> {
    let truth = tick.truth.as_ref().map(|w| (w.p_WB, rotation_of_rpy(w.rpy)));
    let estimate = || tick.base.as_ref().map(|b| ([0.0, 0.0, b.height_est], rotation_of_rpy(b.rpy_est)));
    truth.or_else(estimate)
}

/// Footholds: true contact points at touchdowns.
fn footholds<'a>(run: &'a Run, shown: &'a [Tick]) -> impl Iterator<Item = Vec3> + 'a {
    let known = run.has("GROUND_TRUTH");
    let landed = move |pair: &[Tick], leg: usize| {
        let stands = |tick: &Tick| tick.stands(leg) == Some(true);
        (stands(&pair[1]) && !stands(&pair[0])).then(|| pair[1].truth.as_ref().map(|w| w.p_WF[leg])).flatten()
    };
    let first = shown.first().and_then(|tick| tick.truth.as_ref()).filter(|_| known);
    let standing = first.into_iter().flat_map(|w| (0..4).filter(|&leg| w.contact[leg]).map(|leg| w.p_WF[leg]));
    let later = shown.windows(2).flat_map(move |pair| (0..4).filter_map(move |leg| landed(pair, leg)));
    standing.chain(later)
}

fn document(run: &Run, frames: &Frames, spots: &[(f64, f64)], floor: f64) -> String {
    let (width, height) = SIZE;
    let (begin, end) = (frames.t_s[0], frames.t_s[frames.t_s.len() - 1]);
    let length = end - begin;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"walk\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" fill=\"none\" \
         stroke-linecap=\"round\" stroke-linejoin=\"round\">\n<metadata>{}, SHA-256 {}, {begin:.2} s to {end:.2} s</metadata>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        escape(&run.name()),
        run.sha256
    );
    let moves = |name: &str, values: &[String]| {
        format!(
            "<animate attributeName=\"{name}\" dur=\"{length:.3}s\" repeatCount=\"indefinite\" values=\"{}\"/>",
            values.join(";")
        )
    };
    let _ = write!(out, "<path d=\"M0 {floor:.1}L{width} {floor:.1}\" stroke=\"#ddd\"/>\n<g fill=\"#8a6d3b\">");
    let _ = write!(
        out,
        "<animateTransform attributeName=\"transform\" type=\"translate\" dur=\"{length:.3}s\" repeatCount=\"indefinite\" values=\"{}\"/>",
        frames.ground.join(";")
    );
    for (x, y) in spots {
        let _ = write!(out, "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"8\" height=\"3\"/>", x - 4.0);
    }
    out.push_str("</g>\n");
    for (paths, color, thick) in
        [(&frames.far, "#9bb7c9", 4.0), (&frames.trunk, "#444", 14.0), (&frames.near, "#0072b2", 4.5)]
    {
        let first = paths.first().map_or("", String::as_str);
        let _ = writeln!(
            out,
            "<path d=\"{first}\" stroke=\"{color}\" stroke-width=\"{thick}\">{}</path>",
            moves("d", paths)
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"10\" y=\"20\" font-family=\"Hoofprint Sans, Arial, sans-serif\" font-size=\"11\" fill=\"#222\">{begin:.1} s to {end:.1} s, real time</text>\n</svg>"
    );
    out
}
