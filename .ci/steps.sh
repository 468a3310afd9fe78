# shellcheck shell=bash
# Sourced by the scripts that .ci/run starts: runs the steps of continuous integration, and says what
# each took, by the clock and in seconds of processors. The clock counts on a quiet machine alone.
step_table=""

# Prints the seconds of processors that the children of this shell have taken.
core_seconds() {
  # Fields 16 and 17 of proc(5) stat, in ticks of 1/100 s; the name in brackets may hold spaces.
  sed 's/.*) //' "/proc/$$/stat" | awk '{ printf "%d", ($14 + $15) / 100 }'
}

# Runs a command as the step of this name.
step() {
  local name=$1 begin=$SECONDS cores
  cores=$(core_seconds)
  shift
  printf '\n== %s\n' "$name"
  "$@"
  step_table+=$(printf '%-20s %6d s %6d core-s' "$name" "$((SECONDS - begin))" "$(($(core_seconds) - cores))")$'\n'
}

# Prints what each step took.
print_steps() {
  printf '\n%s%-20s %6d s %6d core-s\n' "$step_table" "all" "$SECONDS" "$(core_seconds)"
}
