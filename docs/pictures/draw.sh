#!/bin/sh
# Draws the pictures of the README and of the manual from the recordings in `recordings/samples`: `sh docs/pictures/draw.sh [FOLDER]`, by default
# into this folder. QUADFROG names the program; by default it is built.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
into=${1:-$here}
program=${QUADFROG:-}
if [ -z "$program" ]; then
    cargo build --release --quiet --manifest-path "$root/Cargo.toml"
    program=$root/target/release/quadfrog
fi
draw() {
    name=$1
    shift
    "$program" screenshot "$@" --output "$into/$name.svg"
}
best=$root/recordings/samples/forward
fall=$root/recordings/samples/fall
draw jump "$best" --trial 12 --animate 2.5 --frames-per-second 6 --keys "+ +"
draw live "$best" --trial 12
draw trials "$best" --keys 2 --size 100x30
draw optimizer "$best" --keys 3
draw fall "$fall" --size 100x30 --theme light
