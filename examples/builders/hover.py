"""Following a moving place: four fans, whose gains follow from mass, inertia and delay."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from session import EAST, NORTH, SOUTH, UP, WEST, Session, play

ARM = 2

PROGRAM = """
local wind, goal, before, own = {}, {}, nil, nil

local function clip(value, most) return math.max(-most, math.min(most, value)) end

-- A place and its velocity, smoothed: what is seen corrects what was expected.
local function follow(axis, seen)
  local kept = goal[axis] or { at = seen, speed = 0 }
  kept.at = kept.at + kept.speed * $tick
  local missed = seen - kept.at
  kept.at = kept.at + 2 * $move * $tick * missed
  kept.speed = kept.speed + $move * $move * $tick * missed
  goal[axis] = kept
  return kept
end

function control(t, sense)
  local up, forward, spin, asked = sense.up, sense.forward, sense.body_spin, {}
  for axis, speed in pairs({ x = sense.velocity.x, y = sense.velocity.y, z = sense.velocity.z }) do
    -- Wind is what accelerates it besides its own fans and gravity.
    local found = before and (speed - before[axis]) / $tick - own[axis] or 0
    wind[axis] = (wind[axis] or 0) + $turn * $tick * (found - (wind[axis] or 0))
    local mark = follow(axis, sense.marks.goal.position[axis])
    local missing = mark.at + $age * (mark.speed - speed) - sense.position[axis] - $above * up[axis]
    local spring = $move * $move * clip(missing, 4)
    asked[axis] = clip(spring + 2 * $move * (mark.speed - speed) - wind[axis], $gravity / 2)
  end
  before = sense.velocity
  -- Its fans push along its own up axis, which is turned to where gravity and the rest ask.
  local x, y, z = asked.x, asked.y, asked.z + $gravity
  local size = math.sqrt(x * x + y * y + z * z)
  x, y, z = x / size, y / size, z / size
  own = { x = size * up.x, y = size * up.y, z = size * up.z - $gravity }
  local right = { x = forward.y * up.z - forward.z * up.y, y = forward.z * up.x - forward.x * up.z,
    z = forward.x * up.y - forward.y * up.x }
  local ahead = x * forward.x + y * forward.y + z * forward.z
  local aside = x * right.x + y * right.y + z * right.z
  local pitch = $inertia_x * (-$turn * $turn * ahead - 2 * $turn * spin.x) / (2 * $arm)
  local roll = $inertia_y * ($turn * $turn * aside - 2 * $turn * spin.y) / (2 * $arm)
  local share = $mass * size / 4
  return {
    ["$north.fly"] = clip((share + pitch) / $push, 1),
    ["$south.fly"] = clip((share - pitch) / $push, 1),
    ["$east.fly"] = clip((share - roll) / $push, 1),
    ["$west.fly"] = clip((share + roll) / $push, 1),
  }
end
"""


def build(session: Session) -> None:
    """Build a cross with a fan at the end of each arm, compute its gains, and submit."""
    session.do("start")
    ways = {"north": NORTH, "east": EAST, "south": SOUTH, "west": WEST}
    fans = {
        name: session.attach(session.row("1", way, ARM)[-1], UP, "Flying Block")
        for name, way in ways.items()
    }
    figures: dict[str, object] = {**fans, "arm": session.place(fans["north"])[1]}
    mass, middle, inertia = session.summary()
    figures.update(mass=mass, above=middle[2], inertia_x=inertia[0], inertia_y=inertia[1])
    gravity, push = session.told("Gravity is"), session.told("Fly pushes", "Flying Block")
    tick, age = session.told("called every"), session.told("Senses are")
    # A loop may answer at most at 0.4 over its delay, rad/s; the one around it at a third of that.
    turn = 0.4 / (age + tick / 2)
    figures.update(gravity=gravity, push=push * gravity, turn=turn, tick=tick, age=age)
    session.submit_program(PROGRAM, figures, {"move": turn / 3})


play(build, "hover-4")
