"""Reads and writes run.json, which bench/run gathers and bench/regression compares.

The file holds the machines, the commits, the date, and rows {group, name, arguments, figures:
{figure: [one value for each repeat]}}."""

import json
import math
import statistics


class BadFile(Exception):
    """Says why a file is not a run.json."""


def median_deviation(values):
    """Returns the median absolute deviation from the median, which is 0 for a single value."""
    middle = statistics.median(values)
    return statistics.median(abs(value - middle) for value in values)


def write(path, run):
    with open(path, "w", encoding="utf-8") as file:
        json.dump(run, file, indent=1, ensure_ascii=False)
        file.write("\n")


def read(path):
    try:
        with open(path, encoding="utf-8") as file:
            run = json.load(file)
    except (OSError, UnicodeDecodeError) as error:
        raise BadFile(f"cannot read '{path}': {error}") from error
    except json.JSONDecodeError as error:
        raise BadFile(f"'{path}' is no JSON file: {error}; give a run.json of bench/run") from error
    if not isinstance(run, dict) or not isinstance(run.get("rows"), list):
        raise BadFile(f"'{path}' has no list of rows; give a run.json of bench/run")
    for number, row in enumerate(run["rows"], 1):
        check_row(path, number, row)
    return run


def check_row(path, number, row):
    if not isinstance(row, dict) or not isinstance(row.get("name"), str):
        raise BadFile(f"row {number} of '{path}' has no name; make the file again with bench/run")
    figures = row.get("figures")
    values = list(figures.values()) if isinstance(figures, dict) else []
    if not values or not all(is_list_of_numbers(value) for value in values):
        raise BadFile(f"row {number} of '{path}', '{row['name']}', has no figures that are lists of "
                      "numbers; make the file again with bench/run")


def is_list_of_numbers(value):
    return (isinstance(value, list) and len(value) > 0
            and all(isinstance(one, (int, float)) and not isinstance(one, bool)
                    and math.isfinite(one) for one in value))
