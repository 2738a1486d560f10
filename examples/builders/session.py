"""A builder's session: tool calls, and the numbers that the briefing and the answers tell."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from string import Template

from buildarena_benchmark.environment import Environment, Trial, call

Vector = tuple[float, float, float]
EAST, WEST = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
NORTH, SOUTH = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
WOOD = "Small Wooden Block"
_NUMBER = r"(-?[\d.]+)"
_TRIPLE = rf"\[{_NUMBER}, {_NUMBER}, {_NUMBER}\]"


class Session:
    """A session of a builder without a model.

    Attributes:
        briefing: All that a builder is told before it begins.
        tests: Number of test trials, which come before the one that counts.
    """

    def __init__(self, task: str, simulator: str, seed: int | None) -> None:
        self._environment = Environment(task, simulator, seed=seed)
        self.briefing = self._environment.observation.briefing
        self.tests = int(self.told("The first"))

    def told(self, words: str, module: str = "") -> float:
        """Return the number that follows some words, in the whole briefing or a module's line."""
        line = re.search(rf"^- {module} \(.*$", self.briefing, re.MULTILINE)
        text = line[0] if module and line else self.briefing
        found = re.search(rf"{words} {_NUMBER}", text.replace("\n", " "))
        if found is None:
            raise SystemExit(f"nothing is told of {words!r} {module}")
        return float(found[1].rstrip("."))

    def do(self, tool: str, **arguments: object) -> str:
        """Carry a call out, and exit if it is refused."""
        answer = call(self._environment, tool, arguments)
        if not answer.accepted:
            raise SystemExit(f"{tool}({arguments}): {answer.text}")
        return answer.text

    def attach(self, base: str, way: Vector, module: str = WOOD) -> str:
        """Attach a block to the face of a block that lies farthest in a direction."""
        face = self.face(base, way)
        return _made(self.do("attach_block_to", base_block=base, face=face, new_block=module))

    def row(self, base: str, way: Vector, count: int) -> list[str]:
        """Attach blocks one after the other; return the base and them."""
        blocks = [base]
        for _ in range(count):
            blocks.append(self.attach(blocks[-1], way))
        return blocks

    def connect(self, ends: Sequence[tuple[str, Vector]], connector: str = "Brace") -> str:
        """Join a face of one block to a face of another."""
        (a, way), (b, other) = ends
        faces = {"face_a": self.face(a, way), "face_b": self.face(b, other)}
        return _made(self.do("connect_blocks", block_a=a, block_b=b, connector=connector, **faces))

    def face(self, block: str, way: Vector) -> str:
        """Return the letter of the face whose centre lies farthest in a direction."""
        text = self.do("get_block_details", block_id=block)
        faces = re.findall(rf"\b([A-Z]) <[^>]*> {_TRIPLE}", text)
        return str(max(faces, key=lambda face: dot(way, numbers(face[1:])))[0])

    def place(self, block: str) -> Vector:
        """Return where a block is, as built."""
        return numbers(re.findall(_TRIPLE, self.do("get_block_details", block_id=block))[0])

    def summary(self) -> tuple[float, Vector, Vector]:
        """Return the machine's mass, centre of mass and moments of inertia."""
        text = self.do("get_machine_summary")
        mass = re.findall(rf"mass {_NUMBER}", text)[0]
        inertia = re.findall(rf"along x, y, z: {_NUMBER}, {_NUMBER}, {_NUMBER}[;.]", text)[0]
        return float(mass), numbers(re.findall(_TRIPLE, text)[0]), numbers(inertia)

    def submit(self) -> Trial:
        """Have the machine tried."""
        submission = self._environment.submit()
        print(submission.report)
        return submission.trial

    def submit_program(
        self, program: str, figures: Mapping[str, object], careful: Mapping[str, float]
    ) -> None:
        """Use all test trials, then submit.

        Args:
            program: Lua, with names of figures after dollar signs.
            careful: Figures to reduce by 15 % after each failed trial.
        """
        share = 1.0
        for _ in range(self.tests + 1):
            less = {name: share * figure for name, figure in careful.items()}
            self.do("set_controller", program=Template(program).substitute(figures, **less))
            share *= 1 if self.submit().counts else 0.85


def play(build: Callable[[Session], None], task: str) -> None:
    """Play a task; the command line may name an engine, and a seed after it."""
    named = dict(enumerate(sys.argv[1:]))
    build(Session(task, named.get(0, "mujoco"), int(named[1]) if 1 in named else None))


def numbers(texts: Sequence[str]) -> Vector:
    """Return three numbers."""
    x, y, z = map(float, texts)
    return x, y, z


def dot(first: Vector, second: Vector) -> float:
    """Return the inner product."""
    return sum(a * b for a, b in zip(first, second, strict=True))


def _made(text: str) -> str:
    """Return the id of what an answer says was made."""
    return str(re.findall(r"^\w+\. (\w+)", text)[0])
