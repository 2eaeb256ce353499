//! One file per experiment. Identifiers A1 to A12 follow the list of the paper's experiments (Raiola et al. 2020); the others are ours.

mod acceleration_bound;
mod base_height;
mod base_motion;
mod base_position;
mod equivalences;
mod further_tasks;
mod gait_speeds;
mod ik_benchmark;
mod limits;
mod long_log;
mod other_robot;
mod posture_alone;
mod printed;
mod residual_load;
mod robots;
mod rough_terrain;
mod sensor_noise;
mod shared;
mod solve_time;
mod stack_weights;
mod touchdown;
mod walking_limits;

use crate::experiment::Experiment;
use anyhow::Context;

/// Every experiment, in the order in which `all` runs them.
pub const ALL: &[Experiment] = &[
    solve_time::EXPERIMENT,
    base_motion::EXPERIMENT,
    rough_terrain::EXPERIMENT,
    other_robot::EXPERIMENT,
    sensor_noise::EXPERIMENT,
    touchdown::EXPERIMENT,
    base_position::EXPERIMENT,
    base_height::EXPERIMENT,
    stack_weights::EXPERIMENT,
    equivalences::EXPERIMENT,
    acceleration_bound::EXPERIMENT,
    residual_load::EXPERIMENT,
    printed::EXPERIMENT,
    further_tasks::EXPERIMENT,
    gait_speeds::EXPERIMENT,
    posture_alone::EXPERIMENT,
    limits::HYQ,
    limits::ANYMAL_B,
    walking_limits::HYQ,
    walking_limits::ANYMAL_B,
    long_log::EXPERIMENT,
    robots::EXPERIMENT,
    ik_benchmark::EXPERIMENT,
];

/// The experiments with these identifiers; `all` selects every one, in the order of [`ALL`]. Case does not matter.
///
/// # Errors
/// An unknown identifier; the message lists the known ones.
pub fn find(ids: &[String]) -> anyhow::Result<Vec<&'static Experiment>> {
    if ids.iter().any(|id| id.eq_ignore_ascii_case("all")) {
        return Ok(ALL.iter().collect());
    }
    let one = |id: &String| {
        ALL.iter().find(|e| e.id.eq_ignore_ascii_case(id)).with_context(|| {
            let known: Vec<_> = ALL.iter().map(|e| e.id).collect();
            format!("unknown experiment \"{id}\"; known: {}, all", known.join(", "))
        })
    };
    ids.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_unique_and_found_in_any_case() {
        let ids: std::collections::BTreeSet<&str> = ALL.iter().map(|e| e.id).collect();
        assert_eq!(ids.len(), ALL.len());
        let found = |ids: &[&str]| find(&ids.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>());
        assert_eq!(found(&["a3", "LIMITS"]).unwrap().iter().map(|e| e.id).collect::<Vec<_>>(), ["A3", "limits"]);
        assert_eq!(found(&["All"]).unwrap().len(), ALL.len());
        assert!(found(&["A13"]).is_err());
    }

    #[test]
    fn every_experiment_of_the_paper_is_listed() {
        for number in 1..=12 {
            assert!(ALL.iter().any(|e| e.id == format!("A{number}")), "A{number}");
        }
    }
}
