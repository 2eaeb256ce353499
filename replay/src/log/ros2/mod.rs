//! Exports a log for ROS 2 viewers: MCAP with CDR messages, which Foxglove, PlotJuggler and rerun open.
//!
//! Every channel of a known type becomes a topic `/CHANNEL` with the same fields (`lcm_types`). Further topics let a viewer draw the
//! robot (`robot_topics`): `/robot_description` (URDF), `/tf` (100 Hz), `/joint_states`, `/imu`, `/contact/FOOT` (estimated forces) and
//! `/contact_truth/FOOT` (forces of the simulator). Times are log times.

mod definitions;
mod lcm_types;
mod messages;
mod robot_topics;

pub use robot_topics::{BaseSource, RobotTopics, TopicMessage, description};

use super::copy::PROGRESS_EVENTS;
use super::{EventFilter, EventRef, Health, LogReader, Types};
use crate::Error;
use lcm_types::Ros2Value;
use lcmtypes::{Message, RunInfo, channels};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use messages::to_cdr;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Result of an export.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Exported {
    /// The file.
    pub out: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Source of the base pose in `/tf`; `None` if the log has no robot.
    pub base: Option<BaseSource>,
    /// Messages that were omitted: of unknown type, malformed, or with a negative time.
    pub unreadable: u64,
    /// Damaged ranges in the log.
    pub damaged: u64,
    /// The log ends inside a record.
    pub cut: bool,
}

impl Exported {
    /// Every selected message is in the file.
    pub fn is_lossless(&self) -> bool {
        self.unreadable == 0 && self.damaged == 0 && !self.cut
    }
}

/// Writes the messages of a log as ROS 2 messages. `progress` receives the fraction done, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`]; [`Error::SameFile`]; [`Error::Io`] or [`Error::Mcap`] if the file cannot be written.
pub fn to_ros2(
    log: &Path,
    out: &Path,
    mut filter: EventFilter,
    mut types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<Exported, Error> {
    Error::check_distinct_files(log, out)?;
    let mut file = Ros2File::create(out)?;
    let mut scene = Scene::find(log, &mut |part| progress(0.2 * part))?;
    file.exported.base = scene.as_ref().map(|scene| scene.robot.source);
    let mut reader = LogReader::open(log)?;
    let (bytes, mut read, mut health) = (reader.bytes().max(1), 0_u64, Health::default());
    let mut robot_messages = Vec::new();
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        read += 1;
        if read.is_multiple_of(PROGRESS_EVENTS) {
            progress(0.2 + 0.8 * event.offset as f64 / bytes as f64);
        }
        types.learn(&event);
        let is_selected = filter.accepts(&event);
        let Ok(t) = u64::try_from(event.t_ns) else {
            file.exported.unreadable += 1;
            continue;
        };
        if let Some(scene) = &mut scene {
            if let Some(urdf) = scene.urdf.take() {
                robot_messages.push(description(&urdf));
            }
            scene.robot.update_from(event.channel, event.data, &mut robot_messages);
        }
        for TopicMessage { topic, type_name, definition, cdr } in robot_messages.drain(..) {
            file.write(&topic, type_name, definition, t, &cdr)?;
        }
        if is_selected {
            file.write_event(t, &event, &types)?;
        }
    }
    file.exported.damaged = health.damaged.len() as u64;
    file.exported.cut = health.cut.is_some();
    file.finish()
}

struct Scene {
    robot: RobotTopics,
    /// URDF text until it is written.
    urdf: Option<String>,
}

impl Scene {
    /// Reads the log once to find its robot and the best source of the base pose. `None` if it has no RUN_INFO with a URDF.
    fn find(log: &Path, progress: &mut dyn FnMut(f64)) -> Result<Option<Self>, Error> {
        let mut reader = LogReader::open(log)?;
        let bytes = reader.bytes().max(1);
        let (mut info, mut source, mut health) = (None, BaseSource::Imu, Health::default());
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            match &**event.channel {
                channels::RUN_INFO if info.is_none() => info = RunInfo::decode(event.data).ok(),
                channels::BASE_TRACKING if source == BaseSource::Imu => source = BaseSource::Estimate,
                channels::GROUND_TRUTH => {
                    source = BaseSource::GroundTruth;
                    if info.is_some() {
                        break;
                    }
                }
                _ => {}
            }
            progress(event.offset as f64 / bytes as f64);
        }
        let Some(info) = info else { return Ok(None) };
        Ok(RobotTopics::new(&info, source).map(|robot| Scene { robot, urdf: Some(info.urdf) }))
    }
}

/// The MCAP file that is written.
struct Ros2File {
    path: PathBuf,
    out: Writer<BufWriter<File>>,
    /// Channel id and next sequence number of each topic.
    topics: BTreeMap<String, (u16, u32)>,
    /// Topic of each channel and type of the log.
    known: BTreeMap<(Arc<str>, Option<u64>), String>,
    exported: Exported,
}

impl Ros2File {
    fn create(path: &Path) -> Result<Self, Error> {
        let file = File::create(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let options = WriteOptions::new().profile("ros2").library("hoofprint").compression(Some(Compression::Zstd));
        let out = options
            .create(BufWriter::new(file))
            .map_err(|source| Error::Mcap { path: path.into(), source: source.into() })?;
        let exported = Exported { out: path.into(), ..Exported::default() };
        Ok(Ros2File { path: path.into(), out, topics: BTreeMap::new(), known: BTreeMap::new(), exported })
    }

    /// Writes a message of the log with the fields of its LCM type.
    fn write_event(&mut self, t: u64, event: &EventRef<'_>, types: &Types) -> Result<(), Error> {
        let ty = types.of_message(event.channel, event.data);
        let Some((ty, Ok(value))) = ty.map(|ty| (ty, ty.decode(event.data))) else {
            self.exported.unreadable += 1;
            return Ok(());
        };
        let key = (Arc::clone(event.channel), event.fingerprint());
        let topic = match self.known.get(&key) {
            Some(topic) => topic.clone(),
            None => {
                // A channel whose type changes within a log becomes several topics: viewers expect one type per topic.
                let others = self.known.keys().filter(|(channel, _)| *channel == key.0).count();
                let number = if others == 0 { String::new() } else { format!("_{}", others + 1) };
                let topic = format!("/{}{number}", event.channel.trim_start_matches('/'));
                self.known.insert(key, topic.clone());
                topic
            }
        };
        let cdr = to_cdr(&Ros2Value::new(ty, &value));
        if self.topics.contains_key(&topic) {
            return self.write(&topic, "", "", t, &cdr);
        }
        self.write(&topic, &lcm_types::type_name(ty), &lcm_types::definition(ty), t, &cdr)
    }

    /// Writes a message in CDR. Type name and definition are used for the first message of a topic.
    fn write(&mut self, topic: &str, type_name: &str, definition: &str, t: u64, cdr: &[u8]) -> Result<(), Error> {
        let path = &self.path;
        let failed = |source: mcap::McapError| Error::Mcap { path: path.clone(), source: source.into() };
        let known = match self.topics.get_mut(topic) {
            Some(known) => known,
            None => {
                let id = self
                    .out
                    .add_schema(type_name, "ros2msg", definition.as_bytes())
                    .and_then(|schema| self.out.add_channel(schema, topic, "cdr", &BTreeMap::new()))
                    .map_err(failed)?;
                self.topics.entry(topic.to_owned()).or_insert((id, 0))
            }
        };
        let header = MessageHeader { channel_id: known.0, sequence: known.1, log_time: t, publish_time: t };
        known.1 = known.1.wrapping_add(1);
        self.exported.messages += 1;
        self.out.write_to_known_channel(&header, cdr).map_err(failed)
    }

    fn finish(mut self) -> Result<Exported, Error> {
        let path = &self.path;
        self.out.finish().map_err(|source| Error::Mcap { path: path.clone(), source: source.into() })?;
        Ok(self.exported)
    }
}
