"""Reads src/layers.txt, the graph of the rooms of src/, and draws it for docs/architecture.md."""
import re

LINE = re.compile(r"([a-z_]+):((?: [a-z_]+)*)")
DRAWING = re.compile(r"(<!-- rooms: tools/draw_rooms -->\n).*?(<!-- end of rooms -->)", re.DOTALL)


class BadGraph(Exception):
    """Says what is wrong with which line of layers.txt."""


def read_rooms(path):
    """Returns {room: rooms that it may include}, in the order of the file, in which each room comes
    after those that it includes. Raises BadGraph for another order and for what is no such line."""
    rooms = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        match = LINE.fullmatch(line)
        if not match:
            raise BadGraph(f"{number}: '{line}' is not written as 'room: room room'")
        room, included = match[1], match[2].split()
        if room in rooms:
            raise BadGraph(f"{number}: '{room}' has a line above this one")
        for other in included:
            if other not in rooms:
                raise BadGraph(f"{number}: '{room}' names '{other}', which has no line above it")
            if included.count(other) > 1:
                raise BadGraph(f"{number}: '{room}' names '{other}' twice")
        rooms[room] = included
    return rooms


def reached(rooms):
    """Returns {room: all rooms that lead to it through any number of lines}."""
    all_of = {}
    for room, included in rooms.items():
        all_of[room] = set(included).union(*(all_of[other] for other in included))
    return all_of


def drawing(rooms):
    """Draws the graph as lines of text. A room stands one level above the highest room that it
    includes. What a room also reaches through another one of its line is left out."""
    all_of, level = reached(rooms), {}
    for room, included in rooms.items():
        level[room] = max((level[other] + 1 for other in included), default=0)
    width = max(map(len, rooms))
    lines = []
    for height in reversed(range(max(level.values()) + 1)):
        head = f"{height:2}"
        for room in (room for room in rooms if level[room] == height):
            below = [other for other in rooms[room]
                     if not any(other in all_of[between] for between in rooms[room])]
            arrow = "-> " + ", ".join(below) if below else ""
            lines.append(f"{head}  {room:{width}}  {arrow}".rstrip())
            head = "  "
    return "".join(f"{line}\n" for line in lines)


def with_drawing(page, rooms):
    """Returns the text of a page with the drawing between its two marks; None if it has no marks."""
    drawn = f"```\n{drawing(rooms)}```\n"
    text, count = DRAWING.subn(lambda marks: marks[1] + drawn + marks[2], page)
    return text if count == 1 else None
