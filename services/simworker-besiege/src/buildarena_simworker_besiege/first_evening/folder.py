"""The folder of an evening: steps that are done stay done, whatever ends the program."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from buildarena_pipeline.evidence import StepRecord, Versions
from buildarena_simworker_besiege.first_evening.playing import StepDone
from buildarena_simworker_besiege.whole_files import write_whole

RECORD: Final = "record.json"
ARCHIVE: Final = "evidence.zip"


class EveningsFolder:
    """Where steps leave what came of them.

    Args:
        folder: It is made if need be.
        versions: Of game and mod: what was done with others is done again.
        driver: Likewise.
    """

    def __init__(self, folder: Path, versions: Versions, driver: str) -> None:
        self._folder = folder
        self._versions = versions
        self._driver = driver

    @property
    def archive(self) -> Path:
        """The file of evidence."""
        return self._folder / ARCHIVE

    def stored(self, name: str) -> StepDone | None:
        """What came of a step; None where it was not played, or with other versions."""
        place = self._place(name)
        try:
            content = json.loads((place / RECORD).read_text(encoding="utf-8"))
            same = content["versions"] == self._versions.model_dump()
            record = StepRecord.model_validate(content["record"])
        except (OSError, ValueError, KeyError, TypeError, ValidationError):
            return None
        if not same or content.get("driver") != self._driver:
            return None
        names = [path for path in sorted(place.iterdir()) if path.name != RECORD]
        return StepDone(record=record, files={path.name: path.read_bytes() for path in names})

    def store(self, done: StepDone) -> None:
        """Keeps what came of a step; its record is written last."""
        place = self._place(done.record.name)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name, data in done.files.items():
            (place / name).write_bytes(data)
        content = {
            "versions": self._versions.model_dump(),
            "driver": self._driver,
            "record": done.record.model_dump(mode="json"),
        }
        write_whole(place / RECORD, json.dumps(content, indent=1).encode())

    def write(self, archive: bytes) -> None:
        """Writes the file of evidence whole or not at all."""
        write_whole(self.archive, archive)

    def _place(self, name: str) -> Path:
        return self._folder / "steps" / name
