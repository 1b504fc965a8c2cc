#!/usr/bin/env python3
"""Checks rules of this repository that no compiler checks. Usage: lint_layers.py ROOT | --self-test

- A member of src/dynamic_slam includes only members of lower layers (the table in docs/architecture.md) and itself.
- No iteration over an unordered container, and no ordered container keyed by pointers: both follow addresses or hashes,
  and runs would differ.
- Threads are made in base/worker only, so that all of them are stopped and joined and their failures heard of.
- No file of src, apps, bench or ros is longer than 500 lines. Headers have #pragma once and no `using namespace`.
"""

import pathlib
import re
import sys
import tempfile

MAX_LINES = 500
INCLUDE = re.compile(r'^\s*#\s*include\s*"dynamic_slam/([a-z_0-9]+)/')
TABLE_ROW = re.compile(r"^\|\s*(L\d+)?\s*\|\s*`([a-z_0-9]+)`\s*\|")
UNORDERED = re.compile(r"\bunordered_(?:multi)?(?:map|set)\s*<")
THREAD = re.compile(r"\bstd::(?:jthread|thread|async)\b(?!::)|\bpthread_create\b")
THREAD_MAKERS = ["src/dynamic_slam/base/worker.h", "src/dynamic_slam/base/worker.cc",
                 "src/dynamic_slam/base/trace_test.cc"]  # a worker always has a name; traces know threads without
POINTER_KEY = re.compile(r"\bstd::(?:multi)?(?:map|set)\s*<\s*(?:const\s+)?[\w:]+\s*(?:const\s*)?\*")


def read_layers(root):
    """{member: layer number}, from the architecture's table; a row without a layer belongs to the one above."""
    layers, layer = {}, None
    for line in (root / "docs/architecture.md").read_text().splitlines():
        row = TABLE_ROW.match(line)
        if row:
            layer = int(row.group(1)[1:]) if row.group(1) else layer
            layers[row.group(2)] = layer
    return layers


def without_comments(text):
    """The text with the same lines, but without comments and the contents of strings."""
    pattern = r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"'
    keep = lambda m: m.group(0) if m.group(0)[0] == '"' and "dynamic_slam/" in m.group(0) else \
        ('""' if m.group(0)[0] == '"' else "\n" * m.group(0).count("\n"))
    return re.sub(pattern, keep, text, flags=re.S)


def unordered_names(code):
    """Names of variables and members that are declared as unordered containers."""
    names = set()
    for found in UNORDERED.finditer(code):
        depth, at = 1, found.end()
        while at < len(code) and depth > 0:
            depth += {"<": 1, ">": -1}.get(code[at], 0)
            at += 1
        name = re.match(r"\s*[&*]?\s*([A-Za-z_]\w*)", code[at:])
        if name:
            names.add(name.group(1))
    return names


def check_threads(code):
    """Yields (line number, problem)."""
    for number, line in enumerate(code.splitlines(), 1):
        if THREAD.search(line):
            yield number, "a thread outside of base/worker: use a Worker"


def check_file(path, code, names, layers, member):
    """Yields (line number, problem)."""
    is_header = path.suffix == ".h"
    lines = code.splitlines()
    if len(lines) > MAX_LINES:
        yield len(lines), f"{len(lines)} lines, more than {MAX_LINES}: split the file"
    if is_header and not any(line.strip() == "#pragma once" for line in lines):
        yield 1, "a header needs #pragma once"
    for number, line in enumerate(lines, 1):
        include = INCLUDE.match(line)
        if include and member is not None:
            other = include.group(1)
            if other not in layers:
                yield number, f"includes '{other}', which the table of docs/architecture.md does not have"
            elif other != member and layers[other] >= layers[member]:
                yield number, f"{member} (L{layers[member]}) must not include {other} (L{layers[other]})"
        if is_header and re.search(r"\busing\s+namespace\b", line):
            yield number, "no `using namespace` in a header"
        if POINTER_KEY.search(line):
            yield number, "a container ordered by addresses: key it by id"
        loop = re.search(r"\bfor\s*\([^;]*:\s*(?:[\w\]\[()]+(?:\.|->))*(\w+)\s*\)", line)
        begin = re.search(r"\b(\w+)\s*(?:\.|->)\s*c?begin\s*\(", line)
        for found in (loop, begin):
            if found and found.group(1) in names:
                yield number, f"iteration over the unordered container '{found.group(1)}'"


def check_tree(root):
    """All problems as "file:line: problem"."""
    layers = read_layers(root)
    problems = []
    source = root / "src/dynamic_slam"
    members = sorted(p.name for p in source.iterdir() if p.is_dir()) if source.is_dir() else []
    for member in members:
        if member not in layers:
            problems.append(f"src/dynamic_slam/{member}: is not in the table of docs/architecture.md")
    for member in sorted(layers):
        if member not in members and not (root / member).is_dir():
            problems.append(f"docs/architecture.md: the member '{member}' does not exist")
    for folder in ("tests", "tools"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".h", ".cc"):
                found = check_threads(without_comments(path.read_text()))
                problems += [f"{path.relative_to(root)}:{n}: {p}" for n, p in found]
    for folder in ("src", "apps", "bench", "ros"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            relative = path.relative_to(root)
            code = without_comments(path.read_text())
            names = unordered_names(code)
            header = path.with_suffix(".h")
            if path.suffix == ".cc" and header.exists():
                names |= unordered_names(without_comments(header.read_text()))
            if folder == "src":
                member = relative.parts[2] if relative.parts[2] in layers else None
            else:
                member = folder if folder in layers else None
            found = list(check_file(path, code, names, layers, member))
            if str(relative) not in THREAD_MAKERS:
                found += check_threads(code)
            problems += [f"{relative}:{n}: {p}" for n, p in found]
    return problems


def self_test():
    """Every rule finds its violation, and a clean tree has none."""
    clean = {
        "docs/architecture.md": "| layer | member | what |\n|---|---|---|\n| L0 | `base` | x |\n| L1 | `low` | x |\n"
                                "|    | `beside` | x |\n| L2 | `high` | x |\n",
        "src/dynamic_slam/base/a.h": "#pragma once\n",
        "src/dynamic_slam/base/worker.h": "#pragma once\nstd::jthread thread_;\n",
        "tests/clean.cc": "// std::thread\nstd::this_thread::yield();\n",
        "src/dynamic_slam/low/a.h": '#pragma once\n#include "dynamic_slam/base/a.h"\n#include "dynamic_slam/low/b.h"\n',
        "src/dynamic_slam/low/b.h": "#pragma once\nstd::unordered_map<int, std::vector<int>> table_;\n",
        "src/dynamic_slam/low/b.cc": "// for (auto x : table_)\nif (table_.find(3) == table_.end()) {}\n"
                                     "for (int x : list) {}\n",
        "src/dynamic_slam/beside/a.h": "#pragma once\n",
        "src/dynamic_slam/high/a.h": '#pragma once\n#include "dynamic_slam/low/a.h"\n',
    }
    cases = [
        ({}, None),
        ({"src/dynamic_slam/low/c.cc": '#include "dynamic_slam/high/a.h"\n'}, "low (L1) must not include high (L2)"),
        ({"src/dynamic_slam/low/c.cc": '\n#include "dynamic_slam/beside/a.h"\n'}, "low/c.cc:2: low (L1) must not"),
        ({"src/dynamic_slam/low/c.cc": '#include "dynamic_slam/other/a.h"\n'}, "includes 'other'"),
        ({"src/dynamic_slam/new/a.h": "#pragma once\n"}, "src/dynamic_slam/new: is not in the table"),
        ({"docs/architecture.md": clean["docs/architecture.md"] + "| L3 | `gone` | x |\n"}, "'gone' does not exist"),
        ({"src/dynamic_slam/low/b.cc": "for (const auto& [k, v] : table_) {}\n"}, "unordered container 'table_'"),
        ({"src/dynamic_slam/low/b.cc": "for (auto& x : self->table_) {}\n"}, "unordered container 'table_'"),
        ({"src/dynamic_slam/low/b.cc": "auto it = table_.begin();\n"}, "unordered container 'table_'"),
        ({"src/dynamic_slam/low/c.cc": "std::map<const Node*, int> order;\n"}, "ordered by addresses"),
        ({"src/dynamic_slam/low/c.cc": "x\n" * (MAX_LINES + 1)}, "split the file"),
        ({"src/dynamic_slam/low/c.cc": "std::thread t(run);\n"}, "low/c.cc:1: a thread outside of base/worker"),
        ({"src/dynamic_slam/low/worker.h": "#pragma once\nstd::jthread t;\n"}, "low/worker.h:2: a thread"),
        ({"apps/c.cc": "auto x = std::async(run);\n"}, "apps/c.cc:1: a thread"),
        ({"tests/c.cc": "pthread_create(&t, nullptr, run, nullptr);\n"}, "tests/c.cc:1: a thread"),
        ({"src/dynamic_slam/low/c.h": "int x;\n"}, "#pragma once"),
        ({"src/dynamic_slam/low/c.h": "#pragma once\nusing namespace std;\n"}, "c.h:2: no `using namespace`"),
    ]
    for changes, wanted in cases:
        with tempfile.TemporaryDirectory() as folder:
            for name, text in {**clean, **changes}.items():
                path = pathlib.Path(folder) / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            problems = check_tree(pathlib.Path(folder))
            as_wanted = not problems if wanted is None else len(problems) == 1 and wanted in problems[0]
            if not as_wanted:
                sys.exit(f"self-test: wanted {wanted!r}, found {problems}")
    print(f"{len(cases)} cases as wanted")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    if sys.argv[1] == "--self-test":
        return self_test()
    problems = check_tree(pathlib.Path(sys.argv[1]))
    print("\n".join(problems) or "clean")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
