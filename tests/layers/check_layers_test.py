"""Shows that check_layers.py catches wrong includes and wrong graphs. Each tree below has one thing
that is allowed or not, and the checker has to agree."""
import pathlib
import subprocess
import sys
import tempfile

from rooms import drawing, read_rooms, with_drawing

CHECKER = pathlib.Path(__file__).with_name("check_layers.py")
LAYERS = "# a graph\nbase:\nio: base\nfield: base\ncli: io\n"
# Each room has a file that includes what its line names.
FILES = {"src/base/all.h": "", "src/io/all.h": '#include "base/all.h"\n',
         "src/field/all.h": '#include "base/all.h"\n', "src/cli/all.h": '#include "io/all.h"\n'}
MARKS = "<!-- rooms: tools/draw_rooms -->\n<!-- end of rooms -->\n"


def write(folder, files):
    for name, text in files.items():
        path = pathlib.Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def graph_of(layers):
    with tempfile.TemporaryDirectory() as scratch:
        write(scratch, {"layers.txt": layers})
        return read_rooms(pathlib.Path(scratch) / "layers.txt")


def run_checker(files, layers=LAYERS, page=None):
    """Writes {path: text} into a scratch project; returns the exit status and the output. Without
    `page`, the project has the right drawing."""
    with tempfile.TemporaryDirectory() as scratch:
        write(scratch, {**files, "src/layers.txt": layers, "docs/architecture.md": page or MARKS})
        if page is None:
            drawn = pathlib.Path(scratch) / "docs/architecture.md"
            drawn.write_text(with_drawing(MARKS, graph_of(LAYERS)), encoding="utf-8")
        done = subprocess.run([sys.executable, CHECKER, scratch], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr


def check(name, text):
    """Checks the scratch project with one more file."""
    return run_checker({**FILES, name: text})


def test_allows_own_named_and_public_includes():
    status, output = check("src/cli/a.cc", '#include <vector>\n#include "cli/a.h"\n'
                                           '#include "io/all.h"\n#include "tomofield/error.h"\n')
    assert status == 0, output


def test_catches_an_include_of_a_room_that_the_line_does_not_name():
    status, output = check("src/io/a.cc", '#include "io/all.h"\n#include "field/all.h"\n')
    assert status == 1, output
    assert "src/io/a.cc:2: " in output, output
    assert check("src/base/a.h", '  #  include   "cli/all.h"\n')[0] == 1


def test_a_room_behind_another_one_is_not_named_by_that():
    status, output = check("src/cli/a.cc", '#include "base/all.h"\n')
    assert status == 1, output
    assert "does not name 'base'" in output, output


def test_json_belongs_to_readers_and_records():
    for include in ("<nlohmann/json.hpp>", "<nlohmann/json_fwd.hpp>", '"io/json.h"'):
        text = f"#include {include}\n"
        files = {**FILES, "src/io/json.h": ""}
        status, output = run_checker({**files, "src/cli/a.cc": text})
        assert status == 1 and "src/cli/a.cc:1: JSON belongs to a record" in output, output
        for allowed in ("src/cli/a_record.cc", "src/io/a.cc", "src/cli/a_test.cc"):
            status, output = run_checker({**files, allowed: text})
            assert status == 0, output
    assert check("src/field/a.cc", "using nlohmann::json;\n")[0] == 1


def test_catches_a_stale_entry():
    status, output = run_checker({**FILES, "src/cli/all.h": ""})
    assert status == 1, output
    assert "src/layers.txt:5: no file of 'cli' includes 'io'" in output, output
    # A unit test alone does not keep it.
    tested = {**FILES, "src/cli/all.h": "", "src/cli/a_test.cc": '#include "io/all.h"\n'}
    assert run_checker(tested)[0] == 1


def test_catches_a_room_without_files():
    status, output = run_checker({name: text for name, text in FILES.items() if "cli" not in name})
    assert status == 1, output
    assert "'cli' has no source file" in output, output


def test_few_modules_are_small():
    def modules(num_small, backend=""):
        rooms = ["a", "b", "c", "d"]
        layers = "".join(f"{room}:\n" for room in rooms)
        files = {f"src/{rooms[i % 4]}/m{i}.h": "\n" * (20 if i < num_small else 70) for i in range(100)}
        files.update({f"src/a/m{4 * i}_fast.cc": backend for i in range(2) if backend})
        page = with_drawing(MARKS, graph_of(layers))
        return run_checker(files, layers, page)
    assert modules(5)[0] == 0, modules(5)[1]
    status, output = modules(6)
    assert status == 1 and "6 of 100 modules" in output and "b/m5" in output, output
    of_first = '#include "a/m0.h"\n' + "\n" * 50
    assert modules(6, of_first)[0] == 0, "a source without a header belongs to what it includes first"


def test_names_of_results_have_one_home():
    home = {**FILES, "src/io/output_paths.cc": "", "src/output/output_paths.cc": 'with("_tree.png")'}
    layers = LAYERS + "output:\n"
    page = with_drawing(MARKS, graph_of(layers))
    assert run_checker(home, layers, page)[0] == 0
    status, output = run_checker({**home, "src/io/a.cc": '\nopen(name + "_tree.png");\n'}, layers,
                                 page)
    assert status == 1 and "src/io/a.cc:2: '_tree.png'" in output, output


def test_folders_have_a_largest_size():
    many = {f"src/field/a{i}.h": "" for i in range(39)}  # beside all.h
    assert run_checker({**FILES, **many})[0] == 0
    assert run_checker({**FILES, **many, "src/field/a_test.cc": "", "src/field/tree/a.h": ""})[0] == 0
    status, output = run_checker({**FILES, "src/field/b.cc": "\n" * 5000})
    assert status == 1 and "5001 lines in a folder" in output, output
    status, output = run_checker({**FILES, **{f"src/field/a{i}.h": "" for i in range(40)}})
    assert status == 1 and "41 files in a folder" in output, output


def test_unit_tests_include_any_room_above_theirs():
    status, output = check("src/cli/a_test.cc", '#include "field/all.h"\n#include "base/all.h"\n')
    assert status == 0, output
    assert check("src/io/a_test.cc", '#include "field/all.h"\n')[0] == 1


def test_subfolders_count_as_their_room():
    assert check("src/io/png/a.cc", '#include "io/tiff/a.h"\n')[0] == 0
    assert check("src/io/png/a.cc", '#include "field/all.h"\n')[0] == 1


def test_catches_relative_includes_and_unknown_folders():
    assert check("src/io/a.cc", '#include "../cli/b.h"\n')[0] == 1
    assert check("src/io/a.cc", '#include "b.h"\n')[0] == 1
    assert check("src/novel/a.cc", "int a;\n")[0] == 1


def test_only_unit_tests_include_test_helpers():
    files = {**FILES, "tests/support/a.h": "", "src/io/a_test.cc": '#include "support/a.h"\n'}
    assert run_checker(files)[0] == 0
    files["src/io/a.cc"] = '#include "support/a.h"\n'
    assert run_checker(files)[0] == 1


def test_public_headers_stay_free_of_other_libraries():
    assert check("include/tomofield/a.h", "#include <vector>\n")[0] == 0
    assert check("include/tomofield/a.h", "#include <hwy/highway.h>\n")[0] == 1
    assert check("include/tomofield/a.h", '#include "io/images/mrc.h"\n')[0] == 1


def test_refuses_what_is_no_graph_of_rooms():
    faults = {"io: base\nbase:\n": "1: 'io' names 'base', which has no line above it",
              "base: base\n": "1: 'base' names 'base', which has no line above it",
              "base:\nbase:\n": "2: 'base' has a line above this one",
              "base:\nio: base base\n": "2: 'io' names 'base' twice",
              "base:\nio\n": "2: 'io' is not written as 'room: room room'"}
    for layers, fault in faults.items():
        status, output = run_checker(FILES, layers)
        assert status == 2 and fault in output, output


def test_the_page_has_the_drawing():
    status, output = run_checker(FILES, page=MARKS)
    assert status == 1, output
    assert "run tools/draw_rooms" in output, output
    assert run_checker(FILES, page="a page without marks\n")[0] == 1


def test_the_drawing_has_levels_and_leaves_out_what_is_behind_another_room():
    rooms = graph_of("base:\nio: base\nfield: base\ncli: base io\n")
    assert drawing(rooms) == (" 2  cli    -> io\n 1  io     -> base\n    field  -> base\n 0  base\n")


def test_refuses_a_tree_without_sources():
    assert run_checker({"README.md": "nothing here\n"})[0] == 2
