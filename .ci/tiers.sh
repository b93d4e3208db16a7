# What .ci/nightly and .ci/weekly share: parts of a tier, run one after another, and their summary.
# shellcheck shell=bash

target=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR=$target CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-never} CARGO_INCREMENTAL=0
# The flags of .cargo/config.toml count.
unset RUSTFLAGS RUSTDOCFLAGS CARGO_BUILD_TARGET CARGO_ENCODED_RUSTFLAGS

# Outcome of each part: name, status, seconds.
parts_done=()
failures=0

# Runs a part, unless others were asked for: `part NAME PROGRAM ARGUMENTS...`
part() {
    local name=$1 started=$SECONDS status=0
    shift
    known+=("$name")
    [ ${#wanted[@]} -eq 0 ] || [[ " ${wanted[*]} " == *" $name "* ]] || return 0
    printf '\n=== %s\n' "$name"
    "$@" || status=$?
    printf -- '--- %s: status %d after %d s\n' "$name" $status $((SECONDS - started))
    parts_done+=("$name: status $status after $((SECONDS - started)) s")
    [ $status -eq 0 ] || failures=$((failures + 1))
}

# A program of the benchmarks: `bench NAME ARGUMENTS...`
bench() { cargo run --quiet --release -p croupier-benches --bin "$1" -- "${@:2}"; }

# What needs the reference scenes, and would be skipped without them: `with_scenes PROGRAM ARGUMENTS...`
with_scenes() {
    [ -d ../shared/scenes ] || { echo "there are no reference scenes beside the repository"; return 1; }
    "$@"
}

# The last lines, and the status.
summary() {
    local name passed=$((${#parts_done[@]} - failures))
    printf '\n'
    for name in ${wanted[@]+"${wanted[@]}"}; do
        [[ " ${known[*]} " == *" $name "* ]] && continue
        echo "no part '$name'; there are: ${known[*]}"
        failures=$((failures + 1))
    done
    printf '%s\n' ${parts_done[@]+"${parts_done[@]}"}
    echo "$passed passed, $failures failed"
    [ $failures -eq 0 ]
}
