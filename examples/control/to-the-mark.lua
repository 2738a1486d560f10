-- Turns towards the mark, drives there, and stops: the wheels of either side have their own share.
local LEFT, RIGHT = { "9", "13" }, { "7", "11" }

function control(t, sense)
  local mark, forward = sense.marks.goal.relative, sense.forward
  local apart = math.sqrt(mark.x ^ 2 + mark.y ^ 2)
  local ahead = mark.x * forward.x + mark.y * forward.y
  local aside = mark.x * forward.y - mark.y * forward.x -- above 0 to the right
  local bearing = math.atan(aside, ahead)
  local speed = apart > 0.7 and math.min(1, apart / 30) or 0
  local turn = apart > 0.7 and 0.5 * bearing + 0.1 * sense.spin.z or 0

  local answer = {}
  for _, wheel in ipairs(LEFT) do
    answer[wheel .. ".spinning_forward"] = speed + turn
  end
  for _, wheel in ipairs(RIGHT) do
    answer[wheel .. ".spinning_forward"] = speed - turn
  end
  return answer
end
