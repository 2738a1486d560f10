"""A model that plays every role of a task for programs from nothing but what it reads.

It knows how a craft of four fans flies. Modules, masses, pushes, the names of senses, actions and
the mark, how a program is written and where it stands in an answer are those in its prompts.
"""

from __future__ import annotations

import re
from string import Template

from support.providers.engineer import Told

from buildarena_backend.journal.journal import Usage
from buildarena_worker.builtin.designs.design import Design, PartDesign
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, WEST, Draft
from buildarena_worker.builtin.expert import answered
from buildarena_worker.builtin.reading import read_situation
from buildarena_worker.session.messages import Completion, Request

ARM = 2
POSE = ("position", "velocity", "up", "forward", "body_spin")

PROGRAM = Template("""
local ids = { $ids }
local done = false
local function within(x, most) return math.max(-most, math.min(most, x)) end
function control(t, sense)
  local p, v, u, f, w = sense.position, sense.velocity, sense.up, sense.forward, sense.body_spin
  local m = sense.marks["$mark"].relative
  local high = p.z - 0.5
  if high < 0.2 and v.z > -0.3 then done = true end
  if done then return {} end
  local away = math.sqrt(m.x * m.x + m.y * m.y)
  local down = math.min(10, 0.5 + 0.4 * high)
  if away > $near then down = math.min(down, 0.6 * (high - 5)) end
  local ax, ay = within(0.6 * m.x - 1.4 * v.x, 7), within(0.6 * m.y - 1.4 * v.y, 7)
  local az = math.max($gravity + 2 * (-down - v.z), 0.3 * $gravity)
  local a = math.sqrt(ax * ax + ay * ay + az * az)
  -- From up towards the push that is wanted: about the axis up x wanted, in the craft's own axes.
  local cx, cy, cz = (u.y * az - u.z * ay) / a, (u.z * ax - u.x * az) / a, (u.x * ay - u.y * ax) / a
  local ex, ey, ez = f.y * u.z - f.z * u.y, f.z * u.x - f.x * u.z, f.x * u.y - f.y * u.x
  local pitch = $inertia * (30 * (cx * ex + cy * ey + cz * ez) - 9 * w.x) / (2 * $arm)
  local roll = $inertia * (30 * (cx * f.x + cy * f.y + cz * f.z) - 9 * w.y) / (2 * $arm)
  local each = $mass * a * math.max(0.3, u.z) / 4
  return {
    [ids.n .. ".$action"] = within((each + pitch) / $push, 1),
    [ids.s .. ".$action"] = within((each - pitch) / $push, 1),
    [ids.e .. ".$action"] = within((each - roll) / $push, 1),
    [ids.w .. ".$action"] = within((each + roll) / $push, 1),
  }
end
""")


def craft(told: Told) -> Design:
    """A cross of small blocks, and at each end the module that pushes itself."""
    fans = re.findall(r"^- ([\w ]+?)(?: \(|: ).*(?:does|actions) fly\b", told.text, re.MULTILINE)
    if not fans:
        raise LookupError("the prompt has no module that flies")
    draft = Draft(modules="workshop")
    middle = draft.start()
    for way in (NORTH, EAST, SOUTH, WEST):
        draft.attach(draft.row(middle, way, ARM)[-1], UP, fans[0])
    part = PartDesign(description="four arms, a fan on each", actions=tuple(draft.actions))
    return Design(overall="a cross that flies", parts={"craft": part})


def program(told: Told) -> str:
    """The controller's answer."""
    line = r"^(\d+) [\w ]+, on \S+, at \[(-?\d), (-?\d), \S+\].*; actions: (\w+) "
    fans = re.findall(line, told.text, re.MULTILINE)
    places = {"n": (0, ARM), "e": (ARM, 0), "s": (0, -ARM), "w": (-ARM, 0)}
    ids = {
        side: block
        for side, at in places.items()
        for block, x, y, _ in fans
        if at == (int(x), int(y))
    }
    line = r"^- `sense\.(position)`, (.*) of the starting block"
    senses = re.search(line, told.text, re.MULTILINE)
    offered = ["position", *re.findall(r"`\.(\w+)`", senses[2])] if senses else []
    missing = [name for name in POSE if name not in offered]
    mark = re.search(r"The mark,\s+`(\w+)`, lies on the ground", told.text)
    if missing or len(ids) != len(places) or mark is None or "sense.marks[name]" not in told.text:
        raise LookupError(f"the prompt does not say how to fly: {missing}, {ids}, {mark}")
    gravity = told.number("Gravity is # units/s")
    mass, fan = told.number("has a mass of #, with"), told.number("x 1; mass #; actions fly")
    text = PROGRAM.substitute(
        ids=", ".join(f'{side} = "{block}"' for side, block in ids.items()),
        action=fans[0][3],
        mark=mark[1],
        near=told.number("less than # from the mark") / 2,
        gravity=gravity,
        mass=mass,
        arm=ARM,
        inertia=2 * fan * ARM**2 + (mass - 4 * fan) * ARM**2 / 4,
        push=told.number("with a force that carries a mass of #") * gravity,
    )
    if "one block of Lua between lines of three backquotes" not in told.text:
        raise LookupError("the prompt does not say how a program is answered")
    return f"I fly it.\n```lua{text}```\n"


class FlyingEngineer:
    """Plays all workflows."""

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self._design: Design | None = None

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        self.requests.append(request)
        situation = read_situation(request)
        told = Told("\n".join(message.text for message in request.messages))
        if situation.role == "controller":
            reply = Completion(text=program(told))
        elif self._design is None and "[guidance]" not in told.text and "fly" not in told.text:
            reply = Completion(text="I build: tell me blocks by number and faces by letter.")
        else:
            self._design = self._design or craft(told)
            reply = answered(self._design, situation, request)
        usage = Usage(requests=1, input_tokens=len(told.text) // 4, output_tokens=20)
        return Completion(text=reply.text, calls=reply.calls, usage=usage, latency_s=1.0)
