//! A log for the viewers of others: MCAP with ROS 2 messages, which Foxglove, PlotJuggler and rerun open.
//!
//! Every channel of a known type becomes a topic `/CHANNEL` of the same fields (`generic`). Beside them stand what viewers draw a
//! robot from: `/robot_description` (its URDF), `/tf` (100 Hz), `/joint_states`, `/imu`, `/contact/FOOT` (estimated forces) and
//! `/contact_truth/FOOT` (the simulator's). Times are those of the log.

mod cdr;
mod definitions;
mod lcm_types;
mod robot_topics;

pub use robot_topics::BaseSource;

use super::{EventFilter, EventRef, Health, LogReader, Types};
use crate::Error;
use cdr::Cdr;
use lcmtypes::{Message, RunInfo, channels};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use robot_topics::{Robot, Shown};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What was written.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Exported {
    /// The file.
    pub out: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Where the base of the robot is known from; `None` if the log is not of a robot.
    pub base: Option<BaseSource>,
    /// Messages of no known type, malformed ones, and those with a negative time: not in the file.
    pub unreadable: u64,
    /// Damaged stretches of the log.
    pub damaged: u64,
    /// The log stops inside a record.
    pub cut: bool,
}

impl Exported {
    /// Everything that was wanted is there.
    pub fn is_lossless(&self) -> bool {
        self.unreadable == 0 && self.damaged == 0 && !self.cut
    }
}

/// Writes the messages of a log in ROS 2's encoding. `progress` is told which part has been read, 0 to 1.
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
    let mut file = Target::create(out)?;
    let mut robot = scene(log, &mut |part| progress(0.2 * part))?;
    file.exported.base = robot.as_ref().map(|scene| scene.robot.source);
    let mut reader = LogReader::open(log)?;
    let (bytes, mut read, mut health) = (reader.bytes().max(1), 0_u64, Health::default());
    let mut shown = Vec::new();
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        read += 1;
        if read.is_multiple_of(4096) {
            progress(0.2 + 0.8 * event.offset as f64 / bytes as f64);
        }
        types.learn(&event);
        let wanted = filter.accepts(&event);
        let Ok(t) = u64::try_from(event.t_ns) else {
            file.exported.unreadable += 1;
            continue;
        };
        if let Some(scene) = &mut robot {
            if let Some(urdf) = scene.urdf.take() {
                file.describe(t, &urdf)?;
            }
            scene.robot.show(event.channel, event.data, &mut shown);
        }
        for message in shown.drain(..) {
            file.show(t, &message)?;
        }
        if wanted {
            file.event(t, &event, &types)?;
        }
    }
    file.exported.damaged = health.damaged.len() as u64;
    file.exported.cut = health.cut.is_some();
    file.finish()
}

struct Scene {
    robot: Robot,
    /// Not yet written.
    urdf: Option<String>,
}

/// The robot of a log, if it is of one: reads it once to find what says where the base is.
fn scene(log: &Path, progress: &mut dyn FnMut(f64)) -> Result<Option<Scene>, Error> {
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
    Ok(Robot::new(&info, source).map(|robot| Scene { robot, urdf: Some(info.urdf) }))
}

struct Target {
    path: PathBuf,
    out: Writer<BufWriter<File>>,
    /// Topic to channel id and its next sequence.
    topics: BTreeMap<String, (u16, u32)>,
    /// Topic of each channel and type of the log.
    known: BTreeMap<(Arc<str>, Option<u64>), String>,
    exported: Exported,
}

impl Target {
    fn create(path: &Path) -> Result<Self, Error> {
        let file = File::create(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let options = WriteOptions::new().profile("ros2").library("hoofprint").compression(Some(Compression::Zstd));
        let out = options
            .create(BufWriter::new(file))
            .map_err(|source| Error::Mcap { path: path.into(), source: source.into() })?;
        let exported = Exported { out: path.into(), ..Exported::default() };
        Ok(Target { path: path.into(), out, topics: BTreeMap::new(), known: BTreeMap::new(), exported })
    }

    fn describe(&mut self, t: u64, urdf: &str) -> Result<(), Error> {
        let mut cdr = Cdr::new();
        cdr.string(urdf);
        self.put("/robot_description", "std_msgs/msg/String", definitions::STRING, t, &cdr)
    }

    fn show(&mut self, t: u64, shown: &Shown) -> Result<(), Error> {
        match shown {
            Shown::Transforms(cdr) => self.put("/tf", "tf2_msgs/msg/TFMessage", definitions::TF_MESSAGE, t, cdr),
            Shown::JointState(cdr) => {
                self.put("/joint_states", "sensor_msgs/msg/JointState", definitions::JOINT_STATE, t, cdr)
            }
            Shown::Imu(cdr) => self.put("/imu", "sensor_msgs/msg/Imu", definitions::IMU, t, cdr),
            Shown::Wrench(topic, cdr) => {
                self.put(topic, "geometry_msgs/msg/WrenchStamped", definitions::WRENCH_STAMPED, t, cdr)
            }
        }
    }

    /// A message of the log as it is.
    fn event(&mut self, t: u64, event: &EventRef<'_>, types: &Types) -> Result<(), Error> {
        let ty = types.of_message(event.channel, event.data);
        let Some((ty, Ok(value))) = ty.map(|ty| (ty, ty.decode(event.data))) else {
            self.exported.unreadable += 1;
            return Ok(());
        };
        let key = (Arc::clone(event.channel), event.fingerprint());
        let topic = match self.known.get(&key) {
            Some(topic) => topic.clone(),
            None => {
                // A channel whose type changes within a log becomes two topics: no viewer takes two types of one.
                let others = self.known.keys().filter(|(channel, _)| *channel == key.0).count();
                let number = if others == 0 { String::new() } else { format!("_{}", others + 1) };
                let topic = format!("/{}{number}", event.channel.trim_start_matches('/'));
                self.known.insert(key, topic.clone());
                topic
            }
        };
        let mut cdr = Cdr::new();
        lcm_types::encode(ty, &value, &mut cdr);
        if self.topics.contains_key(&topic) {
            return self.put(&topic, "", "", t, &cdr);
        }
        self.put(&topic, &lcm_types::type_name(ty), &lcm_types::definition(ty), t, &cdr)
    }

    fn put(&mut self, topic: &str, type_name: &str, definition: &str, t: u64, cdr: &Cdr) -> Result<(), Error> {
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
        self.out.write_to_known_channel(&header, cdr.bytes()).map_err(failed)
    }

    fn finish(mut self) -> Result<Exported, Error> {
        let path = &self.path;
        self.out.finish().map_err(|source| Error::Mcap { path: path.clone(), source: source.into() })?;
        Ok(self.exported)
    }
}
