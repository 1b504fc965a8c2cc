#!/usr/bin/env bash
# ./test.sh [--full] [options of ctest]: installs what is missing (Debian 12), builds, and passes the tests; --full adds
# the long ones. Tests on real images run where the data is: DYNAMIC_SLAM_DATA, or ../shared/data.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"

selection=(-LE long)
arguments=()
for argument in "$@"; do
  case "$argument" in
    -h | --help)
      sed -n '2,3s/^# //p' "$0"
      exit 0
      ;;
    --full) selection=() ;;
    *) arguments+=("$argument") ;;
  esac
done

if [[ -z "${DYNAMIC_SLAM_DATA:-}" && -d "$root/../shared/data" ]]; then
  DYNAMIC_SLAM_DATA="$(cd "$root/../shared/data" && pwd)"
  export DYNAMIC_SLAM_DATA
fi

"$root/scripts/setup.sh" "$root/scripts/packages_test.txt" "$root/scripts/packages_ros.txt"
"$root/scripts/build.sh" release
ctest --test-dir "$root/build/release" -j2 --output-on-failure "${selection[@]}" "${arguments[@]}"
