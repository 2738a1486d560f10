-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Steers towards where the sensors see the line; the bend that it drives it keeps in mind.
local LEFT, RIGHT = $left, $right
local TICK, SPEED = 0.04, $speed
local bend, aside = 0, 0

local function clip(value, most) return math.max(-most, math.min(most, value)) end

function control(t, sense)
  local line = sense.line
  -- Where the line is seen: above 0 to the right; once it is lost, beyond where it was last.
  local sees = line.left + line.middle + line.right
  if sees > 0 then aside = (line.right - line.left) * (line.middle == 1 and $near or 1)
  elseif aside ~= 0 then aside = aside > 0 and 1.6 or -1.6 end
  bend = clip(bend + TICK * $learns * aside, 0.25)
  local turn = bend + $keen * aside
  local speed = SPEED * (1 - 0.35 * math.min(1, math.abs(aside)))

  local answer = {}
  for _, wheel in ipairs(LEFT) do answer[wheel .. ".spinning_forward"] = speed + turn end
  for _, wheel in ipairs(RIGHT) do answer[wheel .. ".spinning_forward"] = speed - turn end
  return answer
end
