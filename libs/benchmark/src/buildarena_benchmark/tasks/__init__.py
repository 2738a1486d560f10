"""Built-in tasks, a folder a category, and the format of task files.

Folders in the variable `BUILDARENA_CATEGORIES`, separated as in `PATH`, add categories: each is a
folder like those here, and its name is the category's.
"""

import os
from pathlib import Path

__path__ += [
    str(Path(folder).parent)
    for folder in os.environ.get("BUILDARENA_CATEGORIES", "").split(os.pathsep)
    if folder
]
