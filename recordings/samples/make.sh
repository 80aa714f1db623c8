#!/bin/sh
# Makes the samples beside this file again: a forward study of twenty trials with the ticks of its best jump, and a jump that
# ends with a fall. The countdown is short to keep the files small.
set -eu
cd "$(dirname "$0")"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

make() { # name, then arguments of `quadfrog optimize`
    name=$1
    shift
    cargo run --release --quiet -- optimize "$@" --config "config/$name" --operator sample --output "$folder/$name"
    mkdir -p "$name"
    mv "$folder/$name"/*/session.mcap "$folder/$name"/*/study.log "$name"
}

make forward --trials 20 --seed 6 --record best
make fall --trials 1 --record all
