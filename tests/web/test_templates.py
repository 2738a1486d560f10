"""The machines that people may begin with, which the build page has as data."""

import json

from support.documents.pages import WEB

from buildarena_benchmark import builtin_tasks

TEMPLATES = json.loads((WEB / "src/pages/workbench/templates.json").read_text())


def test_a_template_can_be_built_in_every_task_that_it_is_for() -> None:
    families = {name: name.rpartition("-")[0] for name in builtin_tasks()}
    for template in TEMPLATES:
        assert set(template["families"]) <= set(families.values()), template["name"]
        for name, family in families.items():
            if family in template["families"]:
                task = builtin_tasks()[name]
                assert task.initial_machine is None, name
                machine = task.new_machine(task.constraints.catalogue)
                assert machine.act("start", {}).ok
                for base, face in template["blocks"]:
                    wood = {"base_block": base, "face": face, "new_block": "Small Wooden Block"}
                    assert machine.act("attach_block_to", wood).ok, (name, wood)
