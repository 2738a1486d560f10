-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Drives towards the next gate, and through it once it is near; the more it must turn, the slower.
local LEFT, RIGHT = $left, $right

function control(t, sense)
  local here, forward, goal = sense.position, sense.forward, sense.gate.position
  local x, y = goal.x - here.x, goal.y - 0.5 - here.y
  if goal.y - here.y < 1.5 then y = 2.5 end
  local ahead = x * forward.x + y * forward.y
  local aside = x * forward.y - y * forward.x -- above 0 to the right
  local bearing = math.atan(aside, ahead)
  local turn = $keen * bearing + 0.15 * sense.spin.z
  local speed = math.max(0.15, 1 - 0.8 * math.abs(bearing))

  local answer = {}
  for _, wheel in ipairs(LEFT) do answer[wheel .. ".spinning_forward"] = speed + turn end
  for _, wheel in ipairs(RIGHT) do answer[wheel .. ".spinning_forward"] = speed - turn end
  return answer
end
