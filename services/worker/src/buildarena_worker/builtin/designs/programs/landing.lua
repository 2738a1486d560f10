-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
local RESTS_AT = 0.5
local landed = false

function control(t, sense)
  local speed, mark = sense.velocity, sense.marks.goal.relative
  local height = sense.position.z - RESTS_AT
  landed = landed or height < 0.25 and speed.z > -0.2
  if landed then return {} end
  local sink = math.min(12, 0.4 + 0.5 * height)
  -- Not down before it is above the mark.
  if math.sqrt(mark.x ^ 2 + mark.y ^ 2) > 1.5 and height < 6 then
    sink = math.min(sink, 0.5 * (height - 4))
  end
  local ax = clip($keen * mark.x - 1.3 * speed.x, 8)
  local ay = clip($keen * mark.y - 1.3 * speed.y, 8)
  return flown(sense, ax, ay, 2.5 * (-sink - speed.z))
end
