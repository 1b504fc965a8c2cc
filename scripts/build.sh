#!/usr/bin/env bash
# build.sh PRESET [TARGET...]: configures and builds into build/PRESET, with as many jobs as cores and memory allow.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
preset="$1"
shift

# A compiler job needs up to 1.5 GB; a container's limit counts as much as the machine's memory.
available_mb=$(awk '/^MemAvailable:/ {print int($2 / 1024)}' /proc/meminfo)
limit="$(cat /sys/fs/cgroup/memory.max 2>/dev/null || echo max)"
if [[ "$limit" =~ ^[0-9]+$ ]] && ((limit / 1048576 < available_mb)); then available_mb=$((limit / 1048576)); fi
jobs=$(nproc)
if ((available_mb / 1500 < jobs)); then jobs=$((available_mb / 1500)); fi
if ((jobs < 1)); then jobs=1; fi

mkdir -p "build/$preset"
log="build/$preset/configure.log"
if ! cmake --preset "$preset" >"$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi

command=(cmake --build "build/$preset" -j "$jobs")
if [[ $# -gt 0 ]]; then command+=(--target "$@"); fi
if [[ -t 1 ]]; then
  "${command[@]}"
else
  # Without a terminal: one line per tenth, and everything that is not progress.
  "${command[@]}" 2>&1 | awk '
    match($0, /^\[[0-9]+\/[0-9]+\]/) {
      split(substr($0, 2, RLENGTH - 2), part, "/")
      tenth = int(10 * part[1] / part[2])
      if (tenth != last) { print "build " tenth * 10 " %"; fflush() }
      last = tenth
      next
    }
    { print; fflush() }'
fi
