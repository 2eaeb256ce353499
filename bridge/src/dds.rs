//! Participant of a DDS domain: writers of encoded ROS 2 messages, and the reader of `/cmd_vel`.
//!
//! Names as in ROS 2: topic `/imu` is `rt/imu`, type `sensor_msgs/msg/Imu` is `sensor_msgs::msg::dds_::Imu_`. Writers are reliable, as the subscribers of `/tf`
//! require, and never wait: a message for which the window of a slow reader has no room is dropped and counted. `/robot_description` is kept for
//! readers that join later.

use crate::Error;
use crate::twist::Twist;
use replay::log::ros2::TopicMessage;
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataReader, DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, Publisher, QosPolicies, QosPolicyBuilder,
    RepresentationIdentifier, TopicKind,
};
use std::collections::BTreeMap;
use std::convert::Infallible;

/// Largest domain whose UDP ports exist. Source: OMG, *DDS Interoperability Wire Protocol* 2.5, §9.6.1: 7400 + 250 d + 11 ≤ 65535.
pub const LARGEST_DOMAIN: u16 = 232;
/// Most topics that a run may have; the names of feet come from RUN_INFO.
pub const MAX_TOPICS: usize = 64;
/// Messages of a topic that wait for a reader.
const DEPTH: i32 = 10;
/// Most velocity commands read at once.
const MAX_READ: usize = 100;
/// Length of an encapsulation header in CDR.
const HEADER: usize = 4;

/// Counts of a participant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Messages given to DDS.
    pub published: u64,
    /// Messages that were not: a reader is slow, or the run has too many topics.
    pub dropped: u64,
    /// Velocity commands received.
    pub twists: u64,
    /// Velocity commands that could not be decoded.
    pub malformed: u64,
}

/// A participant.
pub struct Dds {
    domain: u16,
    participant: DomainParticipant,
    publisher: Publisher,
    writers: BTreeMap<String, DataWriter<Encoded, Payload>>,
    reader: Option<DataReader<Result<Twist, usize>, Payload>>,
    /// Counts so far.
    pub counts: Counts,
}

impl Dds {
    /// Joins a domain.
    ///
    /// # Errors
    /// [`Error::Domain`]; [`Error::Dds`] if no network can be used.
    pub fn join(domain: u16) -> Result<Self, Error> {
        if domain > LARGEST_DOMAIN {
            return Err(Error::Domain { domain, limit: LARGEST_DOMAIN });
        }
        let participant = DomainParticipantBuilder::new(domain).build();
        let participant = participant.map_err(|e| failed(domain, "join", &e))?;
        let publisher = participant.create_publisher(&qos(false));
        let publisher = publisher.map_err(|e| failed(domain, "create a publisher", &e))?;
        Ok(Dds { domain, participant, publisher, writers: BTreeMap::new(), reader: None, counts: Counts::default() })
    }

    /// Names of the topics that are published.
    pub fn topics(&self) -> Vec<&str> {
        self.writers.keys().map(String::as_str).collect()
    }

    /// Starts to read `/cmd_vel`.
    ///
    /// # Errors
    /// [`Error::Dds`]
    pub fn subscribe_to_velocity(&mut self) -> Result<(), Error> {
        let (domain, what) = (self.domain, "subscribe to /cmd_vel");
        // A best-effort reader accepts writers of both kinds; an old command is of no use.
        let qos = QosPolicyBuilder::new()
            .reliability(Reliability::BestEffort)
            .durability(Durability::Volatile)
            .history(History::KeepLast { depth: DEPTH })
            .build();
        let topic = self.participant.create_topic(
            "rt/cmd_vel".to_owned(),
            "geometry_msgs::msg::dds_::Twist_".to_owned(),
            &qos,
            TopicKind::NoKey,
        );
        let topic = topic.map_err(|e| failed(domain, what, &e))?;
        let subscriber = self.participant.create_subscriber(&qos).map_err(|e| failed(domain, what, &e))?;
        let reader = subscriber.create_datareader_no_key(&topic, None).map_err(|e| failed(domain, what, &e))?;
        self.reader = Some(reader);
        Ok(())
    }

    /// Publishes a message. A message that cannot be published now is dropped and counted.
    ///
    /// # Errors
    /// [`Error::Dds`] if a writer cannot be created.
    pub fn publish(&mut self, message: TopicMessage) -> Result<(), Error> {
        let topic = topic_name(&message.topic);
        if !self.writers.contains_key(&topic) && self.writers.len() < MAX_TOPICS {
            let writer = self.writer(&topic, message.type_name)?;
            self.writers.insert(topic.clone(), writer);
        }
        let payload = message.cdr.get(HEADER..).unwrap_or_default().to_vec();
        let sent = self.writers.get(&topic).is_some_and(|writer| writer.write(Encoded(payload), None).is_ok());
        let count = if sent { &mut self.counts.published } else { &mut self.counts.dropped };
        *count += 1;
        Ok(())
    }

    fn writer(&self, name: &str, ros_type: &str) -> Result<DataWriter<Encoded, Payload>, Error> {
        let (domain, what) = (self.domain, format!("publish {name}"));
        let qos = qos(name == "/robot_description");
        let topic = self.participant.create_topic(format!("rt{name}"), type_name(ros_type), &qos, TopicKind::NoKey);
        let topic = topic.map_err(|e| failed(domain, &what, &e))?;
        self.publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(|e| failed(domain, &what, &e))
    }

    /// The newest velocity command since the last call.
    pub fn take_twist(&mut self) -> Option<Twist> {
        let reader = self.reader.as_mut()?;
        let mut newest = None;
        for _ in 0..MAX_READ {
            match reader.take_next_sample() {
                Ok(Some(sample)) => match sample.into_value() {
                    Ok(twist) => {
                        self.counts.twists += 1;
                        newest = Some(twist);
                    }
                    Err(_) => self.counts.malformed += 1,
                },
                Ok(None) => break,
                Err(_) => self.counts.malformed += 1,
            }
        }
        newest
    }
}

fn failed(domain: u16, what: &str, error: &impl std::fmt::Debug) -> Error {
    Error::Dds { domain, what: what.to_owned(), reason: format!("{error:?}") }
}

fn qos(latched: bool) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time: Duration::ZERO })
        .durability(if latched { Durability::TransientLocal } else { Durability::Volatile })
        .history(History::KeepLast { depth: if latched { 1 } else { DEPTH } })
        .build()
}

/// The topic with characters that ROS 2 allows; a name of a foot may have others.
fn topic_name(topic: &str) -> String {
    topic.chars().map(|c| if c.is_ascii_alphanumeric() || "_/".contains(c) { c } else { '_' }).collect()
}

/// `sensor_msgs/msg/Imu` is `sensor_msgs::msg::dds_::Imu_` in DDS.
fn type_name(ros: &str) -> String {
    match ros.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => ros.to_owned(),
    }
}

/// An encoded message without its encapsulation header.
struct Encoded(Vec<u8>);

/// Passes encoded messages through, and decodes velocity commands.
struct Payload;

impl SerializerAdapter<Encoded> for Payload {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(message: &Encoded) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(&message.0))
    }
}

impl DeserializerAdapter<Result<Twist, usize>> for Payload {
    type Error = Infallible;
    type Decoded = Result<Twist, usize>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }

    fn transform_decoded(decoded: Self::Decoded) -> Self::Decoded {
        decoded
    }
}

impl DefaultDecoder<Result<Twist, usize>> for Payload {
    type Decoder = TwistDecoder;
    const DECODER: TwistDecoder = TwistDecoder;
}

/// Decodes a velocity command; the error is the length found.
#[derive(Clone)]
struct TwistDecoder;

impl<'de> Decode<'de, Result<Twist, usize>> for TwistDecoder {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Result<Twist, usize>, Infallible> {
        let little_endian = encoding == RepresentationIdentifier::CDR_LE;
        Ok(Twist::from_cdr(bytes, little_endian).ok_or(bytes.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_ros_2() {
        assert_eq!(type_name("geometry_msgs/msg/WrenchStamped"), "geometry_msgs::msg::dds_::WrenchStamped_");
        assert_eq!(topic_name("/contact/lf foot\u{1b}[2J"), "/contact/lf_foot__2J");
    }

    #[test]
    fn a_domain_without_ports_is_an_error() {
        match Dds::join(233) {
            Err(Error::Domain { domain, limit }) => assert_eq!((domain, limit), (233, 232)),
            Err(error) => panic!("{error}"),
            Ok(_) => panic!("joined"),
        }
    }
}
