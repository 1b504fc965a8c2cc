#!/usr/bin/env bash
# ./run.sh [SOURCE [options]]: installs what is missing (Debian 12), builds, and runs dynamic_slam on SOURCE; without
# SOURCE on a room that it renders itself. Options are those of `dynamic_slam run`, such as --camera tum_fr1.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"

if [[ "${1:-}" == -h || "${1:-}" == --help ]]; then
  sed -n '2,3s/^# //p' "$0"
  exit 0
fi

"$root/scripts/setup.sh"
"$root/scripts/build.sh" release dynamic_slam
program="$root/build/release/apps/dynamic_slam"

if [[ $# -eq 0 || "$1" == -* ]]; then
  command=("$program" demo "$@")
  name=demo
else
  command=("$program" run "$@")
  # The last part of the path, without the ending of a video file: out/tum_fr1_desk, out/walk.
  name="$(basename -- "$(realpath -m -- "$1")")"
  if [[ ! -d "$1" ]]; then name="${name%.*}"; fi
fi

out=""
previous=""
for argument in "$@"; do
  if [[ "$previous" == --out ]]; then out="$argument"; fi
  if [[ "$argument" == --out=* ]]; then out="${argument#--out=}"; fi
  previous="$argument"
done
if [[ -z "$out" ]]; then
  out="$root/out/$name"
  command+=(--out "$out")
fi

"${command[@]}"
echo
echo "Files in $out:"
ls -1 -- "$out" | sed 's/^/  /'
