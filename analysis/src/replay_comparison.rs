//! HTML page of golden logs: for each log whose replay differs from the record, the first differences, and figures before and after side by side.

use crate::fields::Field;
use crate::figures::{self, Figure, FigureSpec, Kind, Named, Quantity};
use crate::html::replay_comparison as html;
use crate::run::Run;
use crate::{Error, Progress, Stage};
use lcmtypes::channels;
use replay::log::{ChannelDiff, EventFilter, Types};
use std::path::{Path, PathBuf};

/// Width of one of two figures side by side, mm.
const HALF_MM: f64 = 88.0;
/// Figures drawn for both sides.
const KINDS: [&Kind; 6] = [
    &figures::BASE_TRACKING,
    &figures::FEET_TRACKING,
    &figures::CONTACT_FORCES,
    &figures::GAIT,
    &figures::JOINT_TRACKING,
    &figures::QP,
];
/// Channels without a figure.
const NOT_DRAWN: [&str; 2] = ["CONTROLLER_TICK", "CONTROLLER_SNAPSHOT"];

/// A golden log and the result of its replay.
#[derive(Clone, Debug)]
pub struct Log {
    /// Name.
    pub name: String,
    /// Purpose.
    pub why: String,
    /// True if the replay is equal bit for bit.
    pub identical: bool,
    /// Result of the replay, as text.
    pub verdict: String,
    /// Logs of the recorded and of the replayed outputs at the same ticks; `None` for a log without differences.
    pub sides: Option<[PathBuf; 2]>,
}

/// Content of the page for a log whose replay differs.
pub(crate) struct Shown<'a> {
    pub log: &'a Log,
    /// Period of the ticks shown, s.
    pub period_s: f64,
    /// Channels that differ.
    pub channels: Vec<ChannelDiff>,
    /// For each channel, the first field that differs, with both sides in one panel.
    pub overlaid: Vec<Figure>,
    /// Figures before and after.
    pub pairs: Vec<[Figure; 2]>,
}

/// Writes a self-contained `index.html` into a folder, which is created if missing, and returns its path.
///
/// # Errors
/// [`Error::Log`] if a side cannot be read, [`Error::Write`].
pub fn write(logs: &[Log], out_dir: &Path, progress: &mut dyn FnMut(Progress)) -> Result<PathBuf, Error> {
    std::fs::create_dir_all(out_dir).map_err(|source| Error::Write { path: out_dir.to_owned(), source })?;
    let changed: Vec<(&Log, &[PathBuf; 2])> = logs.iter().filter_map(|log| Some((log, log.sides.as_ref()?))).collect();
    let mut shown = Vec::new();
    for (done, (log, sides)) in (0..).zip(&changed) {
        progress(Progress { stage: Stage::Draw, done, total: changed.len() as u64 });
        shown.push(show(log, sides)?);
    }
    let path = out_dir.join("index.html");
    let page = html::page(logs, &shown);
    std::fs::write(&path, page).map_err(|source| Error::Write { path: path.clone(), source })?;
    Ok(path)
}

fn show<'a>(log: &'a Log, [before, after]: &[PathBuf; 2]) -> Result<Shown<'a>, Error> {
    let diff = replay::log::diff(before, after, &EventFilter::default(), Types::default(), &mut |_| {})
        .map_err(|source| Error::Log { path: before.clone(), source })?;
    let is_output = |name: &str| channels::find(name).is_some_and(|channel| channel.stage.is_some());
    let differs = |channel: &ChannelDiff| channel.first.is_some() && is_output(&channel.name);
    let channels: Vec<ChannelDiff> = diff.channels.into_iter().filter(differs).collect();
    let drawn = channels.iter().filter(|channel| !NOT_DRAWN.contains(&channel.name.as_str()));
    let fields: Vec<Field> = drawn
        .filter_map(|channel| Some((channel, channel.first.as_ref()?)))
        .filter(|(_, first)| !first.field.is_empty())
        .map(|(channel, first)| Field { channel: channel.name.clone(), path: first.field.clone() })
        .collect();
    let runs = [before, after].map(|side| Run::read_with(side, &fields, &mut |_| {}));
    let [before, after] = runs;
    let [before, after] = [before?, after?];
    let both = [(Named("before".to_owned()), &before), (Named("after".to_owned()), &after)];
    let overlaid = fields.into_iter().filter_map(|field| {
        let title = Some(field.to_string());
        figures::draw(&FigureSpec { title, fields: vec![field], ..FigureSpec::new(&figures::FIELDS) }, &both).ok()
    });
    let specs = KINDS.map(|kind| FigureSpec { width_mm: HALF_MM, quantity: Quantity::Torque, ..FigureSpec::new(kind) });
    let pairs = specs.iter().filter_map(|spec| {
        let pair = both.each_ref().map(|side| figures::draw(spec, std::slice::from_ref(side)).ok());
        let [Some(before), Some(after)] = pair else { return None };
        // Equal figures are omitted.
        (!before.looks_like(&after)).then_some([before, after])
    });
    Ok(Shown { log, period_s: before.period_s(), channels, overlaid: overlaid.collect(), pairs: pairs.collect() })
}
