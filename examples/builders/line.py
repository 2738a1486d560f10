"""Following a line: a car whose speed and turns follow from delay, grip and the line's bends."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

import math

from session import EAST, SOUTH, WEST, Session, Vector, play

LENGTH, HALF_TRACK = 2, 2

PROGRAM = """
local aside, kept = 0, 0

-- Curvature is asked for in proportion to how far aside the line is, and to how long it was there.
function control(t, sense)
  local line = sense.line
  if line.left + line.middle + line.right > 0 then
    aside = (line.right - line.left) * (line.middle == 1 and 0.5 or 1)
  elseif aside ~= 0 then
    aside = aside > 0 and 2 or -2
  end
  kept = math.max(-$bend, math.min($bend, kept + $learns * $tick * $bend * aside))
  local curve = kept + $bend * aside
  local left, right = $speed * (1 + curve * $half), $speed * (1 - curve * $half)
  return {
    ["$left_1.spinning_forward"] = left, ["$left_2.spinning_forward"] = left,
    ["$right_1.spinning_forward"] = right, ["$right_2.spinning_forward"] = right,
  }
end
"""


def build(session: Session) -> None:
    """Build a car of four wheels with its sensors in front, compute its speed, and submit."""
    session.do("start")
    wheels: dict[Vector, list[str]] = {EAST: [], WEST: []}
    for base in ("1", session.row("1", SOUTH, LENGTH)[-1]):
        for way, side in wheels.items():
            wheel = session.attach(session.row(base, way, HALF_TRACK)[-1], way, "Powered Wheel")
            # Its answer says which way it rolls; all shall roll north.
            if "<South>" in session.do("get_block_details", block_id=wheel):
                session.do("flip_spin", block_id=wheel)
            side.append(wheel)
    radius, motor = session.told("bends of radius"), session.told("Motor", "Powered Wheel")
    half = abs(session.place(wheels[EAST][0])[0])
    # The outer wheels run faster, in a bend twice as sharp as the line's by this, and the car must
    # not slide outwards: its wheels have a radius of 1.
    grip = session.told("friction", "Powered Wheel") * session.told("Gravity is")
    speed = min(motor / (1 + 2 * half / radius), math.sqrt(grip * radius / 2))
    named = zip(
        ("left_1", "left_2", "right_1", "right_2"), wheels[WEST] + wheels[EAST], strict=True
    )
    figures: dict[str, object] = dict(named)
    figures.update(half=half, bend=1 / radius, tick=session.told("called every"))
    session.submit_program(PROGRAM, figures, {"speed": speed / motor, "learns": speed / radius})


play(build, "line-1")
