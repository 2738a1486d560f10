-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Falls fast and brakes late: what is slow burns fuel. It leans towards the mark meanwhile.
local RESTS_AT, FASTEST, BRAKES = 0.5, 24, 1.8
local landed = false

function control(t, sense)
  local speed, mark = sense.velocity, sense.marks.goal.relative
  local height = sense.position.z - RESTS_AT
  landed = landed or height < 0.25 and speed.z > -0.2
  if landed then return {} end
  local sink = math.min(FASTEST, 0.5 + BRAKES * height)
  -- Not down before it is above the mark, as long as there is fuel to wait.
  local apart = math.sqrt(mark.x ^ 2 + mark.y ^ 2)
  if apart > 1 and height < 4 and sense.fuel > 1 then sink = math.min(sink, 0.7 * (height - 2)) end
  local ax = clip($keen * mark.x - 2.2 * speed.x, 14)
  local ay = clip($keen * mark.y - 2.2 * speed.y, 14)
  -- What the braking itself takes, and what is missing for it.
  local braking = sink < FASTEST and -BRAKES * math.min(0, speed.z) or 0
  return flown(sense, ax, ay, braking + 4 * (-sink - speed.z))
end
