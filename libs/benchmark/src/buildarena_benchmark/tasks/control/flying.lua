-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Four fans on a cross: their sum holds it up, and how opposite ones differ turns it.
local NORTH, EAST, SOUTH, WEST = $north, $east, $south, $west
local PUSH, ARM, MASS, INERTIA, GRAVITY = $push, $arm, $mass, $inertia, $gravity
local STIFF, DAMPED, TICK, LEARNS = 45, 13, 0.04, 0.3
local pushed, before, blow = nil, nil, { x = 0, y = 0, z = 0 }

local function clip(value, most) return math.max(-most, math.min(most, value)) end

-- What accelerates it beside its fans and gravity, smoothed: wind and drag.
local function blown(sense)
  for axis, learned in pairs(blow) do
    if before then
      local found = (sense.velocity[axis] - before[axis]) / TICK - pushed[axis]
      blow[axis] = learned + LEARNS * (found - learned)
    end
  end
  before = sense.velocity
  return blow
end

-- What the fans shall do for an acceleration: up points to where it and gravity together do.
local function flown(sense, ax, ay, az)
  local up, forward, spin = sense.up, sense.forward, sense.body_spin
  az = math.max(GRAVITY + az, 0.3 * GRAVITY)
  local size = math.sqrt(ax * ax + ay * ay + az * az)
  ax, ay, az = ax / size, ay / size, az / size
  -- The turn from up to there, and its parts about the machine's own axes.
  local tx, ty, tz = up.y * az - up.z * ay, up.z * ax - up.x * az, up.x * ay - up.y * ax
  local rx = forward.y * up.z - forward.z * up.y
  local ry = forward.z * up.x - forward.x * up.z
  local rz = forward.x * up.y - forward.y * up.x
  local east = STIFF * (tx * rx + ty * ry + tz * rz) - DAMPED * spin.x
  local north = STIFF * (tx * forward.x + ty * forward.y + tz * forward.z) - DAMPED * spin.y
  local lift = MASS * size * math.max(0.2, up.z) / 4
  local along = 4 * lift / MASS
  pushed = { x = along * up.x, y = along * up.y, z = along * up.z - GRAVITY }
  local about_east, about_north = INERTIA / ARM * east / 2, INERTIA / ARM * north / 2
  return {
    [NORTH .. ".fly"] = clip((lift + about_east) / PUSH, 1),
    [SOUTH .. ".fly"] = clip((lift - about_east) / PUSH, 1),
    [EAST .. ".fly"] = clip((lift - about_north) / PUSH, 1),
    [WEST .. ".fly"] = clip((lift + about_north) / PUSH, 1),
  }
end

