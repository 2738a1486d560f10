-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Keeps the mass above the axle: the wheels run after it, and a little farther, so as to come back.
local LEFT, RIGHT = $left, $right
local RADIUS, FASTEST, TICK = 1, 10.47, 0.04
-- What each adds to the speed asked for in a tick; more than the tyres bear is never added.
local LEAN, LEANING, ROLL, PLACE, ASKED, MOST = 13.1, 7, 1.1, $keen, 0.415, 0.8
local place, asked = 0, 0

local function clip(value, most) return math.max(-most, math.min(most, value)) end

function control(t, sense)
  local up, forward, spin = sense.up, sense.forward, sense.body_spin
  local level = math.sqrt(forward.x ^ 2 + forward.y ^ 2)
  -- The lean forwards, told by both axes, and how fast it grows.
  local lean = ((up.x * forward.x + up.y * forward.y) / level - forward.z) / 2
  local leaning = -spin.x
  local roll = (sense.wheels[LEFT].speed + sense.wheels[RIGHT].speed) / 2
  if t > 0 then place = place + TICK * RADIUS * (roll + leaning) end

  local more = LEAN * lean + LEANING * leaning + ROLL * roll + PLACE * clip(place, 3) - ASKED * asked
  asked = clip(asked + clip(more, MOST), FASTEST)
  local turn = clip(0.3 * forward.x / level - 0.05 * spin.z, 0.1)
  return {
    [LEFT .. ".spinning_forward"] = asked / FASTEST - turn,
    [RIGHT .. ".spinning_forward"] = asked / FASTEST + turn,
  }
end
