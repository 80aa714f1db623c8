#!/usr/bin/env python3
"""Makes the Debian package of a built program with dpkg-deb, by [package.metadata.deb] of ui/Cargo.toml.

    packaging/deb.py PROGRAM ARCHITECTURE FOLDER        ARCHITECTURE: amd64, arm64

The table is that of cargo-deb, so that `cargo deb` makes the same package where a version that knows edition 2024 is
installed. PROGRAM is stripped already; `packaging/make.sh` calls this and has made packaging/generated before.
"""

import glob
import gzip
import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
UI = ROOT / "ui"


def sources(pattern):
    """Files of an asset with their paths below the fixed part of its pattern; links are followed."""
    if "*" not in pattern:
        return [(UI / pattern, None)]
    fixed = UI / pattern[: pattern.index("*")]
    fixed = fixed if pattern[: pattern.index("*")].endswith("/") else fixed.parent
    found = [pathlib.Path(name) for name in glob.glob(str(UI / pattern), recursive=True)]
    return [(file, file.relative_to(fixed)) for file in sorted(found) if file.is_file()]


def place(tree, table, program):
    """Copies the assets into the tree of the package."""
    for pattern, destination, mode in table["assets"]:
        found = [(program, None)] if pattern == "target/release/quadfrog" else sources(pattern)
        if not found or not found[0][0].exists():
            sys.exit(f"ui/Cargo.toml, assets: there is no {pattern}; run packaging/make.sh, which makes packaging/generated")
        for source, below in found:
            name = destination + str(below or source.name) if destination.endswith("/") else destination
            target = tree / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
            target.chmod(int(mode, 8))
    # Debian's own form of a licence and of a list of changes.
    documents = tree / "usr/share/doc" / table["name"]
    licence = (UI / table["license-file"][0]).read_text()
    (documents / "copyright").write_text(f"Copyright: {table['copyright']}\nLicense: MIT OR Apache-2.0 (LICENSE-APACHE)\n\n{licence}")
    changes = documents / "CHANGELOG.md"
    with open(documents / "changelog.gz", "wb") as file:
        file.write(gzip.compress(changes.read_bytes(), 9, mtime=0))
    changes.unlink()


def control(tree, table, package, version, architecture):
    """Writes the control files."""
    folder = tree / "DEBIAN"
    folder.mkdir()
    files = [path for path in sorted(tree.rglob("*")) if path.is_file()]
    fields = {
        "Package": table["name"],
        "Version": f"{version}-1",
        "Architecture": architecture,
        "Maintainer": table["maintainer"],
        "Installed-Size": sum(-(-path.stat().st_size // 1024) for path in files),
        "Section": table["section"],
        "Priority": table["priority"],
        "Depends": table["depends"],
        "Recommends": table["recommends"],
        "Suggests": table["suggests"],
        "Description": package["description"],
    }
    text = "".join(f"{name}: {value}\n" for name, value in fields.items())
    text += "".join(f" {line}\n" for line in table["extended-description"].splitlines())
    (folder / "control").write_text(text)
    (folder / "conffiles").write_text("".join(f"{path}\n" for path in table["conf-files"]))
    sums = [f"{hashlib.md5(path.read_bytes()).hexdigest()}  {path.relative_to(tree)}\n" for path in files]
    (folder / "md5sums").write_text("".join(sums))


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    program, architecture, output = sys.argv[1:]
    manifest = tomllib.loads((UI / "Cargo.toml").read_text())
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    package = manifest["package"]
    table = package["metadata"]["deb"]
    os.umask(0o022)
    with tempfile.TemporaryDirectory() as folder:
        tree = pathlib.Path(folder) / "tree"
        tree.mkdir(mode=0o755)
        place(tree, table, pathlib.Path(program))
        control(tree, table, package, version, architecture)
        file = pathlib.Path(output) / f"{table['name']}_{version}-1_{architecture}.deb"
        # xz is what every dpkg reads.
        subprocess.run(["dpkg-deb", "--root-owner-group", "-Zxz", "--build", str(tree), str(file)], check=True, stdout=subprocess.DEVNULL)
    print(file)


if __name__ == "__main__":
    main()
