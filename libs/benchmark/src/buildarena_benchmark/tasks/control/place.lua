-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Fits the mark's waves to what it senses, and flies along them against the wind.
local NEAR, FAR, STEP = 14, 20, 0.25
local AXES, PERIODS = { "x", "y", "z" }, {}
for _, axis in ipairs(AXES) do
  PERIODS[axis] = {}
  for period = NEAR, FAR, STEP do
    table.insert(PERIODS[axis], { rate = 2 * math.pi / period, n = 0, s = 0, ss = 0, p = 0, pp = 0, ps = 0 })
  end
end
-- Its mass is above the middle of the starting block, by the fans.
local ABOVE = 0.43
local here

-- Where the mark is along an axis, and its velocity and acceleration: the wave that fits best.
local function wave(axis, t, place)
  local best, least
  for _, w in ipairs(PERIODS[axis]) do
    local s = math.sin(w.rate * t)
    w.n, w.s, w.ss, w.p = w.n + 1, w.s + s, w.ss + s * s, w.p + place
    w.pp, w.ps = w.pp + place * place, w.ps + place * s
    local spread = w.ss - w.s * w.s / w.n
    local swing = spread > 1e-6 and (w.ps - w.p * w.s / w.n) / spread or 0
    local misses = w.pp - w.p * w.p / w.n - swing * (w.ps - w.p * w.s / w.n)
    if not least or misses < least then
      least, best = misses, { rate = w.rate, swing = swing, center = (w.p - swing * w.s) / w.n }
    end
  end
  local at = best.rate * (t + TICK)
  local sine, cosine = best.swing * math.sin(at), best.swing * math.cos(at)
  return best.center + sine, best.rate * cosine, -best.rate * best.rate * sine
end

function control(t, sense)
  local wind, speed, asked = blown(sense), sense.velocity, {}
  here = here or sense.position
  local now = {}
  for _, axis in ipairs(AXES) do
    -- What is sensed of its own place is noisy; its velocity is less so.
    local guess = here[axis] + TICK * speed[axis]
    now[axis] = guess + 0.15 * (sense.position[axis] - guess)
    local place, moves, turns = wave(axis, t - TICK, sense.marks.goal.position[axis])
    local missing = place - now[axis] - TICK * speed[axis] - ABOVE * sense.up[axis]
    asked[axis] = $keen * clip(missing, 4) + $damped * (moves - speed[axis]) + turns - wind[axis]
  end
  here = now
  return flown(sense, clip(asked.x, 14), clip(asked.y, 14), clip(asked.z, 14))
end
