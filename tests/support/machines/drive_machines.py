"""The expert's machines that Gymnasium's adapter has driven, without their programs.

Run as a module, it writes the adapter's file, which stands in no repository: installing the adapter
and building its distribution begin with that.
"""

import json
from pathlib import Path

from support.machines.piloted import experts_machine

from buildarena_benchmark import CANARY, builtin_tasks

FILE = Path(__file__).parents[3] / "integrations/gymnasium/src/buildarena_gymnasium/machines.json"


def written() -> str:
    """What the file must hold."""
    machines = {
        name: experts_machine(task).with_controller("").to_document()
        for name, task in builtin_tasks().items()
        if task.scenario.senses is not None
    }
    lines = ",\n".join(f'"{name}": {json.dumps(document)}' for name, document in machines.items())
    return f'{{"canary": {json.dumps(CANARY)},\n"machines": {{\n{lines}\n}}}}\n'


if __name__ == "__main__":
    FILE.write_text(written(), encoding="utf-8")
