-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Drives to each mark, with the end ahead that looks at it more, and waits there until it has stood.
local LEFT, RIGHT = $left, $right
local MARKS = { "first", "second", "third" }
local FASTEST, BRAKES, NEAR, STANDS_S = 10.47, $brakes, 0.3, 0.56
local number, way, stood = 1, nil, 0

local function clip(value, most) return math.max(-most, math.min(most, value)) end

function control(t, sense)
  local mark, forward = sense.marks[MARKS[number]], sense.forward
  if not mark then return {} end
  local x, y = mark.relative.x, mark.relative.y
  local ahead, aside = x * forward.x + y * forward.y, x * forward.y - y * forward.x
  way = way or (ahead < 0 and -1 or 1)
  local left = way * ahead
  if stood > 0 or left < NEAR then
    stood = stood + 0.04
    if stood > STANDS_S then number, way, stood = number + 1, nil, 0 end
    return {}
  end
  local bearing = math.atan(aside, left)
  local speed = way * math.min(1, math.sqrt(2 * BRAKES * left) / FASTEST, math.max(0.1, 1.2 - 2 * math.abs(bearing)))
  -- A bearing tells little of what is near.
  local turn = way * clip(bearing * math.min(1, left), 0.4) + 0.1 * sense.spin.z
  local answer = {}
  for _, wheel in ipairs(LEFT) do answer[wheel .. ".spinning_forward"] = speed + turn end
  for _, wheel in ipairs(RIGHT) do answer[wheel .. ".spinning_forward"] = speed - turn end
  return answer
end
