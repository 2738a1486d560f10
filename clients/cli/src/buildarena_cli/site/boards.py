"""A site's answers that are not of a single job: boards, tasks, models, sweeps, rows."""

from __future__ import annotations

import itertools
import json
from typing import Any, Final

from buildarena_benchmark.categories import categories as known_categories
from buildarena_cli.site.fetch import Answer, Answers, ask, document, page, question
from buildarena_cli.site.scope import Scope
from buildarena_client.client import Client
from buildarena_client.paths import at

EXPORTS: Final = {"csv": "csv", "parquet": "parquet", "latex": "tex"}
MAX_COMPARED: Final = 20
"""Models of a track whose comparisons are stored: each with each other is requested."""
LISTED_SWEEPS: Final = 50
"""As many as a page of sweeps shows."""
BOARD: Final = "/v1/leaderboard"


class Collected:
    """Collection of answers for a site."""

    def __init__(self, client: Client, scope: Scope) -> None:
        self._client = client
        self._scope = scope
        self.answers: Answers = {}
        self.left_out: list[str] = []

    def collect(self) -> None:
        """Request all answers."""
        self._listed = self._client.tasks()
        self._boards()
        self._comparisons()
        self._tasks()
        self._models()
        self._sweeps()

    def _boards(self) -> None:
        tasks = sorted({job["task"] for job in self._scope.ended})
        categories = sorted({task["category"] for task in self._listed if task["name"] in tasks})
        scopes: list[list[str]] = [[name] for name in categories]
        paper = [category.name for category in known_categories() if category.paper]
        if not {*paper}.isdisjoint(categories):
            scopes.append(paper)
        parts: list[dict[str, Any]] = [{}, *({"task": name} for name in tasks)]
        parts += [{"category": scope} for scope in scopes]
        # Pages ask without a track first, and get that of the scope or the default.
        for track, part in itertools.product((None, *self._scope.tracks), parts):
            asked = {"track": track, **part}
            self._hold(BOARD, asked)
            for form, ending in EXPORTS.items() if track is not None else ():
                self._hold(f"{BOARD}/export", {**asked, "format": form}, ending)

    def _hold(self, path: str, asked: dict[str, Any], ending: str = "json") -> Answer | None:
        """Store and return the answer to a page's request, limited to the site's scope."""
        scope = {name: value for name, value in self._scope.asked.items() if value is not None}
        answer = ask(self._client, path, ending=ending, **{**asked, **scope})
        if answer is not None and path == BOARD and self._scope.track is not None:
            # The service has other tracks too, but they are not on this site.
            answer = document({**json.loads(answer.content), "tracks": list(self._scope.tracks)})
        self.answers[question(path, asked)] = answer
        return answer

    def _comparisons(self) -> None:
        path = f"{BOARD}/compare"
        for track in (None, *self._scope.tracks):
            board = self._board_of(track)
            shown = board.get("track")
            models = sorted({job["model"] for job in self._scope.ended if job["track"] == shown})
            if len(models) > MAX_COMPARED:
                self.left_out.append(
                    f"Comparisons of models on {track or 'the default track'} are left out: "
                    f"there are {len(models)} models."
                )
                continue
            on_board = {row["model"] for task in board.get("tasks", ()) for row in task["rows"]}
            for first, second in itertools.permutations(filter(on_board.__contains__, models), 2):
                self._hold(path, {"first": first, "second": second, "track": track})

    def _board_of(self, track: str | None) -> dict[str, Any]:
        """Return the board of a track, by default the default one; empty without an answer."""
        board = self.answers[question(BOARD, {"track": track})]
        return {} if board is None else json.loads(board.content)

    def _tasks(self) -> None:
        versions = {(job["task"], job["task_version"]) for job in self._scope.jobs}
        names = {name for name, _ in versions}
        self.answers["/v1/tasks"] = page([task for task in self._listed if task["name"] in names])
        for name, version in sorted({*versions, *((name, None) for name in names)}, key=str):
            path = at("tasks", name)
            key = question(f"/v1/tasks/{name}", {"version": version})
            self.answers[key] = ask(self._client, path, version=version)

    def _models(self) -> None:
        used = {job["model"] for job in self._scope.jobs}
        self.answers["/v1/versions"] = document(self._client.get("/v1/versions"))
        listed = self._client.models()
        self.answers["/v1/models"] = page([model for model in listed if model["name"] in used])

    def _sweeps(self) -> None:
        sweeps = list(self._scope.sweeps)
        self.answers[question("/v1/sweeps", {"limit": LISTED_SWEEPS})] = page(sweeps)
        for sweep in sweeps:
            self.answers[f"/v1/sweeps/{sweep['id']}"] = document(sweep)
            path = f"/v1/sweeps/{sweep['id']}/faults"
            self.answers[path] = ask(self._client, path)
