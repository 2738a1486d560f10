"""Putting a cargo on a mark: an arm of two links, whose angles follow from its lengths."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from session import DOWN, EAST, NORTH, SOUTH, UP, WEST, Session, play

FOOT, TOES, POST, LINK = 5, 4, 4, 4

PROGRAM = """
-- A piston that is asked for nothing returns; the least that it is asked for holds it.
local HOLD = 1e-4
local seen, count, step, since = {}, 0, 1, 0
local turned = { ["$shoulder"] = 0, ["$elbow"] = 0 }

local function clip(value, most) return math.max(-most, math.min(most, value)) end

-- The law of cosines: the elbow's angle from the distance, the shoulder's from the direction.
local function reach(sense, answer, to)
  local square = to.x * to.x + to.y * to.y
  local elbow = math.acos(clip((square - $near * $near - $far * $far) / (2 * $near * $far), 1))
  local inner = math.atan2($far * math.sin(elbow), $near + $far * math.cos(elbow))
  local wanted = { ["$shoulder"] = math.atan2(-to.x, to.y) - inner, ["$elbow"] = elbow }
  local most = 0
  for joint, angle in pairs(wanted) do
    local missing = angle - sense.joints[joint].angle
    missing = missing - 2 * math.pi * math.floor(missing / (2 * math.pi) + 0.5)
    -- The fastest from which it can still stop in time, and no more than its drive.
    local speed = math.min(math.sqrt(2 * $brakes * math.abs(missing)), $gain * math.abs(missing))
    speed = math.min(speed, $drive) * (missing < 0 and -1 or 1)
    turned[joint] = turned[joint] + clip(speed - turned[joint], $brakes * $tick)
    answer[joint .. ".turn_left"] = turned[joint] / $drive
    most = math.max(most, math.abs(missing))
  end
  return most < 0.02
end

-- Both pistons together towards a length: gently, as what they touch must not be knocked.
local function lower(sense, answer, length)
  local out = sense.joints["$upper"].length + sense.joints["$lower"].length
  answer.extend = math.max(HOLD, clip(length - out, 0.2))
  return length - out < 0.02
end

-- A piston returns fast without a key: first the one, then the other.
local function raise(answer, t)
  answer["$lower.extend"] = t < 1 and HOLD or 0
  return t > 2
end

local STEPS = {
  function(sense, answer, t)
    count = count + 1
    for name, at in pairs({ cargo = sense.cargo.relative, goal = sense.marks.goal.relative }) do
      seen[name] = seen[name] or { x = 0, y = 0 }
      seen[name].x = seen[name].x + (at.x - seen[name].x) / count
      seen[name].y = seen[name].y + (at.y - seen[name].y) / count
    end
    return t > 1
  end,
  function(sense, answer, t) return reach(sense, answer, seen.cargo) end,
  function(sense, answer, t)
    reach(sense, answer, seen.cargo)
    return lower(sense, answer, $drop)
  end,
  function(sense, answer, t) return raise(answer, t) end,
  function(sense, answer, t) return reach(sense, answer, seen.goal) and t > 1 end,
  function(sense, answer, t)
    reach(sense, answer, seen.goal)
    return lower(sense, answer, $drop - $grip / 2)
  end,
  function(sense, answer, t)
    answer.extend, answer["$gripper.release"] = HOLD, 1
    return t > 0.5
  end,
  function(sense, answer, t) answer["$gripper.release"] = 1 raise(answer, t) end,
}

function control(t, sense)
  local answer = {}
  if STEPS[step](sense, answer, t - since) then step, since = step + 1, t end
  return answer
end
"""


def build(session: Session) -> None:
    """Build a foot, a post and an arm of two links, compute its motion, and submit."""
    session.do("start")
    for way in (NORTH, SOUTH):
        end = session.row("1", way, FOOT)[-1]
        for side in (EAST, WEST):
            session.row(end, side, TOES)
    post = session.row("1", UP, POST)[-1]
    foot_mass = session.summary()[0]
    shoulder = session.attach(post, UP, "Steering Block")
    elbow = session.attach(session.row(shoulder, NORTH, LINK)[-1], UP, "Steering Block")
    upper = session.attach(session.row(elbow, NORTH, LINK)[-1], DOWN, "Piston")
    lower = session.attach(upper, DOWN, "Piston")
    gripper = session.attach(lower, DOWN, "Grabber")

    near = session.place(elbow)[1]
    far = session.place(gripper)[1] - near
    heaviest = session.told("mass, from [0-9.]+ to")
    moved = session.summary()[0] - foot_mass + heaviest
    torque = session.told("torque up to", "Steering Block") * session.told("Gravity is")
    grip = session.told("Holds what comes within", "Grabber")
    # The gripper's tip is half a block below its middle, the ground half a block below the start.
    clearance = session.place(gripper)[2] - session.told("The cargo is a box of")
    tick, age = session.told("called every"), session.told("Senses are")
    figures: dict[str, object] = {"shoulder": shoulder, "elbow": elbow, "gripper": gripper}
    figures.update(upper=upper, lower=lower, near=near, far=far, tick=tick, grip=grip)
    figures.update(drive=session.told("drive", "Steering Block"), gain=0.4 / (age + tick / 2))
    figures.update(drop=clearance - grip / 2)
    # Half of the torque turns all that moves, as if it were at the arm's far end.
    brakes = torque / 2 / (moved * (near + far) ** 2)
    session.submit_program(PROGRAM, figures, {"brakes": brakes})


play(build, "place-2")
