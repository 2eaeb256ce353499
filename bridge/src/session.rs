//! The loop of the bridge: receives the messages of a run, publishes the newest ones as topics at a fixed rate, and sends velocity commands to the run.

use crate::dds::{Counts, Dds};
use crate::twist::TwistOperator;
use crate::{Error, twist};
use drivers::live::clock::{now_ns, wall_ns};
use drivers::teleop::HEARTBEAT_NS;
use lcmtypes::bus::Bus;
use lcmtypes::{ControllerTick, Event, EventNumbers, Message, RunInfo, channels, new_sender_id};
use replay::log::ros2::{BaseSource, RobotTopics, description};
use std::time::Duration;

/// Channels whose newest message becomes topics, in the order of conversion: contact forces and transforms need the joint state.
const SHOWN: [&str; 3] = [channels::ROBOT_STATE, channels::BASE_TRACKING, channels::CONTACT_ESTIMATE];
/// Time without a CONTROLLER_TICK after which the mode of the controller is unknown, ns.
const TIMEOUT_NS: i64 = 500_000_000;
/// Shortest time between two RUN_INFO that are read, ns: reading one takes milliseconds, and a foreign program may send any number.
const INFO_EVERY_NS: i64 = 1_000_000_000;

/// Options of a bridge.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// DDS domain, `ROS_DOMAIN_ID` of the ROS 2 programs.
    pub domain: u16,
    /// Messages per second and topic.
    pub rate_hz: f64,
    /// Channel of the commands; `None`: velocity commands are not read.
    pub commands: Option<String>,
}

/// Result of a bridge.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Summary {
    /// DDS domain.
    pub domain: u16,
    /// Robot of the run; `None` if no RUN_INFO arrived.
    pub robot: Option<String>,
    /// Topics that were published.
    pub topics: Vec<String>,
    /// Messages and velocity commands.
    #[serde(flatten)]
    pub counts: Counts,
    /// Operator commands sent to the run.
    pub commands: u64,
}

/// A running bridge.
pub struct Session {
    bus: Box<dyn Bus>,
    dds: Dds,
    options: Options,
    name: Option<String>,
    robot: Option<RobotTopics>,
    /// The last RUN_INFO that was read: a run repeats it.
    info: Vec<u8>,
    info_due_ns: i64,
    /// Newest message of each channel of [`SHOWN`] that has not been published.
    newest: [Option<Vec<u8>>; SHOWN.len()],
    /// Mode of the controller and its time of arrival, ns.
    mode: Option<(i8, i64)>,
    operator: TwistOperator,
    /// A velocity command is being followed.
    commands_now: bool,
    commands: u64,
    events: EventNumbers,
    topics_due_ns: i64,
    commands_due_ns: i64,
}

impl Session {
    /// Joins the DDS domain and subscribes to the run.
    ///
    /// # Errors
    /// As [`Dds::join`]; [`Error::Bus`].
    pub fn open(mut bus: Box<dyn Bus>, options: Options) -> Result<Self, Error> {
        let mut dds = Dds::join(options.domain)?;
        if options.commands.is_some() {
            dds.subscribe_to_velocity()?;
        }
        for channel in SHOWN.into_iter().chain([channels::RUN_INFO, channels::CONTROLLER_TICK]) {
            bus.subscribe(channel)?;
        }
        let now_ns = now_ns();
        let mut session = Session {
            bus,
            dds,
            options,
            name: None,
            robot: None,
            info: Vec::new(),
            info_due_ns: i64::MIN,
            newest: [const { None }; SHOWN.len()],
            mode: None,
            operator: TwistOperator::default(),
            commands_now: false,
            commands: 0,
            events: EventNumbers::new(new_sender_id()),
            topics_due_ns: now_ns,
            commands_due_ns: now_ns,
        };
        let from = session.options.commands.as_ref().map_or("no commands".to_owned(), |c| format!("commands on {c}"));
        let text = format!("bridge to ROS 2 started: domain {}, {from}", session.options.domain);
        session.event(text)?;
        Ok(session)
    }

    /// Waits until something is due, and does it.
    ///
    /// # Errors
    /// [`Error::Bus`]; [`Error::Dds`] if a topic cannot be created.
    pub fn step(&mut self) -> Result<(), Error> {
        let due_ns = self.topics_due_ns.min(self.commands_due_ns);
        let wait = Duration::from_nanos(u64::try_from(due_ns.saturating_sub(now_ns())).unwrap_or(0));
        self.receive(wait)?;
        let now_ns = now_ns();
        if now_ns >= self.topics_due_ns {
            self.publish_topics()?;
            self.topics_due_ns = now_ns + (1e9 / self.options.rate_hz) as i64;
        }
        if now_ns >= self.commands_due_ns {
            self.send_command(now_ns)?;
            self.commands_due_ns = now_ns + HEARTBEAT_NS;
        }
        Ok(())
    }

    /// Ends the bridge. A robot that walks by its commands stands when the operator times out.
    ///
    /// # Errors
    /// [`Error::Bus`]
    pub fn end(mut self) -> Result<Summary, Error> {
        self.event("bridge to ROS 2 ended".to_owned())?;
        let topics = self.dds.topics().into_iter().map(str::to_owned).collect();
        let Session { options, name, dds, commands, .. } = self;
        Ok(Summary { domain: options.domain, robot: name, topics, counts: dds.counts, commands })
    }

    /// Takes the messages of the bus. Messages of other types or versions are ignored.
    fn receive(&mut self, wait: Duration) -> Result<(), Error> {
        let messages = self.bus.handle(wait)?;
        let now_ns = now_ns();
        for message in messages {
            if let Some(k) = SHOWN.iter().position(|channel| *channel == message.channel) {
                self.newest[k] = Some(message.data);
            } else if message.channel == channels::CONTROLLER_TICK {
                if let Ok(tick) = ControllerTick::decode(&message.data) {
                    self.mode = Some((tick.mode, now_ns));
                }
            } else if message.channel == channels::RUN_INFO && now_ns >= self.info_due_ns && message.data != self.info {
                self.info_due_ns = now_ns.saturating_add(INFO_EVERY_NS);
                self.read_info(&message.data)?;
                self.info = message.data;
            }
        }
        Ok(())
    }

    fn read_info(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Ok(info) = RunInfo::decode(bytes) else { return Ok(()) };
        let Some(robot) = RobotTopics::new(&info, BaseSource::Estimate) else { return Ok(()) };
        self.robot = Some(robot);
        self.name = Some(info.robot);
        self.dds.publish(description(&info.urdf))
    }

    fn publish_topics(&mut self) -> Result<(), Error> {
        let Some(robot) = &mut self.robot else { return Ok(()) };
        // The clock of a run is monotonic; ROS 2 programs compare times with the wall clock, which may be set during the run.
        robot.stamp_offset_ns = wall_ns().saturating_sub(now_ns());
        let mut topics = Vec::new();
        for (channel, data) in SHOWN.into_iter().zip(&mut self.newest) {
            if let Some(data) = data.take() {
                robot.update_from(channel, &data, &mut topics);
            }
        }
        topics.into_iter().try_for_each(|topic| self.dds.publish(topic))
    }

    fn send_command(&mut self, now_ns: i64) -> Result<(), Error> {
        let Some(channel) = self.options.commands.clone() else { return Ok(()) };
        if let Some(twist) = self.dds.take_twist() {
            self.operator.receive(twist, now_ns);
        }
        let mode = self.mode.filter(|(_, at)| now_ns - at <= TIMEOUT_NS).map(|(mode, _)| mode);
        let command = self.operator.command(now_ns, mode);
        if command.is_some() != self.commands_now {
            self.commands_now = command.is_some();
            let text = if self.commands_now {
                format!("velocity commands from ROS 2 on {channel}")
            } else {
                format!(
                    "no velocity command from ROS 2 for {} s: {channel} sends nothing",
                    twist::HOLD_NS as f64 * 1e-9
                )
            };
            self.event(text)?;
        }
        let Some(mut command) = command else { return Ok(()) };
        command.sender_id = self.events.sender_id();
        self.commands += 1;
        self.send(&channel, &command)
    }

    fn event(&mut self, text: String) -> Result<(), Error> {
        let source = "bridge".to_owned();
        let mut event = Event { t_ns: now_ns(), tick: -1, level: Event::LEVEL_INFO, source, text, ..Event::default() };
        self.events.number(&mut event);
        self.send(channels::EVENT, &event)
    }

    fn send(&mut self, channel: &str, message: &impl Message) -> Result<(), Error> {
        let mut bytes = Vec::new();
        message.encode(&mut bytes).map_err(|source| Error::Encode { channel: channel.to_owned(), source })?;
        Ok(self.bus.publish(channel, &bytes)?)
    }
}
