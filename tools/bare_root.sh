# shellcheck shell=bash
# Sourced by .ci/run and tools/release: makes Debian roots that hold nothing but the base system, and
# runs commands in them. Only root can do so.

# Ends the script that is called `name` unless root runs it.
require_root() {
  if [ "$(id -u)" -ne 0 ]; then
    echo "$1: this makes a bare Debian root with debootstrap, which only root can do; run it as root, for example with sudo" >&2
    exit 1
  fi
}

# Makes the root of a Debian release in a folder that is empty or not there. A server that does not answer is asked three
# times, ever more patiently.
make_bare_root() {
  local release=$1 root=$2 log try
  log=$(mktemp)
  mkdir -p "$root"
  chmod 755 "$root"  # users of the root who are not root must find its files, too
  for try in 1 2 3; do
    if debootstrap --variant=minbase "$release" "$root" ${DEBIAN_MIRROR:+"$DEBIAN_MIRROR"} >"$log" 2>&1; then
      mkdir -p "$root/work"
      cp /etc/hosts /etc/resolv.conf "$root/etc/"  # the names of this machine and of its name servers
      echo force-unsafe-io >"$root/etc/dpkg/dpkg.cfg.d/throwaway"  # no waiting for the disk
      rm "$log"
      return 0
    fi
    echo "bare root: attempt $try of 3 to make a root of $release failed" >&2
    find "$root" -xdev -mindepth 1 -delete
    sleep $((try * 20))
  done
  tail -n 20 "$log" >&2
  rm "$log"
  echo "bare root: debootstrap could not fetch Debian $release from ${DEBIAN_MIRROR:-its default server} (its last lines are above); check the network, or name another server with DEBIAN_MIRROR" >&2
  return 1
}

# Notes that a folder is to be seen at a path of the root, read-only.
share_folder_with_bare_root() {
  mkdir -p "$2/$3"
  bare_root_shares+=("$(realpath "$1")" "$2/$3")
}
bare_root_shares=()

# Runs a command in a folder of the root. Its mounts and processes end with it.
in_bare_root() {
  local root=$1 folder=$2
  shift 2
  # shellcheck disable=SC2016  # the inner shell expands these
  unshare --mount --pid --fork --kill-child bash -c '
    set -euo pipefail
    root=$1 folder=$2 shares=$3
    shift 3
    mount --bind "$root" "$root"  # a root that is a mount point can have namespaces of its own
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs tmpfs "$root/dev/shm"
    for ((; shares > 0; --shares)); do
      mount --bind "$1" "$2"
      mount -o remount,bind,ro "$2"
      shift 2
    done
    exec chroot "$root" env -C "$folder" HOME=/root TMPDIR=/tmp LC_ALL=C.UTF-8 \
      PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"
  ' in_bare_root "$root" "$folder" "$((${#bare_root_shares[@]} / 2))" "${bare_root_shares[@]}" "$@" </dev/null
}

# Deletes the root, but nothing of other file systems.
remove_bare_root() {
  rm -rf --one-file-system "$1"
}
