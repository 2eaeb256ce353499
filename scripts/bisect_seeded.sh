#!/usr/bin/env bash
# Commits changes to branches of a clone and runs `hoof replay bisect` to find them: changed code among 20 revisions, a changed default, a build flag,
# and a new input field. Prints the page docs/bisect.md. The clone and the builds are below the target directory.
# usage: scripts/bisect_seeded.sh HOOF > docs/bisect.md
#        scripts/bisect_seeded.sh HOOF flag field      # some of: twenty default flag field
set -euo pipefail
cd "$(dirname "$0")/.."
hoof=$(realpath "${1:?the command to bisect with, such as target/release/hoof}")
cases=${*:2}
cases=" ${cases:-twenty default flag field} "
work=$(realpath -m "${CARGO_TARGET_DIR:-target}")/bisect
clone=$work/clone
log=$work/run.mcap

mkdir -p "$work"
rm -rf "$clone"
git clone --quiet --shared . "$clone"
"$hoof" sim --robot hyq --scenario scenarios/short_rough.toml --log "$log" >&2
cd "$clone"
git config user.name seed
git config user.email seed@example.org
base=$(git rev-parse HEAD)

commit() {  # MESSAGE
    git add --all
    git commit --quiet --message "$1"
}

# Replaces a text that must occur exactly once in the file.
replace() {  # FILE FROM TO
    python3 - "$@" <<'PYTHON'
import sys
file, old, new = sys.argv[1:]
text = open(file).read()
assert text.count(old) == 1, f"{file}: {old!r} occurs {text.count(old)} times, expected once"
open(file, "w").write(text.replace(old, new))
PYTHON
}

branch() {  # NAME
    git checkout --quiet -B "$1" "$base"
}

search() {  # TITLE; the description is read from standard input
    local begin=$SECONDS
    [[ $cases == *" $(git branch --show-current) "* ]] || return 0
    printf '\n## %s\n\n%s\n\n```text\n$ hoof replay bisect run.mcap --good %s --bad %s\n' "$1" "$(cat)" "${base:0:7}" "$(git branch --show-current)"
    "$hoof" replay bisect "$log" --repo "$clone" --work "$work/work" --good "$base" --bad "$(git branch --show-current)" 2>&1
    printf '```\n\n%d min %02d s.\n' $(((SECONDS - begin) / 60)) $(((SECONDS - begin) % 60))
}

cat <<PAGE
# Bisect, an example

\`scripts/bisect_seeded.sh\` commits changes to branches of a clone at ${base:0:7} and runs \`hoof replay bisect\` to find the commit that changed the first bit of 2 s of
HyQ on stones. For each revision, bisect checks it out, builds \`replay_golden\` (no simulator, no analysis) and runs it; builds are shared, so a revision costs only
what it changes. Times: two cores shared with several compilers; the first time contains the first build.
PAGE

branch twenty
for i in $(seq 1 20); do
    case $i in
        13) replace controller/src/quadruped/swing.rs '(PI * phase, PI * rate / T_sw)' '(3.14159265358979 * phase, PI * rate / T_sw)' ;;
        4 | 8 | 15) echo "// Note $i." >>controller/src/quadruped/gait.rs ;;
        6 | 11 | 18) echo "// Note $i." >>replay/src/prove.rs ;;
        *) echo "Note $i." >>docs/notes.md ;;
    esac
    commit "revision $i"
done
search "Code" <<<"Twenty revisions. Number 13 writes π with one digit fewer than a double has, in the swing. The others are comments in controller and replay, and notes."

branch default
replace controller/src/quadruped/params/swing.rs $'    pub reach_time: f64,\n}' $'    pub reach_time: f64,\n    /// Pace.\n    pub pace: f64,\n}'
replace controller/src/quadruped/params/swing.rs 'reach_time: 0.5 }' 'reach_time: 0.5, pace: 1.0 }'
replace controller/src/quadruped/params/swing.rs 'reach_time } = self' 'reach_time, pace: _ } = self'
replace controller/src/quadruped/reference.rs 'let s = swing_point(t, ' 'let s = swing_point(params.swing.pace * t, '
commit "swing: a pace"
echo "Note." >>docs/notes.md
commit "a note"
replace controller/src/quadruped/params/swing.rs 'pace: 1.0 }' 'pace: 1.01 }'
commit "swing: a quicker pace"
echo "Note." >>docs/notes.md
commit "another note"
search "Configuration" <<<"The default of a parameter that the log does not contain: the first revision adds it, the third changes it."

branch flag
replace controller/src/quadruped/swing.rs 'let (angle, rate) = (PI * phase' 'let pi = if cfg!(coarse) { 3.14159265358979 } else { PI };
    let (angle, rate) = (pi * phase'
commit "swing: a coarser number for small machines"
mkdir -p .cargo
printf '[build]\nrustflags = ["--cfg", "coarse"]\n' >.cargo/config.toml
echo "Note." >>docs/notes.md
commit "build: for small machines"
echo "Note." >>docs/notes.md
commit "a note"
search "Build" <<<"The second revision sets a compiler flag that the code of the first revision reads."

branch field
echo "Note." >>docs/notes.md
commit "a note"
replace lcmtypes/operator_command_t.lcm $'    double step_height;\n' $'    double step_height;\n    double gaze;\n'
commit "operator_command_t: where to look"
echo "Note." >>docs/notes.md
commit "another note"
search "A missing input" <<<"The second revision needs a field that the inputs of the log do not have."
