#!/usr/bin/env bash
# setup.sh [LIST...]: installs the packages of packages.txt, and of the lists given, that are missing. Does nothing, and
# needs no rights, when there are none.
set -euo pipefail
lists=("$(dirname "${BASH_SOURCE[0]}")/packages.txt" "$@")
mapfile -t wanted < <(sed 's/#.*//' "${lists[@]}" | tr -s '[:space:]' '\n' | sed '/^$/d')

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "This is not Debian: nothing is installed. Needed are the equivalents of: ${wanted[*]}" >&2
  exit 0
fi

missing=()
for package in "${wanted[@]}"; do
  status="$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)"
  [[ "$status" == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

as_root=()
if [[ "$(id -u)" -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "Packages are missing, and installing them needs root. Run as root, then try again:" >&2
    echo "  apt-get update && apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi

log="$(mktemp)"
trap 'rm -f "$log"' EXIT
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "$@" >"$log" 2>&1 </dev/null; }
install() { apt install -y --no-install-recommends "${missing[@]}"; }

echo "Installing ${#missing[@]} packages: ${missing[*]}"
# The lists may be absent or too old to name what the mirrors have; then update them and try again.
if ! install && ! { apt update && install; }; then
  cat "$log" >&2
  echo "Installing failed (see above). Is there a network, and are the package sources those of Debian 12?" >&2
  exit 1
fi
