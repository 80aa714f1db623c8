#!/usr/bin/env bash
# Makes target/packages: a Debian package and an archive for each target, and SHA256SUMS.
#
#   packaging/make.sh [TARGET...]       without a TARGET: this machine's, and aarch64-unknown-linux-gnu
#
# PROFILE=release takes that profile's program in place of `dist` (for a check: larger and slower). A target whose toolchain
# is not there is reported and left out; the exit status is 1 if nothing could be made, or if this machine's package failed.
set -euo pipefail
cd "$(dirname "$0")/.."
profile=${PROFILE:-dist}
host=$(rustc -vV | sed -n 's/^host: //p')
[ $# -gt 0 ] || set -- "$host" aarch64-unknown-linux-gnu
build=${CARGO_TARGET_DIR:-$PWD/target}
packages=$PWD/target/packages
generated=packaging/generated # by the paths in ui/Cargo.toml
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
# Equal inputs give equal archives.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || echo 0)
export SOURCE_DATE_EPOCH
mkdir -p "$packages"
rm -f "$packages/SHA256SUMS"

# Says why a target cannot be built; nothing if it can.
missing() {
    local target=$1 tool
    rustc --print target-libdir --target "$target" >/dev/null 2>&1 && [ -d "$(rustc --print target-libdir --target "$target")" ] ||
        { echo "its standard library is not installed: rustup target add $target"; return; }
    case $target in
        "$host") ;;
        *)
            tool="${target%%-*}-linux-gnu-gcc"
            command -v "$tool" >/dev/null || echo "$tool is not installed: on Debian apt install gcc-${target%%-*}-linux-gnu"
            ;;
    esac
}

# Builds the program of a target; prints its path.
program() {
    local target=$1 folder=$build
    local arguments=(--locked --quiet -p quadfrog-console --features go2 --profile "$profile")
    if [ "$target" != "$host" ]; then
        arguments+=(--target "$target")
        folder=$build/$target
        local gcc="${target%%-*}-linux-gnu-gcc" upper=${target//-/_}
        export "CARGO_TARGET_${upper^^}_LINKER=$gcc" "CC_$upper=$gcc"
    fi
    # In a condition bash does not end the function at a command that failed: the program of an earlier build would be packed.
    cargo build "${arguments[@]}" >&2 || return 1
    echo "$folder/$profile/quadfrog"
}

# Manual pages and completions, by the program of this machine: they are the same for all.
generate() {
    rm -rf "$generated"
    mkdir -p "$generated/man" "$generated/completions"
    "$1" man "$generated/man" >/dev/null
    gzip -9 -n "$generated"/man/*.1
    "$1" completions bash >"$generated/completions/quadfrog.bash"
    "$1" completions zsh >"$generated/completions/_quadfrog"
    "$1" completions fish >"$generated/completions/quadfrog.fish"
}

# Newest version of glibc that a program asks for.
glibc() {
    objdump -T "$1" 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -V | tail -n 1 | cut -d _ -f 2
}

# The Debian package and the archive of a stripped program.
pack() {
    local target=$1 binary=$2 name="quadfrog-$version-$1" folder
    folder=$(mktemp -d)
    mkdir -p "$folder/$name/share/examples"
    install -m 755 "$binary" "$folder/$name/quadfrog"
    if [ "$target" = "$host" ]; then strip "$folder/$name/quadfrog"; else "${target%%-*}-linux-gnu-strip" "$folder/$name/quadfrog"; fi
    echo "$target: $(stat -c %s "$folder/$name/quadfrog") bytes, needs glibc $(glibc "$binary") or newer"
    if command -v dpkg-deb >/dev/null && python3 -c 'import tomllib' 2>/dev/null; then
        packaging/deb.py "$folder/$name/quadfrog" "$(debian "$target")" "$packages"
    else
        echo "$target: no Debian package; install dpkg and Python 3.11 or newer"
    fi
    cp -r "$generated/man" "$generated/completions" packaging/limits.conf packaging/quadfrog-worker.service "$folder/$name/share/"
    cp -r robots "$folder/$name/share/"
    (cd examples && cp --parents */*.toml "$folder/$name/share/examples/")
    cp README.md CHANGELOG.md CITATION.cff LICENSE-MIT LICENSE-APACHE "$folder/$name/"
    tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$folder" -cf - "$name" |
        gzip -9 -n >"$packages/$name.tar.gz"
    rm -rf "$folder"
}

# Debian's name of an architecture.
debian() {
    case $1 in
        x86_64-*) echo amd64 ;;
        aarch64-*) echo arm64 ;;
        *) echo "${1%%-*}" ;;
    esac
}

host_program=$(program "$host")
generate "$host_program"
made=0
for target in "$@"; do
    # No package of an earlier build passes for one of this.
    rm -f "$packages/quadfrog-$version-$target.tar.gz" "$packages/quadfrog_$version-1_$(debian "$target").deb"
    reason=$(missing "$target")
    if [ -n "$reason" ]; then
        echo "$target: not made; $reason"
        continue
    fi
    if ! binary=$(program "$target"); then
        echo "$target: not made; the build failed, see above"
        [ "$target" != "$host" ] || exit 1
        continue
    fi
    pack "$target" "$binary"
    made=$((made + 1))
done
[ "$made" -gt 0 ]
(cd "$packages" && find . -name '*.deb' -o -name '*.tar.gz' | sort | xargs sha256sum >SHA256SUMS)
ls -l "$packages"
