"""Questions about the modules that a machine may be made of; they change nothing."""

from buildarena_geometry.actions.lookups import nearest
from buildarena_geometry.actions.parameters import Name, RefusalError, quote
from buildarena_geometry.feedback import modules as words
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.module import Module
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.outcomes import Cause
from buildarena_geometry.state import Change, MachineState


def list_module_categories(state: MachineState) -> Change:
    """List the categories of modules and their sizes."""
    return Change(after=state, render=lambda: words.categories_text(state.catalogue))


def list_modules(state: MachineState, category: Name) -> Change:
    """List the modules of a category.

    Args:
        category: Name of the category.
    """
    categories = words.modules_of_category(state.catalogue)
    name = CaselessNames(categories).find(category)
    if name is None:
        text = f"There is no category {quote(category)}. Categories: {listing(categories)}."
        raise RefusalError(Cause.UNKNOWN_MODULE, text)
    return Change(after=state, render=lambda: words.category_text(state.catalogue, name))


def describe_module(state: MachineState, module: Name) -> Change:
    """Describe one or several modules, names separated by commas.

    Args:
        module: Name of the module, or several names with commas between them.
    """
    names = [name for name in module.split(",") if name.strip()] or [module]
    described = [_described(state, name.strip()) for name in names]
    modules = {entry.name: entry for entry in described}.values()
    return Change(
        after=state,
        render=lambda: "\n\n".join(words.module_text(entry, state.catalogue) for entry in modules),
    )


def _described(state: MachineState, name: str) -> Module:
    module = state.catalogue.named(name)
    if module is None or module.kind == "cargo":
        choices = [other.name for other in state.catalogue.values() if other.kind != "cargo"]
        text = f"There is no module {quote(name)}. Modules: {nearest(name, choices)}."
        raise RefusalError(Cause.UNKNOWN_MODULE, text)
    return module
