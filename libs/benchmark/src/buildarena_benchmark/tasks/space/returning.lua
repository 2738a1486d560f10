-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
local HEIGHT, SPEED, TURNS, RESTS_AT = 80, $speed, 2 * math.pi, 0.5
local home, before, axis, landed
local angle, near = 0, false

function control(t, sense)
  local at = placed(sense)
  home = home or at.up
  if not axis and at.height > HEIGHT - 30 then axis = unit(cross(at.up, flat(sense.forward, at.up))) end
  if axis and not near then
    local level = unit(flat(at.up, axis))
    if before then angle = angle + math.asin(clip(dot(cross(before, level), axis), 1)) end
    before = level
  end
  local left = (TURNS + 0.02 - angle) * at.radius
  near = near or left < 1
  local drift = scaled(flat(home, at.up), at.radius)
  local wanted, height = { x = 0, y = 0, z = 0 }, HEIGHT
  if near then
    local away = math.sqrt(dot(drift, drift))
    wanted = scaled(drift, math.min(1, 25 / math.max(away, 1)) * 0.5)
    if away < 6 then height = at.height - clip(0.8 + 0.4 * (at.height - RESTS_AT), 12) end
  elseif axis then
    local way = unit(cross(axis, at.up))
    local across = -dot(at.up, axis) * at.radius
    wanted = sum(
      scaled(way, math.min(SPEED, math.sqrt(50 * math.max(left, 0)))),
      scaled(axis, clip(across, 10))
    )
  end
  landed = landed or near and at.height < RESTS_AT + 0.3 and at.climb > -0.3
  if landed then return {} end
  local aside = sum(wanted, scaled(at.level, -1))
  aside = scaled(aside, math.min(1.5, 60 / math.max(1, math.sqrt(dot(aside, aside)))))
  local push = risen(at, height)
  if near and height < HEIGHT then
    push = GRAVITY * (RADIUS / at.radius) ^ 2 + learned + 2.5 * (height - at.height - at.climb)
  end
  return pushed(sense, sum(scaled(at.up, push), aside))
end
