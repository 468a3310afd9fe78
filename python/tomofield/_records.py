"""What a run writes of itself: its metrics, its options, and where these come from."""

import json
import pathlib
from dataclasses import dataclass, field
from typing import Any, Dict, List

from ._checks import Path, path_of, said
from ._core import Error
from ._projects import Setting


@dataclass(frozen=True)
class Record:
    """The JSON file beside a tomogram.

    metrics: what was measured: "views", "mask", "tuning", "verdict"; with halves, "halves".
    options: every option with the value that was used, in sections: options["fit"]["penalty"].
    settings: what files of another program set, or the choice of a batch.
    """

    metrics: Dict[str, Any] = field(default_factory=dict)
    options: Dict[str, Any] = field(default_factory=dict)
    settings: List[Setting] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """The line that says how good the fit is; empty for other methods."""
        return (self.metrics.get("verdict") or {}).get("line", "")

    @property
    def warnings(self) -> List[str]:
        """What seems wrong with the series, and what to do."""
        found = (self.metrics.get("verdict") or {}).get("warnings", [])
        return [warning["message"] for warning in found]


def record_of(text: str) -> Record:
    """Return the record that a JSON text holds. Raises ValueError or KeyError for another one."""
    document = json.loads(text)
    metrics = dict(document["metrics"])
    if "halves" in document:
        metrics["halves"] = document["halves"]
    settings = [Setting(s["option"], s["value"], pathlib.Path(s["file"]), s["entry"],
                        s.get("row", ""), s.get("instead", "")) for s in document["origins"]]
    return Record(metrics, document["options"], settings)


def read_record(path: Path) -> Record:
    """Return the record of a run from its .json file, or from the one beside a tomogram."""
    given = pathlib.Path(path_of(path, "the record"))
    if not given.name:
        raise Error(f"the record is a file, and '{said(given)}' names a folder")
    file = given.with_suffix(".json")
    try:
        return record_of(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise Error(f"cannot read '{said(file)}': {error.strerror}") from None
    except ValueError as error:
        raise Error(f"'{said(file)}' is no JSON: {error}") from None
    except (KeyError, TypeError, AttributeError):
        raise Error(f"'{said(file)}' is not the record of a run of tomofield") from None


def read_metrics(path: Path) -> Dict[str, Any]:
    """Return the metrics of a run from its .json file, or from the one beside a tomogram."""
    return read_record(path).metrics
