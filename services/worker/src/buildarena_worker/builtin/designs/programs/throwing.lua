-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Draws as many springs as bring the boulder to the ring, the last ones for some ticks only.
local SPRINGS, BEGINS, TICK, LINE = $springs, $begins, 0.04, 2
-- How far beyond the line, how many springs draw all the way, and for how many ticks the next do.
local SHOTS = {
  { 13.5, 4, 5, 3 }, { 14.0, 4, 5 }, { 17.4, 4, 6, 3 }, { 18.2, 4, 6 }, { 20.8, 4, 7, 3 },
  { 21.9, 4, 7 }, { 22.6, 4, 8, 3 }, { 23.8, 4, 8 }, { 24.6, 5 }, { 25.0, 5, 4 }, { 28.3, 5, 5, 3 },
  { 29.4, 5, 5 }, { 32.7, 5, 6, 3 }, { 34.0, 5, 6 }, { 36.3, 5, 7, 3 }, { 38.1, 5, 7 }, { 40.0, 5, 8 },
}
local shot

local function nearest(far)
  local best = SHOTS[1]
  for _, other in ipairs(SHOTS) do
    if math.abs(other[1] - far) < math.abs(best[1] - far) then best = other end
  end
  return best
end

function control(t, sense)
  shot = shot or nearest(sense.marks.ring.position.y - LINE)
  local answer, ticks = {}, (t - BEGINS) / TICK + 0.5
  for number, spring in ipairs(SPRINGS) do
    local lasts = number <= shot[2] and 100 or shot[number - shot[2] + 2] or 0
    answer[spring .. ".contract"] = (ticks >= 0 and ticks < lasts) and 1 or 0
  end
  return answer
end
