# shellcheck shell=bash
# Sourced by the scripts that .ci/run starts: runs the steps of continuous integration, and says what
# each took.
step_table=""

# Runs a command as the step of this name.
step() {
  local name=$1 begin=$SECONDS
  shift
  printf '\n== %s\n' "$name"
  "$@"
  step_table+=$(printf '%-28s %5d s' "$name" "$((SECONDS - begin))")$'\n'
}

# Prints the seconds that each step took.
print_steps() {
  printf '\n%s%-28s %5d s\n' "$step_table" "all" "$SECONDS"
}
