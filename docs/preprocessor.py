"""Preprocessor of the book (docs/book.toml), run by mdBook.

1. Equations become MathML, which browsers draw without scripts, fonts or a network: a fenced block `math` a displayed equation,
   $`...`$ one within a line. The same notation is drawn by GitHub.
2. A page of the book that is cited as `docs/NAME.md`, or by the path of the file that it includes, becomes a link.
3. A link to a file of the repository that is not in the book becomes its text.
"""

import json
import posixpath
import re
import sys

from latex2mathml.converter import convert

# Fenced and indented code, then one line of code; the text outside of both is never changed by rule 2.
FENCE = re.compile(r"^(?P<fence>```+|~~~+)(?P<language>[^\n`]*)\n(?P<body>.*?)^(?P=fence)[ ]*$", re.M | re.S)
INLINE_MATH = re.compile(r"\$`([^`]+)`\$")
CITED = re.compile(r"(?<!\[)`([\w./-]+\.md)`(?!\])")
OUTSIDE = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)]*)\)")


def equation(source, display):
    """Returns an equation as MathML on one line: a blank line would end the HTML block."""
    converted = convert(source.strip(), display=display).replace("\n", " ")
    unknown = re.search(r">(?:\\\w+|&)<", converted)
    if unknown:
        sys.exit(f"no MathML for {unknown[0][1:-1]} in the equation {source.strip()}")
    return converted


def prose(text, page, pages):
    """Returns text without fenced code, with equations and links."""
    lines = []
    for line in text.split("\n"):
        if not line.startswith("    "):
            line = INLINE_MATH.sub(lambda found: equation(found[1], "inline"), line)

            def link(found):
                target = pages.get(found[1])
                if target is None or target == page:
                    return found[0]
                return f"[{found[0]}]({posixpath.relpath(target, posixpath.dirname(page) or '.')})"

            line = CITED.sub(link, line)
            line = OUTSIDE.sub(lambda found: pages_link(found, page, pages), line)
        lines.append(line)
    return "\n".join(lines)


def pages_link(found, page, pages):
    """Returns a link that leaves the book's folder as a link to the page of that file, or as its text."""
    path, _, anchor = found[2].partition("#")
    target = pages.get(posixpath.normpath(posixpath.join("docs", posixpath.dirname(page), path)))
    if target is None:
        return found[1]
    relative = posixpath.relpath(target, posixpath.dirname(page) or ".")
    return f"[{found[1]}]({relative}{'#' + anchor if anchor else ''})"


def chapter_text(text, page, pages):
    parts, at = [], 0
    for found in FENCE.finditer(text):
        parts.append(prose(text[at : found.start()], page, pages))
        is_math = found["language"].strip() == "math"
        parts.append(f"\n{equation(found['body'], 'block')}\n" if is_math else found[0])
        at = found.end()
    parts.append(prose(text[at:], page, pages))
    return "".join(parts)


def chapters(items):
    for item in items:
        chapter = item.get("Chapter") if isinstance(item, dict) else None
        if chapter:
            yield chapter
            yield from chapters(chapter["sub_items"])


def main():
    if sys.argv[1:2] == ["supports"]:
        sys.exit(0 if sys.argv[2] == "html" else 1)
    context, book = json.load(sys.stdin)
    found = [chapter for chapter in chapters(book.get("items", book.get("sections", []))) if chapter.get("path")]
    pages = {f"docs/{chapter['source_path']}": chapter["path"] for chapter in found}
    # Pages of which another file of the repository is the text.
    for chapter in found:
        with open(posixpath.join(context["root"], chapter["source_path"]), encoding="utf-8") as file:
            for included in re.findall(r"^\{\{#include (\S+)\}\}$", file.read(), re.M):
                pages[posixpath.normpath(posixpath.join("docs", posixpath.dirname(chapter["path"]), included))] = chapter["path"]
    for chapter in found:
        chapter["content"] = chapter_text(chapter["content"], chapter["path"], pages)
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
