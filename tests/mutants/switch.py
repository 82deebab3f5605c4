"""Writes changes of cargo-mutants into Rust source so that an environment variable chooses between them.

`a + b`, where cargo-mutants would write `a - b` as change 7, becomes

    (match crate::mutant::at(7) { 7 => (a - b), _ => (a + b) })

so one build tries every change. The places are found in a syntax tree, by the spans that cargo-mutants prints.
"""

import re

import tree_sitter_rust
from tree_sitter import Language, Parser

PARSER = Parser(Language(tree_sitter_rust.language()))

# What `at` is: the change of this process, and a note of each place that a run comes by.
RUNTIME = """//! Which change of cargo-mutants this process tries; written by tests/mutants.
#![allow(missing_docs, clippy::all)]

use std::fs::File;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{LazyLock, Mutex};

static ACTIVE: LazyLock<u32> = LazyLock::new(|| std::env::var("MUTANT").map_or(0, |id| id.parse().unwrap()));
static REACHED: LazyLock<Option<Mutex<File>>> = LazyLock::new(|| {
    Some(Mutex::new(File::options().append(true).create(true).open(std::env::var_os("MUTANTS_REACHED")?).unwrap()))
});
static SEEN: [AtomicBool; SITES] = [const { AtomicBool::new(false) }; SITES];

#[inline]
pub fn at(site: usize) -> u32 {
    if REACHED.is_some() && !SEEN[site].swap(true, Ordering::Relaxed) {
        let mut file = REACHED.as_ref().unwrap().lock().unwrap();
        file.write_all(format!("{site}\\n").as_bytes()).unwrap();
    }
    *ACTIVE
}
"""


class Change:
    """One change of cargo-mutants: its number, what it is called, and where it is."""

    def __init__(self, number, listed):
        self.number = number
        self.file = listed["file"]
        self.name = listed["name"]
        self.plain = re.sub(r":\d+:\d+:", ":", self.name)
        self.genre = listed["genre"]
        self.returns = (listed["function"] or {}).get("return_type", "")
        self.replacement = listed["replacement"]
        self.span = [(listed["span"][end]["line"], listed["span"][end]["column"]) for end in ("start", "end")]


class Switch:
    """A stretch of source, or a point in it, where changes are chosen between."""

    def __init__(self, start, end, kind):
        self.start, self.end, self.kind = start, end, kind
        self.changes = []  # numbers and the text instead

    def text(self, inner):
        site = self.changes[0][0]
        head = f"match crate::mutant::at({site}) {{\n"
        arms = "".join(f"/*m{number}*/ {number} => {text},\n" for number, text in self.changes)
        if self.kind == "body":
            return f"\n{head}{arms}_ => {{}}\n}}\n"
        if self.kind == "assignment":
            return f"{head}{arms}_ => {{ {inner} }}\n}}"
        if self.kind == "no guard":
            return f" if ({head}{arms}_ => true\n}})"
        return f"({head}{arms}_ => ({inner})\n}})"


def one_line(text):
    return text if "//" in text else " ".join(text.split())


def with_switches(source, changes):
    """The source with `changes` in it, and those changes that it cannot have."""
    raw = source.encode()
    lines = [0]
    for line in source.split("\n"):
        lines.append(lines[-1] + len(line.encode()) + 1)
    text_lines = source.split("\n")

    def offset(place):
        line, column = place
        return lines[line - 1] + len(text_lines[line - 1][: column - 1].encode())

    tree = PARSER.parse(raw)
    switches, left, no_const = {}, [], set()
    for change in changes:
        start, end = (offset(place) for place in change.span)
        found = place_of(tree.root_node, raw, change, start, end)
        if found is None:
            left.append(change)
            continue
        node, (start, end, kind), text = found
        while node is not None and node.type != "function_item":
            if node.type in ("const_item", "static_item"):
                break
            node = node.parent
        if node is None or node.type != "function_item":
            left.append(change)
            continue
        no_const.update(const_of(node, raw))
        switch = switches.setdefault((start, end, kind), Switch(start, end, kind))
        switch.changes.append((change.number, text))
    for start in no_const:
        switches[(start, start + 5, "const")] = Switch(start, start + 5, "const")
    # Outer before inner, and a point before the stretch that begins there.
    ordered = sorted(switches.values(), key=lambda s: (s.start, s.start < s.end, -s.end))
    return written(raw, 0, len(raw), ordered).decode(), left


def const_of(function, raw):
    """Where `const` stands before a function."""
    for child in function.children:
        if child.type == "function_modifiers":
            at = raw[child.start_byte : child.end_byte].find(b"const")
            if at >= 0:
                yield child.start_byte + at


def written(raw, start, end, switches):
    """`raw[start:end]` with the switches in it, which are in order."""
    out, at, i = b"", start, 0
    while i < len(switches):
        switch = switches[i]
        inner = [s for s in switches[i + 1 :] if s.end <= switch.end and s.start < switch.end]
        out += raw[at : switch.start]
        if switch.kind != "const":
            body = written(raw, switch.start, switch.end, inner) if switch.start < switch.end else b""
            out += switch.text(body.decode()).encode()
        at = switch.end
        i += 1 + (len(inner) if switch.start < switch.end else 0)
    return out + raw[at:end]


def up_to(root, start, end, kinds):
    """The smallest node of these kinds about a stretch of source."""
    node = root.descendant_for_byte_range(start, max(start, end - 1))
    while node is not None and node.type not in kinds:
        node = node.parent
    return node


def place_of(root, raw, change, start, end):
    """Node, stretch with its kind, and the text instead; `None` where a change cannot be switched."""

    def of(node):
        return raw[node.start_byte : node.end_byte].decode()

    if change.genre == "FnValue":
        if "impl " in change.returns:
            return None  # two values of one of these types need not be of the same
        node = up_to(root, start, end, {"function_item"})
        body = node.child_by_field_name("body")
        at = body.start_byte + 1
        return body, (at, at, "body"), f"return {change.replacement}"
    if change.genre == "BinaryOperator":
        node = up_to(root, start, end, {"binary_expression", "compound_assignment_expr"})
        operator = node.child_by_field_name("operator") if node else None
        if operator is None or (operator.start_byte, operator.end_byte) != (start, end):
            return None
        left, right = (one_line(of(node.child_by_field_name(side))) for side in ("left", "right"))
        text = f"{left} {change.replacement} {right}"
        if node.type == "compound_assignment_expr":
            return node, (node.start_byte, node.end_byte, "assignment"), f"{{ {text} }}"
        return node, (node.start_byte, node.end_byte, "expression"), f"({text})"
    if change.genre == "UnaryOperator":
        node = up_to(root, start, end, {"unary_expression"})
        if node is None or node.start_byte != start:
            return None
        text = one_line(of(node)[1:])
        return node, (node.start_byte, node.end_byte, "expression"), f"({change.replacement} {text})"
    if change.genre in ("MatchArm", "MatchArmGuard"):
        node = up_to(root, start, end, {"match_arm"})
        pattern = node.child_by_field_name("pattern") if node else None
        if pattern is None:
            return None
        condition = pattern.child_by_field_name("condition")
        text = "false" if change.genre == "MatchArm" else change.replacement
        if condition is None:
            return node, (pattern.end_byte, pattern.end_byte, "no guard"), text
        if re.search(r"\blet\b", of(condition)):
            return None
        return node, (condition.start_byte, condition.end_byte, "expression"), text
    return None
