"""Imports all that our sources import, in the environment of an image, and says what fails.

So nothing is trimmed that a program needs, also where it imports it late, and what is loaded is
compiled. What is not installed in this image at all, and what a source tries with another way
beside it, may be missing.
"""

import ast
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator
from pathlib import Path

BY_NAME = (
    "celery.app.amqp",
    "celery.app.events",
    "celery.app.log",
    "celery.concurrency.prefork",
    "celery.concurrency.thread",
    "celery.fixups.django",
    "celery.loaders.app",
    "kombu.transport.redis",
    "sqlalchemy.dialects.postgresql.psycopg",
    "uvicorn.lifespan.on",
    "uvicorn.loops.uvloop",
    "uvicorn.protocols.http.httptools_impl",
    "uvicorn.protocols.websockets.auto",
)
"""Modules that libraries load by name."""
SITE = Path(sys.prefix, "lib", f"python3.{sys.version_info[1]}", "site-packages")
OURS = sorted(path.name for path in SITE.glob("buildarena*") if (path / "__init__.py").is_file())


def required(tree: ast.AST) -> Iterator[str]:
    """Modules that a source imports outside `try` and `if TYPE_CHECKING`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif not isinstance(node, ast.Try) and "TYPE_CHECKING" not in ast.unparse(
            getattr(node, "test", ast.Constant(0))
        ):
            yield from required(node)


def is_here(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


found: set[str] = set(BY_NAME)
for package in OURS:
    for path in (SITE / package).rglob("*.py"):
        found.update(required(ast.parse(path.read_text())))
    found.update(m.name for m in pkgutil.walk_packages([str(SITE / package)], f"{package}."))
failed = {}
for name in sorted(found):
    top = name.split(".")[0]
    if name.endswith("__main__") or not is_here(top):
        continue
    parent, _, last = name.rpartition(".")
    if parent and not is_here(name):
        # `from x import y`, where y is no module: importing x is enough, which has its own turn.
        continue
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if is_here((error.name or "").split(".")[0]):
            failed[name] = str(error)
    except ImportError as error:
        failed[name] = str(error)
if failed:
    sys.exit("\n".join(f"{name}: {why}" for name, why in failed.items()))
