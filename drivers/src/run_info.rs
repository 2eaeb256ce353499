//! RUN_INFO: everything a log needs to rebuild its controller and to identify the build and machine that wrote it.

use crate::components::EXTERNAL;
use crate::robot_info::imu_links;
use crate::scenario::Object;
use controller::digest::Digest;
use controller::params::Params;
use lcmtypes::{ComponentInfo, Message, RunInfo, TextFile};
use replay::engine::Build;
use robot_model::{JointKind, UrdfTree};
use std::collections::BTreeSet;

/// The part of RUN_INFO that differs between runs of one build.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Name of the first component, and its kind, as [`controller::load`] expects it.
    pub first: (&'a str, &'a str),
    /// The other components, without stages.
    pub others: &'a [ComponentInfo],
    /// Name of the robot.
    pub robot: &'a str,
    /// Text of its URDF.
    pub urdf: &'a str,
    /// Every parameter, as TOML.
    pub params: &'a str,
    /// Name and text of the scenario.
    pub scenario: (&'a str, &'a str),
    /// Objects of the scenario.
    pub objects: &'a [Object],
    /// Seed of terrain and noise.
    pub seed: i64,
}

/// Fills RUN_INFO for a lockstep run on this machine. A live run replaces `t_ns`, `run_id` and `realtime`.
pub fn describe(run: &Run, build: &Build) -> RunInfo {
    let lcm_types: Vec<TextFile> = lcmtypes::SOURCES
        .iter()
        .map(|(name, text)| TextFile { name: (*name).to_owned(), text: (*text).to_owned() })
        .collect();
    let Build { revision, dirty, toolchain, flags } = build.clone();
    let mut info = RunInfo {
        t_ns: 0,
        run_id: 0,
        robot: run.robot.to_owned(),
        urdf: run.urdf.to_owned(),
        scenario_name: run.scenario.0.to_owned(),
        scenario: run.scenario.1.to_owned(),
        n_objects: i32::try_from(run.objects.len()).expect("a scenario has at most 64 objects"),
        objects: run.objects.iter().map(|object| object.name.clone()).collect(),
        seed: run.seed,
        revision,
        dirty,
        toolchain,
        build: flags,
        host: host(),
        realtime: "lockstep".to_owned(),
        num_lcm_types: i32::try_from(lcm_types.len()).expect("there are a few dozen types"),
        lcm_types,
        ..RunInfo::default()
    }
    .with_component(ComponentInfo { name: run.first.0.to_owned(), ..ComponentInfo::new(run.first.1, run.params) });
    info.components.extend(run.others.iter().cloned());
    info.n_components = i32::try_from(info.components.len()).expect("a few components");
    name_parts(&mut info);
    info.run_id = content_id(&info);
    info
}

/// Fills in the names of joints and stages, and the links of IMUs and contacts. Texts that cannot be read leave them empty: building the controller reports
/// the error.
fn name_parts(info: &mut RunInfo) {
    let count = |n: usize| i32::try_from(n).expect("robots have fewer than 2^31 parts");
    if let Ok(tree) = UrdfTree::parse(&info.urdf, &info.robot) {
        let params = Params::from_toml(info.params(), "parameters").ok();
        if let Some(robot) = params.and_then(|params| params.robot.description(&tree).ok()) {
            info.imus = imu_links(&robot);
            info.contacts = robot.contacts.into_iter().map(|contact| contact.link).collect();
        }
        let joints = tree.joints.into_iter().filter(|joint| joint.kind != JointKind::Fixed);
        info.joints = joints.map(|joint| joint.name).collect();
    }
    (info.n_joints, info.n_imus) = (count(info.joints.len()), count(info.imus.len()));
    info.n_contacts = count(info.contacts.len());
    // The first component commands the joints that no other one commands.
    let others = info.components.iter().skip(1).flat_map(|component| &component.joints);
    let others: BTreeSet<String> = others.cloned().collect();
    let own: Vec<String> = info.joints.iter().filter(|joint| !others.contains(*joint)).cloned().collect();
    if let Some(first) = info.components.first_mut() {
        (first.n_joints, first.joints) = (count(own.len()), own);
    }
    for index in 0..info.components.len() {
        let component = if info.components[index].kind == EXTERNAL { continue } else { info.of_component(index) };
        let Ok(component) = controller::load(&component) else { continue };
        let info = &mut info.components[index];
        info.stages = component.stages().iter().map(ToString::to_string).collect();
        info.n_stages = count(info.stages.len());
    }
}

/// 64-bit digest of a description.
fn content_id(info: &RunInfo) -> i64 {
    let mut bytes = Vec::new();
    info.encode(&mut bytes).expect("the number of types is that of the list");
    let mut digest = Digest::default();
    for word in bytes.chunks(8) {
        let mut padded = [0; 8];
        padded[..word.len()].copy_from_slice(word);
        digest.word(u64::from_be_bytes(padded));
    }
    digest.word(bytes.len() as u64);
    digest.finish()
}

/// Host name, kernel, CPU.
fn host() -> String {
    let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default().trim().to_owned();
    let cpuinfo = file("/proc/cpuinfo");
    let cpu = cpuinfo.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split(": ").nth(1));
    format!(
        "{}, Linux {}, {}",
        file("/proc/sys/kernel/hostname"),
        file("/proc/sys/kernel/osrelease"),
        cpu.unwrap_or("unknown CPU")
    )
}
