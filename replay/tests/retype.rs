//! A log of old types is rewritten with types that have grown.
#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use lcm_idl::{TypeSet, Value};
use mcap::records::MessageHeader;
use replay::log::{EventFilter, FieldChange, LogReader, LogWriter, Types, retype};
use std::collections::BTreeMap;

const OLD: &str =
    "package p; struct in_t { float f; } struct a_t { int32_t n; double x[n]; boolean b; int16_t gone; in_t in[2]; }";
const NEW: &str = "package p; struct in_t { double f; int32_t more; }
    struct a_t { int64_t added; int16_t n; double x[n]; int8_t b; string name; in_t in[3]; }";

#[test]
fn fields_are_matched_by_name_and_differences_listed() {
    let (old, new) = (TypeSet::parse([("old.lcm", OLD)]).unwrap(), TypeSet::parse([("new.lcm", NEW)]).unwrap());
    let (from, to) = (old.by_name("p.a_t").unwrap(), new.by_name("p.a_t").unwrap());
    let mut value = from.default_value();
    value.set("n", 2_i32).unwrap();
    *value.get_mut("x").unwrap() = vec![0.5, 0.25].into();
    value.set("b", true).unwrap();
    value.set("in[1].f", 1.5_f32).unwrap();
    let (folder, log, out) = (common::path("new_types"), common::path("old.mcap"), common::path("new.mcap"));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("new.lcm"), NEW).unwrap();
    let mut writer = LogWriter::create(&log).unwrap();
    writer.add_types(&[("old.lcm".into(), OLD.into())]).unwrap();
    for t_ns in [5, 6] {
        writer.write("A", t_ns, &from.encode(&value).unwrap()).unwrap();
    }
    writer.write("OTHER", 7, b"bytes of no type").unwrap();
    writer.finish().unwrap();

    let filter = EventFilter::default();
    let report = retype(&log, &out, &[folder], &filter, Types::default(), &mut |_| ()).unwrap();
    assert_eq!((report.converted, report.unchanged, report.copy.events), (2, 1, 3));
    let changes: Vec<_> = report.differences.iter().map(|d| (&*d.field, d.change, d.messages)).collect();
    let expected = [
        ("p.a_t.added", FieldChange::Added, 2),
        ("p.a_t.b", FieldChange::Converted, 2),
        ("p.a_t.gone", FieldChange::Removed, 2),
        ("p.a_t.in", FieldChange::Converted, 2),
        ("p.a_t.name", FieldChange::Added, 2),
        ("p.in_t.f", FieldChange::Converted, 2),
        ("p.in_t.more", FieldChange::Added, 2),
    ];
    assert_eq!(changes, expected);
    assert!(!report.is_lossless());

    // The copy describes itself.
    let events: Vec<_> = LogReader::open(&out).unwrap().events().map(Result::unwrap).collect();
    assert_eq!(events.iter().map(|event| event.t_ns).collect::<Vec<_>>(), [5, 6, 7]);
    let value = to.decode(&events[0].data).unwrap();
    assert_eq!(value.get("x"), Some(&Value::from(vec![0.5, 0.25])));
    let number = |path| value.get(path).unwrap().as_i64();
    assert_eq!([number("n"), number("b"), number("added"), number("in[1].more")], [Some(2), Some(1), Some(0), Some(0)]);
    assert_eq!(
        [value.get("in[1].f").unwrap().as_f64(), value.get("in[2].f").unwrap().as_f64()],
        [Some(1.5), Some(0.0)]
    );
    assert_eq!(events[2].data, b"bytes of no type");
    let bytes = std::fs::read(&out).unwrap();
    let first = mcap::MessageStream::new(&bytes).unwrap().next().unwrap().unwrap();
    assert!(String::from_utf8_lossy(&first.channel.schema.as_ref().unwrap().data).contains("int64_t added"));
}

/// The type of the outer message is the same; only the message in its bytes has grown.
#[test]
fn messages_inside_messages_are_rewritten() {
    const BOX: &str =
        "package p; struct box_t { int32_t n; part_t parts[n]; } struct part_t { int32_t size; byte data[size]; }";
    let (old_text, new_text) =
        (format!("{BOX} struct in_t {{ float f; }}"), format!("{BOX} struct in_t {{ double f; int8_t b; }}"));
    let parse = |text: &str| TypeSet::parse([("t.lcm", text)]).unwrap();
    let (old, new) = (parse(&old_text), parse(&new_text));
    let mut inner = old.by_name("p.in_t").unwrap().default_value();
    inner.set("f", 1.5_f32).unwrap();
    let data = old.by_name("p.in_t").unwrap().encode(&inner).unwrap();
    let (folder, log, out) = (common::path("box_types"), common::path("box_old.mcap"), common::path("box_new.mcap"));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("t.lcm"), &new_text).unwrap();
    let boxed = |data: &[u8]| {
        let mut part = old.by_name("p.part_t").unwrap().default_value();
        part.set("size", i32::try_from(data.len()).unwrap()).unwrap();
        *part.get_mut("data").unwrap() = Value::Array(data.iter().map(|byte| Value::Byte(*byte)).collect());
        let mut value = old.by_name("p.box_t").unwrap().default_value();
        value.set("n", 1_i32).unwrap();
        *value.get_mut("parts").unwrap() = Value::Array(vec![part]);
        old.by_name("p.box_t").unwrap().encode(&value).unwrap()
    };
    let mut writer = LogWriter::create(&log).unwrap();
    writer.add_types(&[("t.lcm".into(), old_text.clone())]).unwrap();
    writer.write("IN", 4, &data).unwrap();
    writer.write("BOX", 5, &boxed(&data)).unwrap();
    writer.write("BOX", 6, &boxed(b"no message")).unwrap();
    writer.write("BOX", 7, &boxed(&boxed(&data))).unwrap();
    let deep = (0..20).fold(data.clone(), |data, _| boxed(&data));
    writer.write("BOX", 8, &deep).unwrap();
    writer.finish().unwrap();
    let report = retype(&log, &out, &[folder], &EventFilter::default(), Types::default(), &mut |_| ()).unwrap();
    assert_eq!((report.converted, report.unchanged), (3, 0));
    let events: Vec<_> = LogReader::open(&out).unwrap().events().map(Result::unwrap).collect();
    let (opened, _) = new.by_name("p.box_t").unwrap().decode_opened(&events[1].data).unwrap();
    assert_eq!(opened.get("parts[0].data.f").and_then(Value::as_f64), Some(1.5));
    assert_eq!(opened.get("parts[0].size").and_then(Value::as_i64), Some(8 + 8 + 1));
    assert_eq!(events[2].data, boxed(b"no message"));
    // The state of a sequence is in a snapshot, and contains the states of its controllers.
    assert_eq!(events[3].data, boxed(&events[1].data));
    // The depth is limited.
    assert_eq!(events[4].data, deep);
}

#[test]
fn rewritten_messages_keep_their_publish_time() {
    let types = TypeSet::parse([("old.lcm", OLD)]).unwrap();
    let ty = types.by_name("p.in_t").unwrap();
    let (folder, log, out) = (common::path("times_types"), common::path("times.mcap"), common::path("times_new.mcap"));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("new.lcm"), NEW).unwrap();
    let mut writer = mcap::Writer::new(std::io::BufWriter::new(std::fs::File::create(&log).unwrap())).unwrap();
    let schema = writer.add_schema("p.in_t", "lcm", OLD.as_bytes()).unwrap();
    let channel_id = writer.add_channel(schema, "IN", "lcm", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id, sequence: 0, log_time: 5, publish_time: 3 };
    writer.write_to_known_channel(&header, &ty.encode(&ty.default_value()).unwrap()).unwrap();
    writer.finish().unwrap();

    let report = retype(&log, &out, &[folder], &EventFilter::default(), Types::default(), &mut |_| ()).unwrap();
    assert_eq!(report.converted, 1);
    let bytes = std::fs::read(&out).unwrap();
    let message = mcap::MessageStream::new(&bytes).unwrap().next().unwrap().unwrap();
    assert_eq!((message.log_time, message.publish_time), (5, 3));
    assert!(String::from_utf8_lossy(&message.channel.schema.as_ref().unwrap().data).contains("int32_t more"));
}
