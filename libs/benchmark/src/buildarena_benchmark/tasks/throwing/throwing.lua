-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Draws as many springs as bring the boulder to the ring, the last ones for some ticks only.
local SPRINGS, BEGINS, TICK = $springs, $begins, 0.04
-- What is aimed at, how many springs draw all the way, and for how many ticks the next do.
local SHOTS = {
$shots
}
local shot

local function nearest(aim)
  local best = SHOTS[1]
  for _, other in ipairs(SHOTS) do
    if math.abs(other[1] - aim) < math.abs(best[1] - aim) then best = other end
  end
  return best
end

function control(t, sense)
  shot = shot or nearest(sense.marks.ring.position.$axis - $level)
  local answer, ticks = {}, (t - BEGINS) / TICK + 0.5
  for number, spring in ipairs(SPRINGS) do
    local lasts = number <= shot[2] and 100 or shot[number - shot[2] + 2] or 0
    answer[spring .. ".contract"] = (ticks >= 0 and ticks < lasts) and 1 or 0
  end
  return answer
end
