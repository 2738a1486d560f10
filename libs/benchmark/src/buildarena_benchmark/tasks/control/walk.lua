-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- The body stands while the inner feet hang, turn and slide ahead; then they stand and it follows.
local HINGE, SLIDES, LIFTS = $hinge, $slides, $lifts
local BODY_FEET, INNER_FEET = $body_feet, $inner_feet
sensors = {}
for _, feet in ipairs({ BODY_FEET, INNER_FEET }) do
  for _, foot in ipairs(feet) do table.insert(sensors, foot) end
end
local RATE, MOST, AHEAD, EVEN, CLEAR, FULL, NEAR = 1.5708, 0.66, 0.2, 1, $keen, 0.1, 0.15
local lowered, yaw, step, ticks = false, 0, 0, 0

local function clip(value, most) return math.max(-most, math.min(most, value)) end

local function length(sense, blocks)
  local sum = 0
  for _, block in ipairs(blocks) do sum = sum + sense.joints[block].length end
  return sum
end

local function hang(sense, feet)
  for _, foot in ipairs(feet) do
    if sense.contacts[foot] > 0 then return false end
  end
  return true
end

local function turn_by(angle)
  angle = angle % (2 * math.pi)
  return angle > math.pi and angle - 2 * math.pi or angle
end

function control(t, sense)
  local way, longest = aim(sense)
  local angle = sense.joints[HINGE].angle
  local body = turn_by(math.atan(sense.forward.x, sense.forward.y) - way)
  local inner = turn_by(body + angle)
  local low, slid = length(sense, LIFTS), length(sense, SLIDES)
  if not lowered and low < EVEN - CLEAR and (hang(sense, INNER_FEET) or low < FULL) then
    yaw = clip(-body, MOST)
    step = math.abs(body + yaw) < AHEAD and longest or 0
  elseif lowered and low > EVEN + CLEAR and (hang(sense, BODY_FEET) or low > 2 - FULL) then
    yaw = clip(inner, MOST)
    if math.abs(yaw - angle) < 2 * AHEAD then step = 0 end
  end

  local ready = math.abs(yaw - angle) < 0.05 and math.abs(slid - step) < NEAR
  if not lowered and low < EVEN - CLEAR and ready then lowered = true
  elseif lowered and low > EVEN + CLEAR and ready and step == 0 then lowered = false end

  local answer = { [HINGE .. ".turn_right"] = clip((yaw - angle) / (0.12 * RATE), 1) }
  for number, block in ipairs(SLIDES) do answer[block .. ".extend"] = number <= step and 1 or 0 end
  -- Who lands gently draws in the lifts one after the other, and holds them in every fourth tick.
  ticks = ticks + 1
  for number, block in ipairs(LIFTS) do
    local share = lowered and 1 or 0
    if GENTLE and not lowered then
      if number == 2 and sense.joints[LIFTS[1]].length > 0.05 then share = 1
      elseif ticks % 4 == 0 then share = 0.01 end
    end
    answer[block .. ".extend"] = share
  end
  return answer
end
