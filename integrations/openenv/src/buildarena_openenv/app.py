"""The application with its defaults, for tools that start what `openenv.yaml` names."""

from buildarena_openenv.server import build_app

app = build_app()
