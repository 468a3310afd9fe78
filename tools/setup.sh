# shellcheck shell=bash
# Sourced by ./demo, ./test and .ci/run: installs the Debian packages that are
# missing and builds the release preset. Reads nothing from standard input.

project_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Prints the packages in the first COUNT sections of packages.txt that are not
# installed, one a line. An empty line ends a section, the title is the first one.
missing_packages() {
  local package
  awk -v last="$(($1 + 1))" 'BEGIN { RS = "" } NR <= last' "$project_root/packages.txt" |
    sed -e 's/#.*//' -e '/^[[:space:]]*$/d' | while read -r package _; do
    if [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
      echo "$package"
    fi
  done
}

# Runs apt-get as root: directly, or through sudo, which may ask for a
# password only where there is a terminal to type it.
apt_get_as_root() {
  local -a as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    as_root=(sudo)
    [ -t 0 ] || as_root+=(-n)
  fi
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq "$@"
}

# Installs what is missing in the first COUNT sections of packages.txt.
install_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "setup: this is not a Debian system (no dpkg-query); install what packages.txt lists by other means, then run 'cmake --preset release' and 'cmake --build --preset release'." >&2
    return 1
  fi
  local missing
  local -a packages
  missing=$(missing_packages "$1")
  [ -n "$missing" ] || return 0
  mapfile -t packages <<<"$missing"
  if [ "$(id -u)" -ne 0 ] && ! command -v sudo >/dev/null; then
    echo "setup: these Debian packages are missing, and installing them needs root or sudo: ${packages[*]}. Run 'apt-get install ${packages[*]}' as root, then run this again." >&2
    return 1
  fi
  echo "setup: installing ${packages[*]}"
  if ! apt_get_as_root update || ! apt_get_as_root install -y --no-install-recommends "${packages[@]}"; then
    echo "setup: apt-get could not install ${packages[*]} (its own message is above); check the network and /etc/apt/sources.list, which should name Debian 12 (bookworm), then run this again." >&2
    return 1
  fi
}

# Configures the release preset and builds one target of it; "all" is everything.
build_release() {
  cmake -S "$project_root" --preset release
  cmake --build "$project_root/build/release" --parallel "$(nproc)" --target "$1"
}
