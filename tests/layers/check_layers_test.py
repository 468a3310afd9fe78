"""Shows that check_layers.py catches wrong includes. Each tree below has one include that is
allowed or not, and the checker has to agree."""
import pathlib
import subprocess
import sys
import tempfile

CHECKER = pathlib.Path(__file__).with_name("check_layers.py")
LAYERS = "# lowest first\nbase\nio\nkernels\nfield\nprojection\ncli\n"


def run_checker(files, layers=LAYERS):
    """Writes {path: text} into a scratch project; returns the exit status and the output."""
    with tempfile.TemporaryDirectory() as scratch:
        for name, text in {**files, "src/layers.txt": layers}.items():
            path = pathlib.Path(scratch) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        done = subprocess.run([sys.executable, CHECKER, scratch], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr


def test_allows_own_lower_and_public_includes():
    text = '#include <vector>\n#include "field/a.h"\n#include "base/b.h"\n#include "tomofield/error.h"\n'
    status, output = run_checker({"src/field/a.cc": text})
    assert status == 0, output


def test_the_order_of_the_list_decides():
    files = {"src/io/a.cc": '#include "base/a.h"\n'}
    assert run_checker(files, "base\nio\n")[0] == 0
    assert run_checker(files, "io\nbase\n")[0] == 1
    assert run_checker(files, "# none\n")[0] == 2


def test_catches_an_include_of_a_higher_folder():
    status, output = run_checker({"src/io/a.cc": '#include "io/a.h"\n#include "field/b.h"\n'})
    assert status == 1, output
    assert "src/io/a.cc:2: " in output, output


def test_catches_it_with_spaces_and_in_headers():
    status, output = run_checker({"src/base/a.h": '  #  include   "cli/b.h"\n'})
    assert status == 1, output


def test_subfolders_count_as_their_folder():
    status, output = run_checker({"src/kernels/cpu/a.cc": '#include "kernels/reference/a.h"\n'})
    assert status == 0, output
    status, output = run_checker({"src/kernels/cpu/a.cc": '#include "projection/a.h"\n'})
    assert status == 1, output


def test_catches_relative_includes_and_unknown_folders():
    assert run_checker({"src/io/a.cc": '#include "../cli/b.h"\n'})[0] == 1
    assert run_checker({"src/io/a.cc": '#include "b.h"\n'})[0] == 1
    assert run_checker({"src/novel/a.cc": "int a;\n"})[0] == 1


def test_only_unit_tests_include_test_helpers():
    files = {"tests/support/a.h": "", "src/io/a_test.cc": '#include "support/a.h"\n'}
    assert run_checker(files)[0] == 0
    files["src/io/a.cc"] = '#include "support/a.h"\n'
    assert run_checker(files)[0] == 1


def test_public_headers_stay_free_of_other_libraries():
    files = {"src/base/a.cc": "int a;\n", "include/tomofield/a.h": "#include <vector>\n"}
    assert run_checker(files)[0] == 0
    files["include/tomofield/a.h"] = "#include <hwy/highway.h>\n"
    assert run_checker(files)[0] == 1
    files["include/tomofield/a.h"] = '#include "io/mrc.h"\n'
    assert run_checker(files)[0] == 1


def test_refuses_a_tree_without_sources():
    assert run_checker({"README.md": "nothing here\n"})[0] == 2
