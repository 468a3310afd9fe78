#!/usr/bin/env bash
# Installs a build into a scratch prefix, then builds and runs a consumer that
# knows only that prefix, and the examples.
#   install_test.sh BUILD_DIR CONSUMER_DIR SCRATCH_DIR EXPECTED_VERSION
set -euo pipefail
build=$1 consumer=$2 scratch=$3 version=$4

fail() {
  echo "install test: $1" >&2
  exit 1
}

rm -rf "$scratch"
mkdir -p "$scratch"
cmake --install "$build" --prefix "$scratch/prefix" >"$scratch/install.log"

says=$("$scratch/prefix/bin/tomofield" --version --verbose) || fail "--version --verbose fails"
grep -qx "tomofield $version ([^()]\+)" <<<"$says" ||
  fail "the installed program does not say that it is version $version and of which commit"
grep -q "^\(libc6 \|The packages .* without dpkg\)" <<<"$says" ||
  fail "the installed program does not print its bill of materials"

man=$scratch/prefix/share/man/man1
grep -q 'tomofield-reconstruct (1)' "$man/tomofield.1" || fail "tomofield.1 does not list the commands"
grep -qF '\-\-thickness' "$man/tomofield-reconstruct.1" ||
  fail "tomofield-reconstruct.1 does not list the options"

# Nothing in the package may point back into the source or build tree.
source_dir=$(cd "$consumer/../.." && pwd)
if grep -rlF -e "$source_dir/" -e "$(cd "$build" && pwd)/" \
  --include='*.cmake' --include='*.h' "$scratch/prefix" |
  grep . >&2; then
  fail "the files above name the source or build tree"
fi

cmake -S "$consumer" -B "$scratch/consumer" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_PREFIX_PATH="$scratch/prefix" -DCMAKE_FIND_PACKAGE_NO_PACKAGE_REGISTRY=ON
cmake --build "$scratch/consumer"
output=$("$scratch/consumer/consumer") || fail "the consumer failed"
echo "$output"
grep -qx "tomofield $version" <<<"$output" || fail "the consumer linked another version"
grep -q '^caught ' <<<"$output" || fail "the consumer did not catch tomofield::Error"

# The examples, built against the package, reconstruct to the same bytes as the program.
cmake -S "$source_dir/examples" -B "$scratch/examples" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_PREFIX_PATH="$scratch/prefix" -DCMAKE_FIND_PACKAGE_NO_PACKAGE_REGISTRY=ON
cmake --build "$scratch/examples"
program=$scratch/prefix/bin/tomofield
cd "$scratch"
"$program" simulate cell --size 32 --thickness 16 --noise 0.05 --seed 1 >/dev/null
"$program" reconstruct cell/tilt_series.mrc --tlt cell/tilt_series.tlt --thickness 16 \
  --contrast bright --no-margin -o program.mrc >/dev/null
"$scratch/examples/reconstruct_stack" cell/tilt_series.mrc cell/tilt_series.tlt 16 example.mrc ||
  fail "examples/reconstruct_stack failed"
cmp program.mrc example.mrc || fail "examples/reconstruct_stack gives another tomogram"
mkdir etomo
cp cell/tilt_series.mrc etomo/TS_01.st
cp cell/tilt_series.tlt etomo/TS_01.tlt
sed 's/.*/1 0 0 1 0 0/' etomo/TS_01.tlt >etomo/TS_01.xf
printf '%s\n' '$newstack -StandardInput' 'InputFile TS_01.st' 'OutputFile TS_01_ali.mrc' \
  'TransformFile TS_01.xf' >etomo/newst.com
printf '%s\n' '$tilt -StandardInput' 'InputProjections TS_01_ali.mrc' 'TILTFILE TS_01.tlt' \
  'THICKNESS 16' >etomo/tilt.com
"$program" reconstruct etomo -o by_program.mrc >/dev/null
"$scratch/examples/reconstruct_project" etomo by_library.mrc ||
  fail "examples/reconstruct_project failed"
for file in by_program*.mrc by_program*.png; do
  cmp "$file" "${file/program/library}" || fail "examples/reconstruct_project differs in $file"
done
[ -s by_library_report.html ] || fail "examples/reconstruct_project writes no report"
"$scratch/examples/query_plane" example.h5 30 plane.pgm | grep -q '^32 x 32 values from ' ||
  fail "examples/query_plane failed"
[ "$(wc -c <plane.pgm)" -eq $((32 * 32 + 13)) ] || fail "plane.pgm has another size"

# The portable folder runs with its own libraries alone, also through a link, and names itself.
"$source_dir/tools/portable_folder" "$scratch/prefix" "$scratch/portable"
lib=$scratch/portable/lib
loaded=$("$lib/ld-linux-x86-64.so.2" --library-path "$lib" --list "$lib/tomofield")
if sed -n 's/.*=> \([^ ]*\) .*/\1/p' <<<"$loaded" | grep -v "^$lib/" >&2; then
  fail "the portable program loads the libraries above"
fi
ln -s "$scratch/portable/bin/tomofield" "$scratch/linked"
says=$(env -i "$scratch/linked" --version --verbose) || fail "the portable program fails"
grep -q "^\(libc6 \|The packages .* without dpkg\)" <<<"$says" ||
  fail "the portable program does not find its bill of materials"
env -i PATH=/usr/bin:/bin "$scratch/linked" compare cell/tilt_series.mrc --tlt cell/tilt_series.tlt \
  --thickness 16 --contrast bright --no-margin --methods wbp -o compared >/dev/null ||
  fail "the portable program cannot start itself"

python_package=("$scratch"/prefix/lib/python3*/dist-packages)
if [ -d "${python_package[0]}" ]; then
  PYTHONPATH=${python_package[0]} /usr/bin/python3 "$source_dir/examples/reconstruct.py" \
    cell/tilt_series.mrc cell/tilt_series.tlt 16 python.mrc || fail "examples/reconstruct.py failed"
  cmp program.mrc python.mrc || fail "examples/reconstruct.py gives another tomogram"
fi
