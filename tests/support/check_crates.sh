#!/usr/bin/env bash
# Packs the two packages as for a registry and checks that each compiles from its packed files alone, without this repository.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-$PWD/target}
cargo package --workspace --no-verify --allow-dirty --quiet
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for name in quadfrog quadfrog-console; do
    tar -xzf "$target/package/$name"-[0-9]*.crate -C "$folder"
    mv "$folder/$name"-[0-9]* "$folder/$name"
    largest=2000000
    size=$(cat "$target/package/$name"-[0-9]*.crate | wc -c)
    echo "$name: $size bytes packed"
    [ "$size" -le "$largest" ] || { echo "$name: more than $largest bytes; see 'include' in its Cargo.toml"; exit 1; }
done
# Versions and profiles of this workspace, so that nothing but the two packages is compiled again. The console takes the
# packed engine in place of that of the registry.
{
    printf '[workspace]\nmembers = ["quadfrog", "quadfrog-console"]\nresolver = "3"\n'
    printf '[patch.crates-io]\nquadfrog = { path = "quadfrog" }\n'
    sed -n '/^\[profile\./,$p' Cargo.toml
} >"$folder/Cargo.toml"
cp Cargo.lock "$folder/"
cd "$folder"
CARGO_TARGET_DIR=$target cargo check --quiet --offline -p quadfrog --lib --examples -p quadfrog-console --bin quadfrog
echo "the packed sources compile"
