-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
local HEIGHT, SPEED = 40, $speed

function control(t, sense)
  local at = placed(sense)
  local way = unit(dot(at.level, at.level) > 4 and at.level or flat(sense.forward, at.up))
  local speed = dot(at.level, way)
  local ahead = 0
  if at.height > 15 then ahead = clip(2 * (SPEED - speed) + 0.1 * speed, 60) end
  return pushed(sense, sum(scaled(at.up, risen(at, HEIGHT)), scaled(way, ahead)))
end
