-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Falls fast and brakes late: what is slow burns fuel. It leans towards the mark and against the wind.
local RESTS_AT, FASTEST, BRAKES, SOFT = 0.5, 24, 14, 2.2
local NEAR, WAITS_AT = 1.6, 1
local landed = false

function control(t, sense)
  local wind, speed, mark = blown(sense), sense.velocity, sense.marks.goal.relative
  local height = sense.position.z - RESTS_AT + TICK * speed.z
  landed = landed or height < 0.15 and speed.z > -0.3
  if landed then return {} end
  local sink = math.min(FASTEST, 0.5 + SOFT * height, math.sqrt(2 * BRAKES * math.max(height, 0)))
  -- Not down before it is above the mark, as long as there is fuel to wait.
  local apart = math.sqrt(mark.x ^ 2 + mark.y ^ 2) + 0.4 * math.sqrt(speed.x ^ 2 + speed.y ^ 2)
  if apart > NEAR and sense.fuel > 1.5 then sink = math.min(sink, 1.5 * (height - WAITS_AT)) end
  local ax = clip($keen * mark.x - $damped * speed.x, 20) - wind.x
  local ay = clip($keen * mark.y - $damped * speed.y, 20) - wind.y
  -- What the braking itself takes, and what is missing for it.
  local braking = sink < FASTEST and math.min(BRAKES, -SOFT * math.min(0, speed.z)) or 0
  return flown(sense, ax, ay, braking + 4 * (-sink - speed.z) - wind.z)
end
