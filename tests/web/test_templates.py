"""The machines that people may begin with, which the build page has as data."""

import json

import pytest
from support.documents.pages import WEB

from buildarena_benchmark import builtin_tasks

TEMPLATES = json.loads((WEB / "src/pages/workbench/templates.json").read_text())


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda template: template["name"])
def test_a_template_can_be_built_in_every_task_that_it_is_for(template) -> None:
    families = {name: name.rpartition("-")[0] for name in builtin_tasks()}
    assert set(template["families"]) <= set(families.values())
    tasks = [name for name, family in families.items() if family in template["families"]]
    for task in (builtin_tasks()[name] for name in tasks):
        assert task.beginning is None, task.name
        machine = task.new_machine(task.constraints.catalogue)
        calls = [("start", {})] + [
            (
                "attach_block_to",
                {"base_block": base, "face": face, "new_block": "Small Wooden Block"},
            )
            for base, face in template["blocks"]
        ]
        for name, arguments in calls:
            assert machine.act(name, arguments).ok, (task.name, arguments)
        assert len(machine.blocks) == len(template["blocks"]) + 1
