//! Figure 9 of Raiola et al. 2020: base orientation and height above, two feet below, over the whole run.

use super::canvas::{Align, Drawing, RGBAColor, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLACK, BOTTOM_MARGIN, LABEL_EM, LEFT_MARGIN, Mark, PAGE_WIDTH, REFERENCE_LINE, RIGHT_MARGIN, TEXT, TOP_MARGIN,
    TRUE_LINE, legend, pale,
};
use super::{Figure, Lacking, airborne, series, times, whole};
use crate::math::unwrap_angles;
use crate::run::{LEGS, Run, Tick};
use lcmtypes::ControllerTick;

const NAME: &str = "figure9";
const TITLE: &str = "Base and feet, as Figure 9 of Raiola et al. 2020";
/// LF and RH, the feet of the source.
const FEET: [usize; 2] = [0, 3];
const PANEL_HEIGHT: f64 = 88.0;
const GAP: f64 = 12.0;
const COLUMN_GAP: f64 = 66.0;
const CHANGE: RGBAColor = pale(BLACK, 0.35);

type Value = Box<dyn Fn(&Tick) -> Option<f64>>;

/// One pair of axes: what it shows, its reference, the truth.
struct Plot {
    label: String,
    angle: bool,
    reference: Value,
    truth: Value,
}

/// Draws the figure. References are black and dashed, the truth is blue; a line marks the change of gait.
///
/// # Errors
/// [`Lacking`] without ground truth, references of the base or of the feet.
pub fn figure9(run: &Run) -> Result<Figure, Lacking> {
    for needs in ["GROUND_TRUTH", "BASE_TRACKING", "LEG_STATE"] {
        if !run.has(needs) {
            return Err(Lacking { name: NAME, title: TITLE, needs });
        }
    }
    let base = [base("roll [rad]", 0), base("pitch [rad]", 1), base("yaw [rad]", 2), height()];
    let feet =
        FEET.map(|leg| ["x [m]", "y [m]", "z [m]"].into_iter().enumerate().map(move |(k, axis)| foot(leg, k, axis)));

    let rows = 2.0 + 3.0;
    let mut drawing =
        Drawing::new(PAGE_WIDTH, TOP_MARGIN + rows * PANEL_HEIGHT + (rows + 1.0) * GAP + 14.0 + BOTTOM_MARGIN);
    let width = 0.5 * (drawing.width() - LEFT_MARGIN - RIGHT_MARGIN - COLUMN_GAP);
    let left = |column: usize| LEFT_MARGIN + column as f64 * (width + COLUMN_GAP);
    let top = |row: usize| TOP_MARGIN + row as f64 * (PANEL_HEIGHT + GAP) + if row < 2 { 0.0 } else { GAP + 14.0 };
    let frame = |row, column| Frame { left: left(column), top: top(row), width, height: PANEL_HEIGHT };
    for (k, plot) in base.iter().enumerate() {
        plot.draw(&mut drawing, run, frame(k / 2, k % 2), false);
    }
    for (column, plots) in feet.into_iter().enumerate() {
        let title = format!("{} foot", LEGS[FEET[column]]);
        drawing.text((left(column) + 0.5 * width, top(2) - 6.0), title, LABEL_EM, Align::Middle, TEXT);
        for (k, plot) in plots.enumerate() {
            plot.draw(&mut drawing, run, frame(2 + k, column), k == 2);
        }
    }
    let mut entries = vec![("reference", Mark::Dashed(REFERENCE_LINE)), ("truth", Mark::Line(truth_line()))];
    if change_of_gait(run).is_some() {
        entries.push(("change of gait", Mark::Fill(CHANGE)));
    }
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption = "Roll, pitch, yaw and height of the base, and the contact points of the left front and the right hind foot relative to the \
                   base, in the horizontal frame; the references of the feet are those of their swings."
        .to_owned();
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}

/// When a walking robot first changes its gait, s.
fn change_of_gait(run: &Run) -> Option<f64> {
    let walks = |tick: &Tick| tick.status.as_ref().is_some_and(|s| s.mode == ControllerTick::MODE_WALK);
    let gait = |tick: &Tick| tick.legs.as_ref().map(|legs| legs.gait);
    run.ticks.windows(2).find(|pair| walks(&pair[0]) && gait(&pair[0]) != gait(&pair[1])).map(|pair| pair[1].t_s)
}

/// Thin: a foot's line is dense over a whole run.
fn truth_line() -> Stroke {
    Stroke { width: 1.2, ..TRUE_LINE }
}

fn base(label: &str, axis: usize) -> Plot {
    Plot {
        label: label.to_owned(),
        angle: true,
        reference: Box::new(move |t| t.base.as_ref().map(|b| b.rpy_des[axis])),
        truth: Box::new(move |t| t.truth.as_ref().map(|w| w.rpy[axis])),
    }
}

fn height() -> Plot {
    Plot {
        label: "height [m]".to_owned(),
        angle: false,
        reference: Box::new(|t| t.base.as_ref().map(|b| b.height_des)),
        truth: Box::new(Tick::true_height),
    }
}

fn foot(leg: usize, axis: usize, label: &str) -> Plot {
    Plot {
        label: label.to_owned(),
        angle: false,
        reference: Box::new(move |t| {
            t.legs.as_ref().filter(|_| airborne(t, leg)).map(|legs| legs.p_BF_H_des[leg][axis])
        }),
        truth: Box::new(move |t| t.truth.as_ref().map(|w| w.p_BF_H(leg)[axis])),
    }
}

impl Plot {
    fn draw(&self, drawing: &mut Drawing, run: &Run, frame: Frame, last: bool) {
        let xs = times(&run.ticks);
        let values = [&self.reference, &self.truth].map(|value| {
            let mut ys = series(&run.ticks, value);
            if self.angle {
                unwrap_angles(&mut ys);
            }
            ys
        });
        let [reference, truth] = &values;
        let panel = Panel::new(frame, whole(run), Range::covering(values.iter().flatten(), 0.04));
        panel.grid(drawing);
        if let Some(change) = change_of_gait(run) {
            panel.shade(drawing, change, change + 0.004 * run.duration_s(), CHANGE);
        }
        panel.line(drawing, &xs, truth, truth_line());
        panel.dashed(drawing, &xs, reference, REFERENCE_LINE);
        panel.axes(drawing, Labels { x: last.then_some("time [s]"), y: Some(&self.label) });
    }
}
