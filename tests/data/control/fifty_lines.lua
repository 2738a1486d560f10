-- A controller as people write it: gains, a filter, states, limits. Figures of speed are taken with it.
local STATES = { rising = 1, holding = 2, sinking = 3 }
local gains = { p = 0.4, i = 0.05, d = 0.2 }
local state = STATES.rising
local sum, before = 0, 0
local smoothed = { x = 0, y = 0 }
local since = 0

local function clipped(value, low, high)
  if value < low then
    return low
  elseif value > high then
    return high
  end
  return value
end

local function followed(name, value)
  smoothed[name] = smoothed[name] + 0.3 * (value - smoothed[name])
  return smoothed[name]
end

local function wanted_height(t)
  if t < 2 then
    return 2 + 4 * t
  end
  return state == STATES.sinking and 1 or 10
end

local function next_state(t, missing)
  if state == STATES.rising and math.abs(missing) < 0.5 then
    since = t
    return STATES.holding
  elseif state == STATES.holding and t - since > 20 then
    return STATES.sinking
  end
  return state
end

function control(t, sense)
  local missing = wanted_height(t) - sense.height
  state = next_state(t, missing)
  sum = clipped(sum + missing * 0.04, -5, 5)
  local rate = (missing - before) / 0.04
  before = missing
  local lift = gains.p * missing + gains.i * sum + gains.d * rate - 0.1 * sense.velocity.z
  local east, north = followed("x", sense.position.x), followed("y", sense.position.y)
  local answer = { fly = clipped(lift, 0, 1) }
  answer["7.push"] = clipped(-0.1 * east - 0.3 * sense.velocity.x - sense.up.x, 0, 1)
  answer["8.push"] = clipped(-0.1 * north - 0.3 * sense.velocity.y - sense.up.y, 0, 1)
  if state == STATES.sinking and sense.height < 1 then
    answer.fly = 0
  end
  return answer
end
