#!/usr/bin/env python3
"""Installs the Debian package in a root folder that has nothing but the libraries that it depends on, and runs it there.

    tests/support/check_package.py PACKAGE.deb ARCHIVE.tar.gz

Checked: dpkg's own test of the dependencies and conflicts, version, manual pages, completions in bash, the limits file, the
systemd unit, a study of three trials as an ordinary user, the removal; and that the archive has the same program. Needs root
(chroot) and dpkg; without them it says what it leaves out.
"""

import gzip
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

USER = 1234
ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = {file.parent.name for file in ROOT.glob("examples/*/*.toml")}


def run(*command, **options):
    """Runs a command; its output, or the end of this program with it."""
    result = subprocess.run(command, capture_output=True, text=True, **options)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: status {result.returncode}\n{result.stdout}{result.stderr}")
    return result.stdout


def require(statement, what):
    if not statement:
        sys.exit(f"check_package: {what}")
    print(f"ok: {what}")


def library_packages(depends):
    """Names of the packages of a field Depends."""
    return [re.match(r"[a-z0-9.+-]+", part.strip())[0] for part in depends.split(",")]


def make_root(root, depends):
    """The packages of `depends`, copied from this machine with their entries of dpkg's list, and a home."""
    (root / "var/lib/dpkg/info").mkdir(parents=True)
    (root / "var/lib/dpkg/updates").mkdir()
    entries = []
    for name in library_packages(depends):
        entries.append(run("dpkg-query", "--status", name).rstrip() + "\n")
        for line in run("dpkg-query", "--listfiles", name).splitlines():
            file = pathlib.Path(line)
            if (file.suffix == ".so" or ".so." in file.name) and file.is_file():
                # /lib may be a link to /usr/lib here; both paths exist in the root.
                for place in {line, line.removeprefix("/usr")}:
                    target = root / place.lstrip("/")
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(file.resolve(), target)
    # Their own dependencies are not in the root.
    (root / "var/lib/dpkg/status").write_text("\n".join(re.sub(r"(?m)^(Pre-)?Depends:.*\n", "", text) for text in entries))
    interpreter = pathlib.Path("/lib64/ld-linux-x86-64.so.2")
    if interpreter.exists():
        (root / "lib64").mkdir(exist_ok=True)
        shutil.copy(interpreter.resolve(), root / interpreter.relative_to("/"))
    home = root / "home/operator"
    home.mkdir(parents=True)
    os.chown(home, USER, USER)


def inside(root, *command):
    """Runs a command in the root as an ordinary user, with nothing of this environment."""

    def enter():
        os.chroot(root)
        os.chdir("/home/operator")
        os.setgroups([])
        os.setgid(USER)
        os.setuid(USER)

    environment = {"HOME": "/home/operator", "PATH": "/usr/bin", "TERM": "dumb"}
    return run(*command, preexec_fn=enter, env=environment)


def check_completion(root):
    """The installed script in a bash of this machine, with the installed program."""
    script = root / "usr/share/bash-completion/completions/quadfrog"
    commands = (
        f"source {script}; COMP_WORDS=(quadfrog opt); COMP_CWORD=1; COMP_TYPE=9; COMP_LINE='quadfrog opt'; COMP_POINT=12;"
        " _clap_complete_quadfrog quadfrog opt quadfrog; echo \"${COMPREPLY[@]}\""
    )
    answer = run("bash", "-c", commands, env={"PATH": f"{root}/usr/bin:{os.environ['PATH']}"})
    require("optimize" in answer, "bash completes 'opt' to 'optimize'")
    for name, begin in [("zsh/vendor-completions/_quadfrog", "#compdef quadfrog"), ("fish/vendor_completions.d/quadfrog.fish", "complete ")]:
        require((root / "usr/share" / name).read_text().startswith(begin), f"/usr/share/{name}")


def check_files(root):
    pages = sorted((root / "usr/share/man/man1").glob("*.1.gz"))
    text = gzip.decompress((root / "usr/share/man/man1/quadfrog.1.gz").read_bytes()).decode()
    require(len(pages) >= 30 and ".TH quadfrog 1" in text and ".SH SYNOPSIS" in text, f"{len(pages)} manual pages")
    if shutil.which("man"):
        shown = run("man", "-l", root / "usr/share/man/man1/quadfrog-optimize.1.gz", env={**os.environ, "MANPAGER": "cat"})
        require("--trials" in shown, "man shows quadfrog-optimize(1)")
    limits = (root / "etc/security/limits.d/quadfrog.conf").read_text()
    rows = [line.split() for line in limits.splitlines() if line and not line.startswith("#")]
    require(rows == [["@realtime", "-", "rtprio", "99"], ["@realtime", "-", "memlock", "unlimited"]], "limits of the group realtime")
    unit = root / "usr/share/doc/quadfrog/examples/quadfrog-worker.service"
    require("ExecStart=/usr/bin/quadfrog optimize --join" in unit.read_text(), "systemd unit of a worker")
    if shutil.which("systemd-analyze"):
        # Its program is in the root, not on this machine.
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / unit.name
            copy.write_text(unit.read_text().replace("/usr/bin/quadfrog", str(root / "usr/bin/quadfrog")))
            run("systemd-analyze", "--user", "--man=no", "verify", copy, env={**os.environ, "XDG_RUNTIME_DIR": folder})
        print("ok: systemd-analyze verify")


def check_installed(root, package):
    dpkg = ["dpkg", f"--root={root}", "--force-not-root", "--log=/dev/null"]
    run(*dpkg, "--install", package)
    require("install ok installed" in run("dpkg-query", f"--admindir={root}/var/lib/dpkg", "--status", "quadfrog"), "installed by dpkg")
    version = inside(root, "/usr/bin/quadfrog", "--version")
    require(re.fullmatch(r"quadfrog \d+\.\d+\.\d+.*\n", version), f"version: {version.strip()}")
    check_files(root)
    check_completion(root)
    study = inside(root, "/usr/bin/quadfrog", "optimize", "--task", "forward", "--trials", "3", "--seed", "0", "--json", "--output", "studies")
    require(study.count('"trial":') == 3, "a study of three trials as an ordinary user")
    written = sorted(path.name for path in (root / "home/operator/studies").rglob("*") if path.is_file())
    require("study.log" in written and "session.mcap" in written, "its journal and recording are there")
    listed = inside(root, "/usr/bin/quadfrog", "config", "check", "/usr/share/doc/quadfrog/examples/config/rough_terrain")
    require("error" not in listed, "an example configuration of the package is valid")
    packed = {path.name for path in (root / "usr/share/doc/quadfrog/examples/config").iterdir()}
    require(packed == EXAMPLES, f"the package has the {len(packed)} example configurations")
    program = (root / "usr/bin/quadfrog").read_bytes()
    run(*dpkg, "--purge", "quadfrog")
    left = [path for path in root.rglob("*quadfrog*") if "home" not in path.parts and path.is_file()]
    require(not left, "nothing is left after its removal")
    return program


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    package, archive = sys.argv[1:]
    if os.geteuid() != 0 or not shutil.which("dpkg"):
        print("left out: the package is not installed; this needs root and dpkg")
        return
    depends = run("dpkg-deb", "--field", package, "Depends").strip()
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder) / "root"
        root.mkdir(mode=0o755)
        os.chmod(folder, 0o755)
        make_root(root, depends)
        program = check_installed(root, package)
    with tarfile.open(archive) as files:
        names = {name.split("/", 1)[-1]: name for name in files.getnames()}
        require(files.extractfile(names["quadfrog"]).read() == program, "the archive has the same program")
        for name in ["README.md", "LICENSE-MIT", "share/man/quadfrog.1.gz", "share/completions/_quadfrog", "share/robots/go1/go1.urdf"]:
            require(name in names, f"the archive has {name}")
        files_of = [pathlib.PurePath(name) for name, whole in names.items() if files.getmember(whole).isfile()]
        packed = {name.parts[2] for name in files_of if name.parts[:2] == ("share", "examples")}
        require(packed == EXAMPLES, f"the archive has the {len(packed)} example configurations, and nothing else there")


main()
