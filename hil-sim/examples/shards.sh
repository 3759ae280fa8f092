#!/bin/sh
# Runs an experiment in shards, on this machine or on many, and then prints the whole.
#
#     sh hil-sim/examples/shards.sh COUNT FOLDER EXPERIMENT [OPTIONS]
#
# COUNT shards; FOLDER/runs gets the runs as they finish, and FOLDER/whole.json in the end the JSON object. Called again
# with the same arguments it does what is missing. Each shard uses all cores of its machine. Options with spaces are not passed on.
#
# HOSTS   machines, as `parallel --sshlogin` takes them: `alpha,beta,:`, where `:` is this one, the default. Each has this
#         folder under the same path, with the program built from the same sources.
# SIM     the program; default target/release/hil-sim

set -eu
count=$1
folder=$2
shift 2
sim=${SIM:-$PWD/target/release/hil-sim}
mkdir -p "$folder"

if command -v parallel > /dev/null; then
    # Not `.jsonl`: parallel would wrap what the program prints.
    seq "$count" | parallel --will-cite --jobs 1 --sshlogin "${HOSTS:-:}" --workdir "$PWD" \
        --halt soon,fail=1 --results "$folder/{}.shard" \
        "$sim" run "$@" --quiet --shard "{}/$count" --resume "$folder/runs/" > /dev/null
else
    # Without GNU parallel: one shard after the other, on this machine.
    seq "$count" | xargs -I '{}' sh -c 'folder=$1 shard=$2; shift 2; "$@" > "$folder/$shard.shard"' - \
        "$folder" '{}' "$sim" run "$@" --quiet --shard "{}/$count" --resume "$folder/runs/"
fi

seq "$count" | xargs -I '{}' cp "$folder/{}.shard" "$folder/runs/{}.jsonl"
"$sim" run "$@" --quiet --json --resume "$folder/runs/" > "$folder/whole.json"
