#!/usr/bin/env python3
"""Checks locks with clang's thread safety analysis. Usage: lint_thread_safety.py ROOT BUILD

Every .cc of src and apps that sees base/mutex.h, itself or through headers, must pass with the flags of
BUILD/compile_commands.json. That a planted mistake is refused shows that the check works. Exits with 77 (skipped) where
there is no clang++.
"""

import json
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

MUTEX = "dynamic_slam/base/mutex.h"
SKIPPED = 77
FLAGS = ["-std=c++20", "-fsyntax-only", "-Wno-everything", "-Wthread-safety", "-Wthread-safety-beta", "-Werror=thread-safety",
         "-Werror=thread-safety-beta"]
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.M)

PLANTED = """
#include "dynamic_slam/base/mutex.h"
class Counter {
 public:
  int Good() DS_EXCLUDES(mutex_) {
    dynamic_slam::MutexLock lock(mutex_);
    while (count_ == 0) changed_.Wait(mutex_);
    return WithLock();
  }
  int Bad() { return %s; }
 private:
  int WithLock() DS_REQUIRES(mutex_) { return count_; }
  dynamic_slam::Mutex mutex_;
  dynamic_slam::CondVar changed_;
  int count_ DS_GUARDED_BY(mutex_) = 0;
};
int Use(Counter* counter) { return counter->Good() + counter->Bad(); }
"""
# What Bad() returns, and what clang says of it.
MISTAKES = [
    ("0", None),
    ("count_", "requires holding mutex 'mutex_'"),
    ("WithLock()", "requires holding mutex 'mutex_'"),
    ("(mutex_.Lock(), 0)", "mutex 'mutex_' is still held at the end of function"),
    ("(mutex_.Lock(), Good())", "while mutex 'mutex_' is held"),
]


def clang(arguments, file):
    """The messages of the analysis, or None when there are none."""
    result = subprocess.run(["clang++", *FLAGS, *arguments, str(file)], capture_output=True, text=True)
    return result.stdout + result.stderr if result.returncode != 0 else None


def check_planted(root):
    """Yields problems of the check itself."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "planted.cc"
        for expression, wanted in MISTAKES:
            file.write_text(PLANTED % expression)
            found = clang([f"-I{root / 'src'}"], file)
            if (wanted is None) != (found is None) or (wanted and wanted not in found):
                yield f"planted '{expression}': wanted {wanted!r}, clang says: {found}"


def sees_mutex(file, root, known):
    """Whether the file includes base/mutex.h, itself or through our headers."""
    if file not in known:
        known[file] = False  # also ends cycles
        for name in INCLUDE.findall(file.read_text()):
            candidates = [root / "src" / name, file.parent / name]
            header = next((path for path in candidates if path.is_file()), None)
            if name == MUTEX or (header is not None and sees_mutex(header, root, known)):
                known[file] = True
                break
    return known[file]


def include_flags(command):
    """The include folders and macros of a compiler's command."""
    flags, words = [], iter(shlex.split(command))
    for word in words:
        if word == "-isystem":
            flags += [word, next(words)]
        elif word.startswith(("-I", "-D")):
            flags.append(word)
    return flags


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    root, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    if shutil.which("clang++") is None:
        print("skipped: there is no clang++ (Debian package clang)")
        sys.exit(SKIPPED)
    problems = list(check_planted(root))

    known, jobs = {}, []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        file = pathlib.Path(entry["file"]).resolve()
        ours = any(file.is_relative_to(root / folder) for folder in ("src", "apps"))
        if ours and not file.name.endswith("_test.cc") and sees_mutex(file, root, known):
            jobs.append((include_flags(entry["command"]), file))
    if not jobs:
        problems.append(f"no file includes {MUTEX}")
    with ThreadPoolExecutor(2) as pool:
        problems += filter(None, pool.map(lambda job: clang(*job), jobs))
    print("\n".join(problems) or f"{len(jobs)} files clean")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
