#!/usr/bin/env python3
"""Words that readers do not know: none of them is in messages, help, page, proto and documents.

    tests/words.py [--list]      # every place with its word

One word for each thing: for each word that is not used there is the one that is. Checked are the texts: whole documents, comments of
proto, strings of the programs outside of tests, help (doc comments of command-line arguments), and the page without its comments.
Names in the code are none of a reader's business, nor is what stands in backquotes: that is code. A line may be excepted in EXCEPTED.
"""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]

# What is not said (a regular expression), and what is.
WORDS = {
    r"vouch\w*|gives? (?:one's|his|her|its) word|say so with|(?:operator|somebody|nobody)'s word": "confirm",
    r"whoever|whosoever": "the operator, a client, a reader: as the thing is",
    r"unfelt|unseen|detection floor": "undetected",
    r"residues?": "hysteresis, creep",
    r"believed|doubted|held against|(?:is|are|was|were|not) proven": "valid, invalid",
    r"zero (?:still )?holds|(?:zero|force|tare)(?: \\w+)? does not hold": "valid, invalid",
    r"(?:at|of|to|from|proof of|waiting for|shows?|skin and gauge at) rest(?! of)": "unloaded",
    r"out of use|blind": "excluded, faulty, silent",
    r"scenes?": "configuration",
    r"doors?": "connection, listener",
    r"so many\b": "a number",
    r"(?<!of )courses?": "session, ramp",
    r"baselines?": "zero, unloaded count",
    r"laid aside|lay\w* aside": "discarded",
    r"throw\w* away|threw away": "delete, drop",
}

# Texts in which such a word is the right one: where, the line, and why.
EXCEPTED = (
    ("crates/taxel-lab/src/paper/figures.rs", "aseline", "the paper's own word"),
    ("crates/taxel-store/src/models_json.rs", "baseline", "a field of MODELS.json"),
    ("crates/taxel-engine/src/calibration/gauge_zero.rs", "that the gauge read at rest", "part of a method: ids of sets depend on it"),
    ("crates/taxel-lab/README.md", "--only force,stability,scenes", "the name of a section of the report"),
    ("crates/taxel-lab/src/report/args.rs", "scenes", "likewise"),
    ("crates/taxel-lab/src/report/mod.rs", "scenes", "likewise"),
)

SKIPPED = re.compile(r"(^|/)(tests?|benches|examples|fuzz|stability|testdata)(/|\.rs$)|_tests?\.rs$|^tests/.*\.(?:rs|py)$")
LITERAL = re.compile(r'"[^"\n]*"|`[^`]*`')
STRING = re.compile(r'"((?:[^"\\]|\\.)*)"', re.S)


def shipped(text):
    """Rust without what follows the first test module, and without comments."""
    text = re.split(r"\n#\[cfg\(test\)\]\nmod tests? \{", text)[0]
    return re.sub(r"^\s*//(?!/).*$", "", text, flags=re.M)


def texts(path, text):
    """The parts of a file that somebody reads, each with its line."""
    if path.endswith(".md"):
        parts = [(n, line) for n, line in enumerate(text.splitlines(), 1)]
    elif path.endswith(".proto"):
        parts = [(n, line.split("//", 1)[1]) for n, line in enumerate(text.splitlines(), 1) if "//" in line]
    elif path.endswith(".js"):
        code = re.sub(r"^\s*(//|/?\*).*$", "", text, flags=re.M)
        parts = [(code[: m.start()].count("\n") + 1, re.sub(r"\$\{[^}]*\}", "", m.group(0)[1:-1])) for m in LITERAL.finditer(code)]
    elif path.endswith(".html"):
        parts = [(n, line) for n, line in enumerate(text.splitlines(), 1)]
    else:
        code = shipped(text)
        parts = [(code[: m.start()].count("\n") + 1, re.sub(r"\{[^}]*\}", "", m.group(1))) for m in STRING.finditer(re.sub(r"^\s*///.*$", "", code, flags=re.M))]
        if "clap" in code:
            parts += [(n, line) for n, line in enumerate(code.splitlines(), 1) if line.lstrip().startswith("/// ")]
    return [(line, re.sub(r"`[^`]*`", "", part)) for line, part in parts]


def main():
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    wanted = [f for f in files if f.endswith(".md") or f.endswith(".proto") or f.startswith("crates/taxel-page/web/")
              or (f.endswith(".rs") and f.startswith("crates/") and not SKIPPED.search(f))]
    found = []
    for path in wanted:
        if path.endswith(".svg") or path.endswith(".css"):
            continue
        for line, part in texts(path, (ROOT / path).read_text(encoding="utf-8")):
            for word, instead in WORDS.items():
                for hit in re.finditer(rf"(?<![\w-])(?:{word})(?![\w-])", part, re.I):
                    if not any(path == where and excepted in part for where, excepted, _ in EXCEPTED):
                        found.append(f"{path}:{line}: `{hit.group(0)}` -> {instead}: {part.strip()[:110]}")
    if "--list" in sys.argv or found:
        print("\n".join(found))
    assert not found, f"{len(found)} places with words that readers do not know"
    print(f"{len(wanted)} files with {len(WORDS)} sorts of words that readers do not know: none is used")


if __name__ == "__main__":
    main()
