"""Finds what the documents claim about the repository and the program: links, paths, commands,
options.

A document is a Markdown file. Code is a fenced or indented block, or a span in backticks."""

import pathlib
import re
import shlex
import subprocess

# These folders are outputs and not a part of the repository.
OUTPUTS = {"build", "demo-output", "test-output"}
# Records of the past name files and options that need not exist any more.
HISTORY = re.compile(r"docs/results/archive/|CHANGELOG\.md$")
# These options in the text belong to other programs: mpirun, ctest, cmake and bench scripts.
FOREIGN_OPTIONS = {"--mca", "--map-by", "--plot", "--preset", "--build", "--install", "--component"}
LAUNCHERS = r"(?:(?:mpirun|srun|time)\s(?:.*?\s)?)?"

FENCE = re.compile(r"^ *```.*?^ *```", re.M | re.S)
INDENTED = re.compile(r"(?:^|(?<=\n\n))((?: {4,}[^\n]*\n|\n(?= {4}))+)", re.S)
SPAN = re.compile(r"`([^`]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)|(?:src|href)=\"([^\"]+)\"")
COMMAND = re.compile(rf"^\s*(?:\$ )?(?:\w+=\S*\s+)*{LAUNCHERS}(?:\S*/)?tomofield\s+(.*)$", re.S)
OPTION = re.compile(r"(?<![\w-])--?[A-Za-z][\w-]*")


def documents(project):
    """Returns every Markdown file of the repository."""
    found = [path for path in project.rglob("*.md")
             if not any(part in OUTPUTS or part.startswith(".")
                        for part in path.relative_to(project).parts)]
    return sorted(found)


def is_history(project, path):
    return bool(HISTORY.search(path.relative_to(project).as_posix()))


def code_blocks(text):
    """Returns the fenced and the indented blocks."""
    fenced = FENCE.findall(text)
    return fenced + INDENTED.findall(FENCE.sub("", text))


def spans(text):
    """Returns the code in backticks outside blocks, each on one line."""
    return [" ".join(span.split()) for span in SPAN.findall(INDENTED.sub("\n", FENCE.sub("", text)))]


def links(text):
    """Returns the targets of links and pictures that are no addresses on the web."""
    targets = [first or second for first, second in LINK.findall(FENCE.sub("", text))]
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def anchors(text):
    """Returns the names that the headings of a document have as targets of links."""
    headings = re.findall(r"^#+ +(.*?) *$", FENCE.sub("", text), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(path):
    """Returns the relative links of a document whose file or heading does not exist."""
    text, broken = path.read_text(encoding="utf-8"), []
    for target in links(text):
        name, _, anchor = target.partition("#")
        file = (path.parent / name).resolve() if name else path
        has_anchor = not anchor or (file.suffix == ".md" and file.is_file()
                                    and anchor in anchors(file.read_text(encoding="utf-8")))
        if not file.exists() or not has_anchor:
            broken.append(target)
    return broken


def commands(text):
    """Returns the arguments of every command `tomofield …` in blocks and spans."""
    lines = [line for block in code_blocks(text)
             for line in re.sub(r"\\\n", " ", block).splitlines()]
    found = [COMMAND.match(line) for line in [*lines, *spans(text)]]
    return [arguments_of(match.group(1)) for match in found if match]


def arguments_of(text):
    """Splits a command into words and drops comments, pipes and what a shell would insert."""
    text = re.sub(r"\$\([^)]*\)", "INSERTED", text)
    text = re.split(r"\s#|\s[|&;<>]+(?:\s|$)", text)[0]
    try:
        return shlex.split(text)
    except ValueError:  # a lone apostrophe
        return text.split()


class Program:
    """Answers which subcommands and options the program has, from its own help."""

    def __init__(self, path):
        self.path, self.texts = path, {}

    def help(self, *words):
        """Returns the whole help of a subcommand."""
        if words not in self.texts:
            for option in ("--help-all", "--help"):
                done = subprocess.run([self.path, *words, option], capture_output=True, text=True)
                if done.returncode == 0:
                    break
            self.texts[words] = done.stdout
        return self.texts[words]

    def options(self, *words):
        return set(OPTION.findall(self.help(*words)))

    def subcommands(self, *words):
        _, _, listed = self.help(*words).partition("\nSubcommands:")
        return re.findall(r"^  (\S+)", listed, re.M)

    def all_options(self, *words):
        """Returns the options of a command and of all commands below it."""
        return self.options(*words).union(
            *(self.all_options(*words, name) for name in self.subcommands(*words)))

    def faults(self, arguments):
        """Returns the words of a command that the program does not know."""
        words, rest = [], list(arguments)
        while rest and self.subcommands(*words):
            if rest[0] in self.subcommands(*words):
                words.append(rest.pop(0))
            elif rest[0].startswith("-") or is_placeholder(rest[0]):
                break
            else:
                return [rest[0]]
        known = self.all_options(*words)
        given = [word.split("=")[0] for word in rest if OPTION.match(word)]
        return [option for option in given if option not in known]


def is_placeholder(word):
    return word == "…" or re.fullmatch(r"[A-Z_]+", word) is not None


def unknown_commands(text, program):
    """Returns (command, faults) of every command that does not parse."""
    checked = [(" ".join(arguments), program.faults(arguments)) for arguments in commands(text)]
    return [(command, faults) for command, faults in checked if faults]


def unknown_options(text, known):
    """Returns the options in backticks that no command has."""
    named = {span.split()[0].split("=")[0] for span in spans(text) if span.startswith("--")}
    return sorted(option for option in named
                  if OPTION.fullmatch(option) and option not in known | FOREIGN_OPTIONS)


def missing_paths(text, project):
    """Returns the paths in backticks that look like the repository's and do not exist there."""
    return sorted({span for span in spans(text)
                   if looks_like_path(span, project) and not exists(span, project)})


def looks_like_path(span, project):
    """Returns true for paths below a folder of the repository or of src/, and for files at its
    root."""
    if not re.fullmatch(r"(\./)?[\w.-]+(/[\w.-]+)*/?", span):
        return False
    first, slash, _ = span.removeprefix("./").partition("/")
    if not slash:
        return span.startswith("./") or first.endswith((".md", "CMakeLists.txt"))
    if first in OUTPUTS:
        return False
    is_source = (project / "src" / first).is_dir() and span.endswith((".h", ".cc", "/"))
    return (project / first).is_dir() or is_source


def exists(span, project):
    """Returns true if a path exists. Capitals and a lone x in a name stand for any name."""
    pattern = re.sub(r"[A-Z]{2,}|(?<![A-Za-z])x(?![A-Za-z])", "*", span.removeprefix("./")).rstrip("/")
    roots = (project, project / "src")
    return any((root / span).exists() or any(root.glob(pattern)) for root in roots)
