-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Four pairs of nozzles round the start: their sum pushes along its up, how opposite ones differ
-- turns it. Each is pushed upwards by its left key.
local NORTH, EAST, SOUTH, WEST = $north, $east, $south, $west
local RADIUS, GRAVITY, PUSH = 600, 23, $push / $mass
local KEEN = 4

local function clip(value, most) return math.max(-most, math.min(most, value)) end
local function dot(a, b) return a.x * b.x + a.y * b.y + a.z * b.z end
local function cross(a, b)
  return { x = a.y * b.z - a.z * b.y, y = a.z * b.x - a.x * b.z, z = a.x * b.y - a.y * b.x }
end
local function scaled(a, by) return { x = a.x * by, y = a.y * by, z = a.z * by } end
local function sum(a, b) return { x = a.x + b.x, y = a.y + b.y, z = a.z + b.z } end
local function unit(a) return scaled(a, 1 / math.max(1e-9, math.sqrt(dot(a, a)))) end
local function flat(a, up) return sum(a, scaled(up, -dot(a, up))) end

-- Up, height, climb and level velocity above the ball below.
local function placed(sense)
  local arm = { x = sense.position.x, y = sense.position.y, z = sense.position.z + RADIUS }
  local up = unit(arm)
  local climb = dot(sense.velocity, up)
  return {
    up = up,
    radius = dot(arm, up),
    height = dot(arm, up) - RADIUS,
    climb = climb,
    level = flat(sense.velocity, up),
  }
end

-- What the nozzles shall do for an acceleration beside gravity.
local function pushed(sense, wanted)
  local size = math.sqrt(dot(wanted, wanted))
  local to = unit(wanted)
  local right = cross(sense.forward, sense.up)
  local turn = cross(sense.up, to)
  -- What points the wrong way is turned as fast as what lies aside.
  if dot(sense.up, to) < 0 then
    turn = math.abs(dot(turn, turn)) > 1e-4 and unit(turn) or sense.forward
  end
  local about_east, about_north = KEEN * dot(turn, right), KEEN * dot(turn, sense.forward)
  local lift = math.min(1, size / PUSH) * math.max(0, dot(sense.up, to))
  local answer = {}
  local function push(nozzle, level)
    level = clip(level, 1)
    answer[nozzle .. ".thrust_left"] = math.max(0, level)
    answer[nozzle .. ".thrust_right"] = math.max(0, -level)
  end
  about_east, about_north = clip(about_east, 0.6) / 2, clip(about_north, 0.6) / 2
  lift = math.min(lift, 1 - math.max(math.abs(about_east), math.abs(about_north)))
  push(NORTH, lift + about_east)
  push(SOUTH, lift - about_east)
  push(EAST, lift - about_north)
  push(WEST, lift + about_north)
  return answer
end

-- The push upwards that brings it to a height and keeps it there at its speed.
local learned = 0
local function risen(at, height)
  local below = height - at.height
  if math.abs(below) < 10 then learned = clip(learned + 0.01 * below, 6) end
  local fall = GRAVITY * (RADIUS / at.radius) ^ 2 - dot(at.level, at.level) / at.radius
  return fall + learned + clip(0.8 * below, 20) - 1.6 * at.climb
end

