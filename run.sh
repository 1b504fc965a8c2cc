#!/usr/bin/env bash
# ./run.sh [SOURCE [options]]: installs what is missing (Debian 12), builds, and runs dynamic_slam on SOURCE; without
# SOURCE it shows the demo, on scenes that it renders itself. Options are those of `dynamic_slam run`, such as --camera tum_fr1.
# Results go to out/ and the name of SOURCE, or to --out.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"

if [[ "${1:-}" == -h || "${1:-}" == --help ]]; then
  sed -n '2,4s/^# //p' "$0"
  exit 0
fi

"$root/scripts/setup.sh"
"$root/scripts/build.sh" release dynamic_slam
program="$root/build/release/apps/dynamic_slam"

if [[ $# -eq 0 || "$1" == -* ]]; then
  exec "$program" demo "$@"
else
  exec "$program" run "$@"
fi
