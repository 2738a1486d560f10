-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
local TICK = 0.04
local sum = { x = 0, y = 0, z = 0 }
local before

function control(t, sense)
  local speed, mark, place = sense.velocity, sense.marks.goal.relative, sense.marks.goal.position
  local moves = {}
  for axis in pairs(sum) do
    moves[axis] = before and (place[axis] - before[axis]) / TICK or 0
  end
  before = place
  local near = math.sqrt(mark.x ^ 2 + mark.y ^ 2 + mark.z ^ 2) < 3
  local asked = {}
  for axis in pairs(sum) do
    -- What is missing for long is what the wind takes.
    if near then sum[axis] = sum[axis] + TICK * mark[axis] end
    asked[axis] = $keen * clip(mark[axis], 4) - 2.8 * (speed[axis] - moves[axis]) + sum[axis]
  end
  return flown(sense, clip(asked.x, 10), clip(asked.y, 10), asked.z)
end
