#!/usr/bin/env bash
# Records all golden logs again, after a change that affects each of them, such as a new field in a message. Commit the code first, so that the logs
# name an existing revision. After a change of computed numbers use `hoof corpus accept`, which stores the reason for each log.
# usage: scripts/record_golden.sh HOOF
set -euo pipefail
cd "$(dirname "$0")/.."
hoof=${1:?the command to record with, such as target/release/hoof}
runs=$(mktemp -d)
trap 'rm -rf "$runs"' EXIT

record() {  # NAME ROBOT SCENARIO WHY [SET]...
    # Exit code 1: the robot is in DAMPING, which some logs are recorded for.
    "$hoof" sim --robot "$2" --scenario "scenarios/$3.toml" --log "$runs/$1.mcap" "${@:5}" || [ $? = 1 ]
    "$hoof" corpus add "$runs/$1.mcap" --name "$1" --why "$4"
}

rm -f logs/golden/*.mcap logs/golden/corpus.toml
record flat_trot hyq short_flat "HyQ trots for two seconds on flat ground"
record rough_trot hyq short_rough "HyQ trots for two seconds on rough ground"
record crawl_to_trot hyq short_crawl "HyQ crawls, leaning, and changes to a trot while it walks"
record fault_to_damping hyq short_fault "a weak knee, a lost message, at last an encoder that reads no number: the joints are damped"
record anymal_trot anymal_b short_rough "ANYmal B trots for two seconds on rough ground"
record lie_stand_walk_sit hyq short_lie "HyQ gets up, trots, sits down, is stopped and let go, fast" \
    --set stand.rise_speed=1.0 --set stand.joint_speed=5.0
record pushes_switches hyq short_pushes "HyQ is pushed in a trot, changes its gait twice while it walks, and two parameters change"
record fault_and_recovery hyq short_recovery "an encoder that reads no number damps the joints; the operator lets HyQ stand up and walk again" \
    --set stand.rise_speed=1.0 --set stand.joint_speed=5.0
record steps_s3 hyq short_steps "HyQ trots over steps with the prioritized stack: feet lose contact and search for the ground" --stack s3
