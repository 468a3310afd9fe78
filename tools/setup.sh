# shellcheck shell=bash
# Sourced by ./demo, ./test, .ci/ and tools/: installs the Debian packages that are missing, and
# builds. Reads nothing from standard input.

project_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Prints the packages of one section of packages.txt, one a line. Fails if there is no such section.
packages_of_section() {
  awk -v header="[$1]" '
    /^\[/ { inside = ($0 == header); found = found || inside; next }
    inside && NF && !/^#/ { print $1 }
    END { exit !found }' "$project_root/packages.txt" ||
    { echo "setup: packages.txt has no section [$1]" >&2; return 1; }
}

# Prints those of the packages that are not installed, one a line.
missing_packages() {
  local package
  for package in "$@"; do
    if [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
      echo "$package"
    fi
  done
}

# Runs apt-get as root: directly, or through sudo, which may ask for a password only where there is a
# terminal to type it. A server that does not answer is asked three times more.
apt_get_as_root() {
  local -a as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    as_root=(sudo)
    [ -t 0 ] || as_root+=(-n)
  fi
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Acquire::Retries=3 \
    -o APT::Update::Error-Mode=any "$@"
}

# Installs what is missing of the sections of packages.txt with these names.
install_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "setup: this is not a Debian system (no dpkg-query); install what packages.txt lists by other means, then run 'cmake --preset release' and 'cmake --build --preset release'." >&2
    return 1
  fi
  local section listed
  local -a packages=() missing
  for section in "$@"; do
    listed=$(packages_of_section "$section") || return 1
    mapfile -t -O "${#packages[@]}" packages <<<"$listed"
  done
  mapfile -t missing < <(missing_packages "${packages[@]}")
  [ "${#missing[@]}" -gt 0 ] || return 0
  if [ "$(id -u)" -ne 0 ] && ! command -v sudo >/dev/null; then
    echo "setup: these Debian packages are missing, and installing them needs root or sudo: ${missing[*]}. Run 'apt-get install ${missing[*]}' as root, then run this again." >&2
    return 1
  fi
  echo "setup: installing ${missing[*]}"
  local begin=$SECONDS
  if ! apt_get_as_root update || ! apt_get_as_root install -y --no-install-recommends "${missing[@]}"; then
    echo "setup: apt-get could not install ${missing[*]} from $(package_servers) (its own message is above); check the network and /etc/apt/sources.list, which should name Debian 12 (bookworm) or 13 (trixie), then run this again." >&2
    return 1
  fi
  echo "setup: installing took $((SECONDS - begin)) s"
}

# Prints the servers that apt-get asks for packages.
package_servers() {
  # shellcheck disable=SC2016  # apt-get expands it
  apt-get indextargets --format '$(SITE)' 2>/dev/null | sort -u | paste -sd' '
}

# Configures a preset (CMakePresets.json) in the folder build/release, and builds one target there.
# "program" has the program alone; "release" has all, and builds on what "program" has built.
build_preset() {
  cmake -S "$project_root" --preset "$1"
  cmake --build "$project_root/build/release" --parallel "$(nproc)" --target "$2"
}
