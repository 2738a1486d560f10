-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Where to walk, from north towards east, and how long a step may be: to the corner, then along a
-- line to the east. Near the corner steps are short, so as not to go beyond it.
local SHORT, BEYOND, ALONG = 2.2, 0.4, 4
local GENTLE, round = true, false

local function aim(sense)
  local corner = sense.marks.corner.relative
  round = round or corner.y < BEYOND and sense.up.z > 0.998
  if round then return math.atan(ALONG, corner.y), 2 end
  return math.atan(corner.x, corner.y + 2), corner.y < SHORT and 1 or 2
end
